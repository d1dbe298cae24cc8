"""Records the runs that the lessons show, and what is known of every part of two toy worlds.

    python -m docs.lessons.record             all of them: an hour, of it half an hour for `ditch`
    python -m docs.lessons.record quay-kept   one of them, by the name of its file

Of the trajectories only those are kept that a map shows, so that all lessons fit in the package.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import yaml
from docs.lessons.delivery import outcome
from docs.lessons.quay import rate
from docs.lessons.record_plays import record_plays
from docs.lessons.toys import DELIVERY, QUAY, SIMULATOR, TOYS, Box, Toy

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile

HERE = Path(__file__).resolve().parent
LESSONS = HERE.parents[1] / "src/ddenv/learn/lessons"


@dataclass(frozen=True)
class Recorded:
    """A run in a toy `world` or a bundled scenario. `reduction` has settings over those of the
    toy's scenario.

    `shown`: a lesson shows it on the map; of the others only figures are shown. With a
    `certify_rate` its last certificate goes on.
    """

    world: str
    options: tuple[str, ...] = ()
    reduction: Mapping[str, Any] = field(default_factory=dict)
    shown: bool = True
    certify_rate: float | None = None


_FROM_END = {"pair": "model2model/failure-proximal"}
_PRINTED = {"growth": "paper", "skip": "known"}
_FAR_FIRST = {"complement_order": "far-first"}
RUNS = {
    "delivery": Recorded("delivery"),
    "ditch": Recorded("ditch", ("--as-printed",)),
    "yard-near": Recorded("yard", reduction=_FROM_END | _PRINTED),
    "yard-far": Recorded("yard", reduction=_FROM_END | _PRINTED | _FAR_FIRST, shown=False),
    "yard-random": Recorded(
        "yard", reduction=_PRINTED | {"pair": "model2model/random"}, shown=False
    ),
    "yard-file": Recorded(
        "yard", reduction=_PRINTED | {"pair": "model2model/sequential"}, shown=False
    ),
    "nailed-near": Recorded("nailed", reduction=_FROM_END | _PRINTED, shown=False),
    "quay-first": Recorded("quay", ("--as-printed", "--seed", "4")),
    "quay-kept": Recorded("quay", certify_rate=0.8),
    "ditch-sliced": Recorded("ditch"),
    "ditch-whole": Recorded("ditch", ("--no-slice",), shown=False),
    "yard-splitting": Recorded("yard", ("--algorithm", "splitting")),
    "yard-ddmin": Recorded("yard", ("--algorithm", "ddmin"), shown=False),
    "yard-ddenv": Recorded("yard", shown=False),
}


def main(wanted: list[str]) -> None:
    if unknown := set(wanted) - RUNS.keys():
        sys.exit(f"{min(unknown)}: expected {', '.join(RUNS)}")
    for name in wanted or RUNS:
        record(name)


def record(name: str) -> None:
    """Makes a run, and puts it beside the lessons."""
    recorded = RUNS[name]
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / f"{name}.ddenv"
        toy = TOYS.get(recorded.world)
        what = (
            recorded.world if toy is None else str(written(toy, Path(folder), recorded.reduction))
        )
        command = (
            sys.executable,
            "-m",
            "ddenv",
            "run",
            what,
            "--jobs",
            "1",
            "--output",
            str(run),
            *recorded.options,
        )
        more = (
            sys.executable,
            "-m",
            "ddenv",
            "certify",
            str(run),
            "--certify-rate",
            str(recorded.certify_rate),
            "--jobs",
            "1",
        )
        for each in (command, more) if recorded.certify_rate else (command,):
            if subprocess.run(each, check=False).returncode == 2:
                sys.exit(2)
        slim(run, recorded.shown, told(f"{name}.ddenv"))
        shutil.copy(run, LESSONS / run.name)
    if name in ORACLES:
        (LESSONS / f"{recorded.world}.oracle.json").write_text(ORACLES[name](), encoding="utf-8")
    if name == "delivery":
        record_plays(LESSONS / "1-what-delta-debugging-is.yaml")


def written(toy: Toy, folder: Path, reduction: Mapping[str, Any]) -> Path:
    """Writes a toy world, its robot, its simulator and its scenario with these settings; returns
    the scenario's file.
    """
    for file in ("robot.sdf", SIMULATOR, f"{toy.rule}.py"):
        shutil.copy(HERE / file, folder / file)
    (folder / SIMULATOR).chmod(0o755)
    (folder / "world.sdf").write_text(world_of(toy), encoding="utf-8")
    walls = [name for name, *_ in toy.walls]
    scenario = folder / "scenario.yaml"
    settings = {"reduction": {**toy.scenario.get("reduction", {}), **reduction}, "protected": walls}
    scenario.write_text(json.dumps(toy.scenario | settings), encoding="utf-8")
    return scenario


def world_of(toy: Toy) -> str:
    """A toy world as SDF."""
    boxes: dict[str, list[Box]] = {}
    for box in (*toy.walls, *toy.models):
        boxes.setdefault(box[0], []).append(box)
    models = "\n".join(
        (
            f'<model name="{name}"><static>true</static><link '
            f'name="link">{"".join(map(_collision, range(9), each))}</link></model>'
        )
        for name, each in boxes.items()
    )
    ground = (
        '<model name="ground_plane"><static>true</static><link name="link"><collision '
        'name="plane"><geometry><plane>'
        "<normal>0 0 1</normal></plane></geometry></collision></link></model>"
    )
    return f'<sdf version="1.9"><world name="toy">\n{ground}\n{models}\n</world></sdf>\n'


def _collision(number: int, box: Box) -> str:
    _, x, y, length, width = box
    return (
        f'<collision name="box_{number}"><pose>{x} {y} 0.5 0 0 0</pose>'
        f"<geometry><box><size>{length} {width} 1</size></box></geometry></collision>"
    )


def delivery_oracle() -> str:
    """The outcome of every part of the first lesson's world."""
    outcomes = {
        " ".join(kept): outcome(kept)
        for kept in _subsets(DELIVERY.names)
        if outcome(kept) != "pass"
    }
    return (
        json.dumps({"models": DELIVERY.names, "otherwise": "pass", "outcomes": outcomes}, indent=0)
        + "\n"
    )


