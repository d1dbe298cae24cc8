"""Buildings of meshes: doors are open, walls are where they are, however a building is cut into
pieces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from manifold3d import Manifold

from ddenv.world.extent import bounds
from ddenv.world.files.boxes import box_of
from ddenv.world.files.pieces import convex_pieces
from ddenv.world.model import Box, Collision, Mesh, Model
from ddenv.world.pose import HERE, Pose, vector
from tests.robot.drake.conftest import EDGE, piece, static
from tests.tiers import examples

SIZE = 8.0  # of the house along x and y, m; it stands around the origin
WALL = 0.15
HIGH = 2.5
FLOOR = static("floor", piece("floor", Box((20.0, 20.0, 0.1)), Pose((EDGE + 10.0, 0.0, -0.05))))
STARTS = 12
AHEAD = 2.0  # where a wall with a door stands, m ahead of the robot


def walls(door: float) -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """The lowest and the highest corners of the walls of a house by hand, m: four around it, and
    one inside with a door.
    """
    half = SIZE / 2
    side = half - door / 2
    return [
        ((-half, -half, 0.0), (half, WALL - half, HIGH)),
        ((-half, half - WALL, 0.0), (half, half, HIGH)),
        ((-half, -half, 0.0), (WALL - half, half, HIGH)),
        ((half - WALL, -half, 0.0), (half, half, HIGH)),
        ((AHEAD, -half, 0.0), (AHEAD + WALL, side - half, HIGH)),
        ((AHEAD, half - side, 0.0), (AHEAD + WALL, half, HIGH)),
        ((AHEAD, -door, 2.0), (AHEAD + WALL, door, HIGH)),
    ]


def by_hand(door: float) -> list[Collision]:
    boxes: list[Collision] = []
    for low, high in walls(door):
        size = np.subtract(high, low)
        boxes.append(piece(str(len(boxes)), Box(vector(size)), Pose(vector(np.add(low, size / 2)))))
    return boxes


def cut(door: float, turn: float, order: int) -> list[Collision]:
    """The house as one mesh that was cut while it was turned by `turn` degrees, its triangles in
    some order.
    """
    whole = Manifold()
    for low, high in walls(door):
        whole = whole + Manifold.cube(tuple(np.subtract(high, low))).translate(low)
    mesh = whole.rotate((0.0, 0.0, turn)).to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(int)
    faces = faces[np.random.default_rng(order).permutation(len(faces))]
    back = Pose.from_rpy(0.0, 0.0, 0.0, 0.0, 0.0, -math.radians(turn))
    pieces = convex_pieces(np.asarray(mesh.vert_properties)[:, :3], faces, 512)
    solids = []
    for number, surface in enumerate(pieces):
        part = Mesh(f"house {door} {turn} {order} {number}", *surface)
        shape, pose = box_of(part) or (part, HERE)
        solids.append(piece("house", shape, back @ pose))
    return solids


def width(robot: Model) -> float:
    box = bounds(robot.collisions, Pose())
    assert box is not None
    return float((box[1] - box[0])[1])


@examples(0.3)
@given(more=st.one_of(st.floats(0.1, 0.6), st.floats(-0.3, -0.05)), turn=st.floats(-180.0, 180.0))
def test_a_robot_passes_the_doors_that_are_wider_than_itself(drive, husky, more, turn):
    ended = drive(FLOOR, static("house", *cut(width(husky) + more, turn, 0)))
    if more > 0:
        assert ended.outcome == "pass"
    else:
        assert (ended.outcome, ended.end_pose[0]) == ("failed", pytest.approx(AHEAD - 0.5, abs=0.2))


def starts() -> Iterator[Pose]:
    """Some straight ahead of the door, some of the wall."""
    random = np.random.default_rng(1)
    for _ in range(STARTS):
        yield Pose.from_rpy(
            0.0, random.uniform(-1.2, 1.2), 0.0, 0.0, 0.0, random.uniform(-0.3, 0.3)
        )


@pytest.mark.slow
def test_a_building_is_the_same_however_it_is_cut(drive, husky):
    door = width(husky) + 0.3
    houses = [by_hand(door), cut(door, 0.0, 0), cut(door, 33.0, 1)]
    passed = 0
    apart = []
    for start in starts():
        # The house stays where it is: the robot starts elsewhere, and drives on straight ahead.
        one, *others = (drive(FLOOR, static("house", *house), frame=start) for house in houses)
        passed += one.outcome == "pass"
        for other in others:
            assert (other.outcome, other.failure) == (one.outcome, one.failure)
            apart.append(float(np.linalg.norm(np.subtract(other.end_pose[:3], one.end_pose[:3]))))
    # A robot that slides along a wall with spinning wheels may end some cm away if a wall moves by
    # 0.1 micrometres.
    assert sorted(apart)[-5] < 1e-3 and max(apart) < 0.05
    assert 0 < passed < STARTS
