"""Studies whose run files are written by hand: what they came to is known."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import yaml

from ddenv.claims import is_minimal, verdict_on
from ddenv.rates import wilson_interval
from ddenv.runfile.fold import fold
from ddenv.runfile.state import FIRST_FRESH_RUN
from ddenv.study.plan import Cell, Plan, make_plan
from ddenv.study.results import Found, read_cell
from ddenv.study.study_folder import run_path
from ddenv.world.load import load_scenario
from tests.conftest import DATA
from tests.workbench import fake_run

# As long as a scenario's name may be: 80 letters of four bytes each.
LONGEST = "\U00010400" * 80
TWO_PAIRS = "model2model/failure-proximal,model2model/sequential"
# Of eleven crates, and how it came to that: the baseline's four, one that shows f, and four for each vain candidate.
LEFT = ("crate_00", "crate_01")
TESTS = 4 + 1 + 2 * 4
# Of its certificate: two runs of the whole world, five of what is left, four without each model.
FRESH = 2 + 5 + 2 * 4


def crates(folder: Path, name: str = "crates", **reduction) -> Path:
    """The scenario of `fake_run`'s world as files of `folder`; returns its YAML file."""
    (folder / "crates.sdf").write_bytes(fake_run.world_text())
    (folder / "robot.sdf").write_bytes(fake_run.ROBOT_SDF)
    data = fake_run.scenario(name=name)
    data["reduction"] |= reduction
    number = len(list(folder.glob("*.yaml")))
    path = folder / f"scenario-{number}.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def wall(folder: Path, name: str = "wall", oracle: str = "", **reduction) -> Path:
    """The scenario of the small world under another `name`; returns its YAML file."""
    scenario = load_scenario(DATA / "wall.yaml")
    data = json.loads(scenario.model_dump_json(exclude_unset=True))
    data |= {"name": name, "folder": str(folder), **({"oracle": {"command": oracle}} if oracle else {})}
    data["reduction"] |= reduction
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def plan_of(*files: Path, pairs: str = TWO_PAIRS, algorithms: str = "ddenv", seeds: int = 1, **options) -> Plan:
    return make_plan([str(file) for file in files], pairs, algorithms, seeds, **options)


def begun(folder: Path, cell: Cell, world: bytes | None = None) -> fake_run.FakeRun:
    """The run of a cell, with nothing done yet."""
    data = json.loads(cell.scenario.model_dump_json())
    return fake_run.FakeRun(run_path(folder, cell), data, world or cell.scenario.world.read_bytes())


# Outcomes of fresh runs by letters, and the claims of a certificate that holds: of what is left, and without each model.
OUTCOMES = {"s": "similar", "p": "pass", "o": "other", "e": "error"}
Claims = dict[str | None, tuple[str, str]]


def holds(left: Sequence[str]) -> Claims:
    return {None: ("kept", "sssss"), **dict.fromkeys(left, ("needed", "pppp"))}


def certified(run: fake_run.FakeRun, claims: Claims, number: int = 1) -> None:
    """A certificate, with a verdict and the outcomes of the runs for each claim; two runs of the whole world show f as well."""
    state = fold(run.file.events())
    first = FIRST_FRESH_RUN * number
    terms = {"rate": 0.7, "keep_rate": 0.8, "error": 0.03, "at_least": 4}
    run.write("certificate_started", certificate=number, run=first, **terms)
    made = [_fresh(run, 0, None, first + place, "s") for place in range(2)]
    named = []
    for without, (verdict, letters) in claims.items():
        made += [_fresh(run, state.node, without, first + place, letter) for place, letter in enumerate(letters)]
        shown, runs = letters.count("s"), len(letters.replace("e", ""))
        low, high = wilson_interval(shown, runs)
        outcomes = Counter(OUTCOMES[letter] for letter in letters)
        left_out = None if without is None else run.elements.index(without)
        claim = {"without": left_out, "verdict": verdict, "shown": shown, "runs": runs, "low": low, "high": high}
        named.append(claim | {"outcomes": outcomes})
    # One ran ahead of time, and nothing rests on it.
    _fresh(run, state.node, None, first + 900, "p")
    run.write("certificate_finished", claims=named, tests=made)


def _fresh(run: fake_run.FakeRun, node: int, without: str | None, number: int, letter: str) -> int:
    run.tests += 1
    place = {"phase": "certify", "round": None, "candidate": None, "node": node}
    if without is not None:
        place["without"] = run.elements.index(without)
    run.write("test_started", test=run.tests, **place, run=number, seed=number)
    run.finish(run.tests, OUTCOMES[letter])
    return run.tests


def ended(run: fake_run.FakeRun) -> None:
    """The run ends with what its certificate shows."""
    certificate = fold(run.file.events()).certificate
    run.write("finished", minimal=is_minimal(certificate), reason=verdict_on(certificate))


def reduced(
    folder: Path,
    cell: Cell,
    left: Sequence[str] = LEFT,
    vain: int = 2,
    world: bytes | None = None,
    claims: Claims | None = None,
) -> Found:
    """A cell that came to `left`, with so many `vain` candidates of four tests each at the end, as it is read. Its certificate
    holds, or has these `claims`.
    """
    run = begun(folder, cell, world)
    run.created().baseline()
    run.start_round(2)
    run.reduce(0, list(left), run.similar(0))
    # Parts of it are of no matter here: each candidate is judged as many times as it takes.
    run.start_round(2, run.elements)
    for _ in range(vain):
        run.dissimilar(0)
    run.write("round_finished")
    certified(run, claims or holds(left))
    ended(run)
    run.close()
    return read_cell(folder, cell)


def never_failed(folder: Path, cell: Cell, reason: str = "there is no failure to reduce") -> Found:
    """A cell whose robot reached its goal."""
    run = begun(folder, cell)
    run.created().test(None, "pass")
    run.write("finished", minimal=False, reason=reason)
    run.close()
    return read_cell(folder, cell)
