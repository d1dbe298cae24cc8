"""How far Drake's contact normals are from the exact ones: every pair of its convex shapes.

    python benchmarks/contact_normals.py [--poses N] [--quantile Q]

A piece of some length, 0.1 m thick, and a thing as large as a wheel touch by 1 mm: a flat or smooth
side on a side (face), an edge of either on a side or across an edge (edge), a corner of either on a
side (corner). Each shape of a pair is once the piece, once the thing; poses are random. The exact
normal is the direction in which the way out is shortest. Takes five minutes.

Prints for each pair the largest angle between Drake's normal and the exact one, in degrees, by the
length of the piece, and the largest error of the depth, in %; medians with `--quantile 0.5`. Exact
allows 5 % of depth: FCL's box-box prefers a face to crossing edges that are up to 5 % less deep.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import combinations_with_replacement

import numpy as np
from pydrake import geometry
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

DEPTH = 0.001
LENGTHS = (0.5, 2, 4, 20)
SITUATIONS = {
    "face": [("side", "side")],
    "edge": [("edge", "side"), ("side", "edge"), ("edge", "edge")],
    "corner": [("corner", "side"), ("side", "corner")],
}
FINE = {"xatol": 1e-7, "fatol": 1e-12}
facing = partial(RotationMatrix.MakeFromOneVector, axis_index=2)
# A point of a shape and its normal there; the normal of a contact and its depth, m.
Touch = tuple[np.ndarray, np.ndarray]
Contact = tuple[np.ndarray, float]


@dataclass
class Body:
    """A convex shape, how far it reaches in directions (N, 3), and its features: random touches."""

    shape: geometry.Shape
    reach: Callable[[np.ndarray], np.ndarray]
    features: dict[str, Callable[[np.random.Generator], Touch]]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--poses", type=int, default=30, help="of each kind of contact and length")
    parser.add_argument("--quantile", type=float, default=1.0, help="1 is the largest error")
    options = parser.parse_args()
    heads = [f"{situation}: {', '.join(map(str, LENGTHS))} m" for situation in SITUATIONS]
    print(f"| pair | normals | {' | '.join(heads)} | depth, % |\n{'|---' * 6}|", flush=True)
    for pair in combinations_with_replacement(bodies(length=1.0, thickness=1.0), 2):
        print(row(pair, options.poses, options.quantile), flush=True)


def row(pair: tuple[str, str], poses: int, quantile: float) -> str:
    found, cells = [], [" and ".join(pair)]
    for ways in SITUATIONS.values():
        by_length = [errors(pair, length, ways, poses) for length in LENGTHS]
        angles = [f"{np.quantile(some, quantile, axis=0)[0]:.1f}" for some in by_length if some]
        found += [one for some in by_length for one in some]
        cells.append(", ".join(angles) or "-")
    cells.append(f"{np.quantile(found, quantile, axis=0)[1]:.1f}")
    cells.insert(1, "exact" if np.max(found, axis=0)[1] <= 5 else "general")
    return f"| {' | '.join(cells)} |"


def errors(pair: tuple[str, str], length: float, ways: list, poses: int) -> list[list[float]]:
    """Of angle, degrees, and depth, %, where they touch in these ways."""
    chance, found = np.random.default_rng(0), []
    for one, other in sorted({pair, pair[::-1]}):
        piece = bodies(length=length, thickness=0.1)[one]
        thing = bodies(length=0.33, thickness=0.114)[other]
        ask = drake(piece.shape, thing.shape)
        for on_piece, on_thing in ways:
            possible = on_piece in piece.features and on_thing in thing.features
            for _ in range(poses if possible else 0):
                point, normal = piece.features[on_piece](chance)
                its_point, its_normal = thing.features[on_thing](chance)
                spin = RotationMatrix.MakeZRotation(chance.uniform(0, 2 * np.pi))
                turn = facing(normal) @ spin @ facing(-its_normal).inverse()
                pose = RigidTransform(turn, point - DEPTH * normal - turn @ its_point)
                said, said_depth = ask(pose)
                true, true_depth = exact(piece, thing, pose, guesses=[normal, said])
                angle = np.degrees(2 * np.arcsin(np.linalg.norm(said - true) / 2))
                found.append([angle, 100 * abs(said_depth / true_depth - 1)])
    return found


def drake(piece: geometry.Shape, thing: geometry.Shape) -> Callable[[RigidTransform], Contact]:
    """A function from the thing's pose to Drake's contact. The normal points out of the piece."""
    scene = geometry.SceneGraph()
    source = scene.RegisterSource("contact")
    frame = scene.RegisterFrame(source, geometry.GeometryFrame("thing"))
    fixed = geometry.GeometryInstance(RigidTransform(), piece, "piece")
    moving = geometry.GeometryInstance(RigidTransform(), thing, "thing")
    fixed.set_proximity_properties(geometry.ProximityProperties())
    moving.set_proximity_properties(geometry.ProximityProperties())
    piece_id = scene.RegisterAnchoredGeometry(source, fixed)
    scene.RegisterGeometry(source, frame, moving)
    context = scene.CreateDefaultContext()

    def ask(pose: RigidTransform) -> Contact:
        poses = geometry.FramePoseVector()
        poses.set_value(frame, pose)
        scene.get_source_pose_port(source).FixValue(context, Value(poses))
        (found,) = scene.get_query_output_port().Eval(context).ComputePointPairPenetration()
        return found.nhat_BA_W * (1 if found.id_B == piece_id else -1), found.depth

    return ask


def exact(piece: Body, thing: Body, pose: RigidTransform, guesses: list[np.ndarray]) -> Contact:
    """The direction in which the thing has the shortest way out of the piece, and that way, m."""
    turn, place = pose.rotation().matrix(), pose.translation()

    def way(directions: np.ndarray) -> np.ndarray:
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return piece.reach(unit) + thing.reach(-unit @ turn) - unit @ place

    def tilted(xy: np.ndarray, plane: np.ndarray) -> float:
        return float(way(np.array([plane @ [*xy, 1.0]]))[0])

    found = []
    for looks in (np.array(guesses), np.random.default_rng(0).normal(size=(2000, 3))):
        start = looks[np.argmin(way(looks))]
        plane = facing(start).matrix()
        least = minimize(tilted, x0=[0, 0], args=(plane,), method="Nelder-Mead", options=FINE)
        found.append((least.fun, plane @ [*least.x, 1.0]))
    depth, normal = min(found, key=lambda one: one[0])
    return normal / np.linalg.norm(normal), depth


def bodies(length: float, thickness: float) -> dict[str, Body]:
    """Slab, ball, disc, rod, flat ellipsoid; slab, and disc with 16 sides, by their corners."""
    half = np.array([length, min(length, 1.0), thickness]) / 2
    box = half * [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    rim = [length / 2 * np.exp(2j * np.pi * corner / 16) for corner in range(16)]
    disc = np.array([[at.real, at.imag, z] for at in rim for z in (-half[2], half[2])])
    return {
        "Box": polytope(box, geometry.Box(*(2 * half))),
        "Sphere": ellipsoid(np.full(3, length / 2), geometry.Sphere(length / 2)),
        "Cylinder": cylinder(length / 2, half[2]),
        "Capsule": capsule(half[2], max(length - thickness, 0.01) / 2),
        "Ellipsoid": ellipsoid(half, geometry.Ellipsoid(*half)),
        "Convex box": polytope(box, geometry.Convex(points=box.T, label="box")),
        "Convex prism": polytope(disc, geometry.Convex(points=disc.T, label="prism")),
    }


def polytope(vertices: np.ndarray, shape: geometry.Shape) -> Body:
    facets = np.unique(ConvexHull(vertices).equations.round(9), axis=0)
    on = np.abs(vertices @ facets[:, :3].T + facets[:, 3]) < 1e-6

    def draw(sides_that_meet: int, chance: np.random.Generator) -> Touch:
        """Three sides meet in each corner of these shapes, and two of them in an edge."""
        corner = chance.integers(len(vertices))
        sides = chance.permutation(np.flatnonzero(on[corner]))[:sides_that_meet]
        corners = vertices[on[:, sides].all(axis=1)]
        normal = chance.dirichlet(np.full(len(sides), 2.0)) @ facets[sides, :3]
        point = chance.dirichlet(np.full(len(corners), 2.0)) @ corners
        return point, normal / np.linalg.norm(normal)

    features = {"side": partial(draw, 1), "edge": partial(draw, 2), "corner": partial(draw, 3)}
    return Body(shape, lambda directions: (directions @ vertices.T).max(axis=1), features)


def ellipsoid(axes: np.ndarray, shape: geometry.Shape) -> Body:
    def side(chance: np.random.Generator) -> Touch:
        unit = along(chance, [1, 1, 1])
        return unit * axes, unit / axes / np.linalg.norm(unit / axes)

    return Body(shape, lambda directions: np.linalg.norm(directions * axes, axis=1), {"side": side})


def cylinder(radius: float, half: float) -> Body:
    def side(chance: np.random.Generator) -> Touch:
        out, up, part = along(chance, [1, 1, 0]), along(chance, [0, 0, 1]), 0.95 * chance.random()
        if chance.random() < 0.5:
            return radius * out + part * half * up, out
        return radius * np.sqrt(part) * out + half * up, up

    def edge(chance: np.random.Generator) -> Touch:
        out, up, tilt = along(chance, [1, 1, 0]), along(chance, [0, 0, 1]), chance.uniform(0.2, 1.4)
        return radius * out + half * up, np.cos(tilt) * out + np.sin(tilt) * up

    def reach(directions: np.ndarray) -> np.ndarray:
        return radius * np.linalg.norm(directions[:, :2], axis=1) + half * np.abs(directions[:, 2])

    return Body(geometry.Cylinder(radius, 2 * half), reach, {"side": side, "edge": edge})


def capsule(radius: float, half: float) -> Body:
    def side(chance: np.random.Generator) -> Touch:
        round_end = chance.random() < 0.5
        normal = along(chance, [1, 1, int(round_end)])
        height = half * (np.sign(normal[2]) if round_end else chance.uniform(-1, 1))
        return radius * normal + [0, 0, height], normal

    shape = geometry.Capsule(radius, 2 * half)
    return Body(shape, lambda directions: radius + half * np.abs(directions[:, 2]), {"side": side})


def along(chance: np.random.Generator, axes: list[int]) -> np.ndarray:
    """A random direction with these axes in it."""
    direction = chance.normal(size=3) * axes
    return direction / np.linalg.norm(direction)


if __name__ == "__main__":
    main()
