"""Studies whose run files are written by hand: what they came to is known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import yaml

from ddenv.evidence.claims import is_minimal
from ddenv.runfile.fold import fold
from ddenv.study.plan import Cell, Plan, make_plan, run_path
from ddenv.study.results import Result, read_cell
from ddenv.words.claims import verdict_on
from ddenv.world.load import load_scenario
from tests.conftest import DATA
from tests.workbench import fake_run

# As long as a scenario's name may be: 80 letters of four bytes each.
LONGEST = "\U00010400" * 80
TWO_PAIRS = "model2model/failure-proximal,model2model/sequential"
# Of eleven crates, and how it came to that: the baseline's four, one that shows f, and four for
# each vain candidate.
LEFT = ("crate_00", "crate_01")
TESTS = 4 + 1 + 2 * 4
# Of its certificate: two runs of the whole world, five of what is left, four without each model.
FRESH = 2 + 5 + 2 * 4


def crates(folder: Path, name: str = "crates", **reduction) -> Path:
    """The scenario of `fake_run`'s world as files of `folder`; returns its YAML file."""
    (folder / "crates.sdf").write_bytes(fake_run.world_text())
    (folder / "robot.sdf").write_bytes(fake_run.ROBOT_SDF)
    data = fake_run.scenario(name=name)
    data["reduction"] |= {"slice": False} | reduction
    number = len(list(folder.glob("*.yaml")))
    path = folder / f"scenario-{number}.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def wall(folder: Path, name: str = "wall", oracle: str = "", **reduction) -> Path:
    """The scenario of the small world under another `name`; returns its YAML file."""
    scenario = load_scenario(DATA / "wall.yaml")
    data = json.loads(scenario.model_dump_json(exclude_unset=True))
    data |= {
        "name": name,
        "folder": str(folder),
        **({"oracle": {"command": oracle}} if oracle else {}),
    }
    data["reduction"] |= {"slice": False} | reduction
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def plan_of(
    *files: Path, pairs: str = TWO_PAIRS, algorithms: str = "ddenv", seeds: int = 1, **options
) -> Plan:
    return make_plan([str(file) for file in files], pairs, algorithms, seeds, **options)


def begun(folder: Path, cell: Cell, world: bytes | None = None) -> fake_run.FakeRun:
    """The run of a cell, with nothing done yet."""
    data = json.loads(cell.scenario.model_dump_json())
    return fake_run.FakeRun(run_path(folder, cell), data, world or cell.scenario.world.read_bytes())


# The claims of a certificate: of what is left, and without each model, with its verdict and its
# runs in letters.
Claims = dict[str | None, tuple[str, str]]


def holds(left: Sequence[str]) -> Claims:
    return {None: ("kept", "sssss"), **dict.fromkeys(left, ("needed", "pppp"))}


def certified(run: fake_run.FakeRun, claims: Claims) -> None:
    """A certificate with these claims; two runs of the whole world show f as well."""
    node = fold(run.file.events()).node
    run.start_certificate()
    run.certify_all(0, None, "ss")
    for without, (_, letters) in claims.items():
        run.certify_all(node, without, letters)
    run.finish_certificate(*((without, *rest) for without, rest in claims.items()))
    # One ran ahead of time, and nothing rests on it.
    run.finish(run.certify(node, None, 900), "pass")


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
) -> Result:
    """A cell that came to `left`, with so many `vain` candidates of four tests each at the end, as
    it is read. Its certificate holds, or has these `claims`.
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


def never_failed(folder: Path, cell: Cell, reason: str = "there is no failure to reduce") -> Result:
    """A cell whose robot reached its goal."""
    run = begun(folder, cell)
    run.created().test(None, "pass")
    run.write("finished", minimal=False, reason=reason)
    run.close()
    return read_cell(folder, cell)
