"""Records the runs that the lessons show, and the outcome of every part of the first lesson's world.

    python -m docs.lessons.record delivery          the toy world: two minutes
    python -m docs.lessons.record ditch             with Drake: half an hour

Of the trajectories only those are kept that a map shows, so that all lessons fit in the package.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from itertools import combinations
from pathlib import Path

from docs.lessons.delivery import outcome

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile

HERE = Path(__file__).resolve().parent
LESSONS = HERE.parents[1] / "src/ddenv/learn/lessons"
# Name, x, y, size along x and y, m. Walls and island always stay.
WALLS = (("wall_left", 0, 2.6, 14, 0.3), ("wall_right", 0, -2.6, 14, 0.3), ("island", 1, 0, 4.6, 0.5))
MODELS = (
    ("bench", -5.2, 1.6, 1.2, 0.6),
    ("sign", -2.9, 1.9, 0.4, 0.4),
    ("plant", -3.9, -1.9, 0.7, 0.7),
    ("crate", 0.75, 1.4, 0.5, 1.8),
    ("barrel", 1.5, 1.85, 0.9, 0.9),
    ("cone", 1.5, 0.85, 0.7, 0.7),
    ("pallet", 1.9, -1.4, 1.2, 1.8),
    ("bin", 5.2, -1.7, 0.8, 0.8),
)
SCENARIO = {
    "name": "delivery",
    "description": "A delivery robot drives from one end of a yard to the other. It gets stuck in the left lane.",
    "world": "world.sdf",
    "robot": {"model": "robot.sdf", "spawn": {"x": -6.0, "y": 0.0, "z": 0.2}},
    "goal": {"x": 6.0, "y": 0.0, "tolerance": 0.3},
    "oracle": {"command": "./delivery.py {world}"},
    "failure": {"timeout": 40, "epsilon": 0.5},
    "reduction": {"as_printed": True, "baseline_runs": 3, "iterations": 1},
    "protected": [name for name, *_ in WALLS],
}


def main(name: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / f"{name}.ddenv"
        what = str(delivery(Path(folder))) if name == "delivery" else name
        options = () if name == "delivery" else ("--as-printed",)
        command = (sys.executable, "-m", "ddenv", "run", what, "--jobs", "1", "--output", str(run), *options)
        if subprocess.run(command, check=False).returncode == 2:
            sys.exit(2)
        slim(run)
        LESSONS.mkdir(exist_ok=True)
        shutil.copy(run, LESSONS / run.name)


def delivery(folder: Path) -> Path:
    """Writes the toy world, its robot and its simulator; returns the scenario's file. Writes also the complete oracle."""
    for file in ("robot.sdf", "delivery.py"):
        shutil.copy(HERE / file, folder / file)
    (folder / "delivery.py").chmod(0o755)
    (folder / "world.sdf").write_text(world(), encoding="utf-8")
    scenario = folder / "delivery.yaml"
    scenario.write_text(json.dumps(SCENARIO), encoding="utf-8")
    names = [name for name, *_ in MODELS]
    subsets = [kept for size in range(len(names) + 1) for kept in combinations(names, size)]
    outcomes = {" ".join(kept): outcome(kept) for kept in subsets if outcome(kept) != "pass"}
    oracle = {"models": names, "otherwise": "pass", "outcomes": outcomes}
    (LESSONS / "delivery.oracle.json").write_text(json.dumps(oracle, indent=0) + "\n", encoding="utf-8")
    return scenario


def world() -> str:
    """The yard as SDF."""
    boxes = "\n".join(
        f'<model name="{name}"><static>true</static><pose>{x} {y} 0.5 0 0 0</pose><link name="link"><collision name="box">'
        f"<geometry><box><size>{length} {width} 1</size></box></geometry></collision></link></model>"
        for name, x, y, length, width in (*WALLS, *MODELS)
    )
    ground = (
        '<model name="ground_plane"><static>true</static><link name="link"><collision name="plane"><geometry><plane>'
        "<normal>0 0 1</normal></plane></geometry></collision></link></model>"
    )
    return f'<sdf version="1.9"><world name="yard">\n{ground}\n{boxes}\n</world></sdf>\n'


def slim(run: Path) -> None:
    """Removes the trajectories that no map shows."""
    with RunFile(run) as file:
        state = fold(file.events())
        events = file.events()
    shown = {event.data["evidence_test"] for event in events if event.data.get("evidence_test")}
    shown |= set(state.failures) | ({state.baseline.failure_test} if state.baseline else set())
    database = sqlite3.connect(run)
    database.execute(f"DELETE FROM motion WHERE model != '' OR test NOT IN ({','.join(map(str, sorted(shown)))})")
    database.execute("PRAGMA journal_mode = DELETE")
    database.commit()
    database.execute("VACUUM")
    database.close()


if __name__ == "__main__":
    main(sys.argv[1])
