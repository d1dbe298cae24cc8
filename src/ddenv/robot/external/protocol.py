"""The interface of a simulator in Python: what it gets at the start and for each test, and what it
returns.

Each worker imports its class once and makes one object, which runs one test after the other:

    class Arm:
        def __init__(self, setup: SimulatorSetup) -> None: ...
        def run(self, world: SubWorld, seed: int, timeout: float) -> Iterator[Row] | Ended: ...

`run` returns `Ended`, or yields rows while it goes on and returns `Ended` in the end. A row is
(time, pose), or (time, pose, poses): the time in simulated s, the pose of the robot, and by name
those of models that move, or of the links of a model with joints, such as `arm::forearm`. A pose is
x, y, z (m), qx, qy, qz, qw in the world frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ddenv.text import Names

Row = tuple[float, Sequence[float]] | tuple[float, Sequence[float], Mapping[str, Sequence[float]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorSetup:
    """What a simulator knows before its first test.

    `scenario` is the scenario as plain data: m, rad, s. `world` is the file of the whole world and
    `robot` that of the robot; `folder` is where the simulator's module is searched first,
    `model_path` where the files that the world names are found. In a run that somebody sent, the
    files of the world and the robot need not be there.
    """

    scenario: Mapping[str, Any]
    world: Path
    robot: Path
    folder: Path
    model_path: tuple[Path, ...]


@dataclass(frozen=True, slots=True)
class SubWorld:
    """The world of one test.

    `path` is its SDF file: the world's own text without the removed models. The next test finds
    another world in the same file. `scenario` is a scenario file in this world. `models` are the
    names of the models that are there, in the world's order.
    """

    path: Path
    scenario: Path
    models: Names


@dataclass(frozen=True, slots=True)
class Ended:
    """How a test ended: whether the robot `reached` its goal before its time was up.

    `poses` are the rows, unless they were yielded. `took_part` names the models that can have
    changed a bit of the test, including those that these rest on; None if that is not known. With
    it, all other models are removed untested, and the same seed must give the same bits.
    """

    reached: bool
    poses: Iterable[Row] = ()
    took_part: Iterable[str] | None = None
