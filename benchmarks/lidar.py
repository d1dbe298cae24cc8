"""How long one scan of the lidar takes, on a drive across worlds of simple shapes, without a simulator.

    python benchmarks/lidar.py

A scan that is not read is only computed where it may show a model for the first time. Times are CPU times.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np

from ddenv.robot.sensing.beams import Obstacles
from ddenv.robot.sensing.lidar import Lidar
from ddenv.world import scenario
from ddenv.world.model import Box, Collision, Cylinder, Link, Model, Plane, Shape, World
from ddenv.world.pose import Pose

SCANS = 300
REPEATS = 5
# The height of the robot's first link on flat ground, and how far it pitches and rolls, m and rad.
HEIGHT = 0.13
TILT = 0.03
# How far it drives, m.
WAY = 8.0


def model(name: str, shape: Shape, pose: Pose, static: bool = True) -> Model:
    """One shape."""
    link = Link("link", pose, None, (Collision("collision", shape, pose, 1.0),), ())
    return Model(name, pose, static, (link,), (), (), 1)


def ground() -> Model:
    return model("ground", Plane((100.0, 100.0)), Pose())


def around(random: np.random.Generator, nearest: float, farthest: float) -> tuple[float, float]:
    """A place at this distance from the middle of the path."""
    distance, angle = random.uniform(nearest, farthest), random.uniform(-math.pi, math.pi)
    return WAY / 2 + distance * math.cos(angle), distance * math.sin(angle)


def barrels(random: np.random.Generator) -> tuple[Model, ...]:
    """Ten barrels, and fourteen patches on the ground that are no obstacles."""
    upright = [Pose((*around(random, 2.0, 9.0), 0.5)) for _ in range(10)]
    flat = [Pose((*around(random, 0.0, 9.0), 0.01)) for _ in range(14)]
    return (
        ground(),
        *(model(f"barrel {number}", Cylinder(0.3, 1.0), pose) for number, pose in enumerate(upright)),
        *(model(f"patch {number}", Box((3.0, 3.0, 0.02)), pose) for number, pose in enumerate(flat)),
    )


def boards(random: np.random.Generator) -> tuple[Model, ...]:
    """32 boards in all directions that can move, and three walls."""
    places = [(*around(random, 1.0, 6.0), random.uniform(0.2, 0.8)) for _ in range(32)]
    turns = random.uniform(-math.pi, math.pi, (32, 3))
    poses = [Pose.from_rpy(*place, *turn) for place, turn in zip(places, turns, strict=True)]
    walls = [Pose((WAY / 2, y, 1.0)) for y in (-7.0, 7.0, 9.0)]
    return (
        ground(),
        *(model(f"board {number}", Box((1.2, 0.14, 0.03)), pose, static=False) for number, pose in enumerate(poses)),
        *(model(f"wall {number}", Box((20.0, 0.2, 2.0)), pose) for number, pose in enumerate(walls)),
    )


def boxes(random: np.random.Generator, count: int = 200) -> tuple[Model, ...]:
    """Boxes on the ground all around."""
    poses = [Pose.from_rpy(*around(random, 1.5, 12.0), 0.4, 0, 0, random.uniform(0, math.pi)) for _ in range(count)]
    sizes = random.uniform(0.4, 1.0, (count, 2))
    return (
        ground(),
        *(
            model(f"box {number}", Box((*size, 0.8)), pose)
            for number, (size, pose) in enumerate(zip(sizes, poses, strict=True))
        ),
    )


def rubble(random: np.random.Generator) -> tuple[Model, ...]:
    """5,000 low boxes on the ground, below the beams."""
    poses = [Pose((*around(random, 0.0, 20.0), 0.05)) for _ in range(5000)]
    return ground(), *(model(f"stone {number}", Box((0.4, 0.4, 0.1)), pose) for number, pose in enumerate(poses))


def measure(models: tuple[Model, ...]) -> tuple[float, float, float]:
    """ms for a scan that is read, ms for one that is not, and the share of beams that hit something."""
    world = World(Path("world.sdf"), "world", b"", (0.0, 0.0, -9.81), models)
    moving = [one for one in models if not one.static]
    places = np.array([one.pose.position for one in moving]).reshape(-1, 3)
    turns = np.array([one.pose.rotation() for one in moving]).reshape(-1, 3, 3)
    names, obstacles = frozenset(one.name for one in models), Obstacles.of(world)
    poses = []
    for part in np.linspace(0.0, 1.0, SCANS).tolist():
        roll, pitch = TILT * math.sin(40 * part), TILT * math.sin(70 * part)
        pose = Pose.from_rpy(WAY * part, 0.0, HEIGHT, roll, pitch, 0.3 * math.sin(9 * part))
        poses.append((*pose.position, *pose.quaternion))

    def drive(looked_at: bool) -> tuple[float, int]:
        """ms for a scan, and how many beams hit something."""
        lidar = Lidar(scenario.Lidar(), obstacles, names, moving, np.random.default_rng(0))
        start, met = time.process_time(), 0
        for number, pose in enumerate(poses):
            # Links that move are elsewhere each time.
            scan = lidar.scan(0.1 * number, pose, places + 1e-6 * number, turns)
            met += int(np.isfinite(scan.ranges).sum()) if looked_at else 0
        seen = len(lidar.first_seen)
        assert 0 < seen <= len(models)
        return 1000 * (time.process_time() - start) / SCANS, met

    looked, ignored = ([drive(at) for _ in range(REPEATS)] for at in (True, False))
    beams = SCANS * scenario.Lidar().beams
    return min(looked)[0], min(ignored)[0], looked[0][1] / beams


def main() -> None:
    print("| world | models | a scan, ms | not looked at, ms | beams that end on something, % |\n|---|---|---|---|---|")
    worlds = {"barrels and flat patches": barrels, "boards that move": boards, "boxes": boxes, "low stones": rubble}
    for name, make in worlds.items():
        models = make(np.random.default_rng(1))
        looked, ignored, met = measure(models)
        print(f"| {name} | {len(models)} | {looked:.3f} | {ignored:.3f} | {100 * met:.0f} |", flush=True)


if __name__ == "__main__":
    main()
