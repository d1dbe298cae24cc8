"""How much processor time navigation takes, in a toy world without physics: maps, plans and commands, not the robot.

python benchmarks/navigation.py
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.robot.navigation.toy import PERIOD, Ground, drive, setup

from ddenv.robot.navigation.navigate import Navigator
from ddenv.robot.navigation.route import Path as Way
from ddenv.robot.navigation.route import Planner
from ddenv.robot.protocol import Reading, Setup, Twist

REPEATS = 3
BARRELS = tuple((2.0 + 1.7 * number, (-1) ** number * 0.4 * (number % 3), 0.3) for number in range(10))
GAP = ((4.0, -8.0, 4.0, -0.55), (4.0, 0.55, 4.0, 8.0))
ROOM = ((-2.0, -4.0, 22.0, -4.0), (22.0, -4.0, 22.0, 4.0), (22.0, 4.0, -2.0, 4.0), (-2.0, 4.0, -2.0, -4.0))
WORLDS = {
    "nothing": (Ground(), (20.0, 0.0)),
    "10 barrels": (Ground(BARRELS), (20.0, 0.0)),
    "a gap 1.1 m wide": (Ground(walls=GAP), (8.0, 0.0)),
    "10 barrels in a room": (Ground(BARRELS, ROOM), (20.0, 0.0)),
}


@dataclass
class Timed:
    """A navigator whose steps are timed, in s of this process."""

    given: Setup
    took: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        started = time.process_time()
        self.inner = Navigator(self.given)
        self.made_in = time.process_time() - started

    @property
    def arrived(self) -> bool:
        return self.inner.arrived

    @property
    def gave_up(self) -> bool:
        return self.inner.gave_up

    def step(self, reading: Reading) -> Twist:
        started = time.process_time()
        twist = self.inner.step(reading)
        self.took.append(time.process_time() - started)
        return twist


def main() -> None:
    print("| world | arrived after, s | us a step | worst step, ms | to begin with, ms | ms a simulated s | plans |")
    print("|---|---|---|---|---|---|---|")
    for name, (ground, goal) in WORLDS.items():
        print(row(name, ground, goal), flush=True)


def row(name: str, ground: Ground, goal: tuple[float, float]) -> str:
    """The best of some repeats: other work of the machine only adds time."""
    best, plans, ended = None, 0, 0.0
    for _ in range(REPEATS):
        timed = Timed(setup(goal))
        with Counted() as counted:
            drove = drive(timed.given, ground, navigator=timed)
        plans, ended = counted.plans, drove.times[-1]
        best = timed if best is None or sum(timed.took) < sum(best.took) else best
    step = sum(best.took) / len(best.took)
    end = f"{ended:.1f}" if best.arrived else "-"
    return (
        f"| {name} | {end} | {step * 1e6:.0f} | {max(best.took) * 1e3:.1f} | {best.made_in * 1e3:.1f} "
        f"| {step / PERIOD * 1e3:.2f} | {plans} |"
    )


class Counted:
    """Counts the plans that are made."""

    def __enter__(self) -> Counted:
        self.plans, self._plan = 0, Planner.plan

        def plan(planner: Planner, *where) -> Way | None:
            self.plans += 1
            return self._plan(planner, *where)

        Planner.plan = plan
        return self

    def __exit__(self, *_) -> None:
        Planner.plan = self._plan


if __name__ == "__main__":
    main()