def quay_oracle() -> str:
    """The rate of f in every part of the quay's world."""
    rates = {" ".join(kept): round(rate(kept), 3) for kept in _subsets(QUAY.names) if rate(kept)}
    return (
        json.dumps(
            {"models": QUAY.names, "otherwise": "pass", "outcomes": {}, "rates": rates}, indent=0
        )
        + "\n"
    )


# What is known of the whole world of a run.
ORACLES = {"delivery": delivery_oracle, "quay-kept": quay_oracle}


def _subsets(names: tuple[str, ...]) -> list[tuple[str, ...]]:
    return [kept for size in range(len(names) + 1) for kept in combinations(names, size)]


def told(run: str) -> set[int]:
    """The tests of a run whose ends a lesson tells."""
    lessons = [yaml.safe_load(file.read_text(encoding="utf-8")) for file in LESSONS.glob("*.yaml")]
    places = [
        str(step.get("at", ""))
        for lesson in lessons
        if lesson["run"] == run
        for step in lesson["steps"]
    ]
    return {
        int(number)
        for word, _, number in (place.partition(" ") for place in places)
        if word in ("test", "result")
    }


def slim(run: Path, shown: bool, told: set[int]) -> None:
    """Removes the trajectories that no map shows; of a run that is not `shown` all of them.

    Those of `told` tests stay, with the other tests of the same candidates: their verdicts are
    told, too.
    """
    with RunFile(run) as file:
        state = fold(file.events())
        events = file.events()
    if state.status != "finished":
        sys.exit(f"{run.name}: did not come to its end")
    kept = {test for one in events if (test := getattr(one.event, "evidence_test", None))}
    kept |= set(state.failures) | ({state.baseline.failure_test} if state.baseline else set())
    made_for = {
        (test.round, test.candidate)
        for test in state.tests
        if test.id in told and test.phase == "round"
    }
    kept |= told | {test.id for test in state.tests if (test.round, test.candidate) in made_for}
    database = sqlite3.connect(run)
    tests = ",".join(map(str, sorted(kept))) if shown else ""
    database.execute(f"DELETE FROM motion WHERE model != '' OR test NOT IN ({tests})")
    database.commit()
    # Within a transaction this would change nothing, and readers would write files beside the
    # lesson.
    database.execute("PRAGMA journal_mode = DELETE")
    database.execute("VACUUM")
    database.close()


if __name__ == "__main__":
    main(sys.argv[1:])
