"""What is sound of a world that was read, and of a refusal."""

from __future__ import annotations

import dataclasses
import math
import re
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ddenv.errors import UserError
from ddenv.robot.drake.plant import spatial_inertia
from ddenv.world.model import Joint, Link, Mesh, Model, Plane, Shape, World
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import parse_world
from ddenv.world.write import without
from tests.conftest import DATA

READING = Reading(model_path=(DATA / "models",))

# What is said of a file as a whole: there is no element to point at.
OF_THE_FILE = (
    r":\d+:\d+: not well-formed XML: ",
    r":\d+:\d+: DOCTYPE is not allowed",
    r":\d+:\d+: elements are nested more than ",
    r": the file is empty",
    r": is UTF-16, ",
    r": cannot be decoded: ",
    r": expected one <world> inside <sdf>, found ",
    r": models or frames are nested too deeply",
)
_NAME = r"(?:\[@name='(?:[^']|'(?!\]))*'\])?"
OF_AN_ELEMENT = re.compile(rf":(\d+): (?:/[^/\s\[\]:]+{_NAME})*?/([^/\s\[\]:]+){_NAME}: \S")


def read_or_refused(text: bytes, path: Path) -> None:
    """The promise of the reader."""
    with warnings.catch_warnings():
        # A warning would be a line of its own on the terminal.
        warnings.simplefilter("error")
        try:
            world = parse_world(text, path, READING)
        except UserError as error:
            check_complaint(str(error), text, path)
        else:
            check_world(world)
            check_smaller_worlds(world)


def check_complaint(line: str, text: bytes, path: Path) -> None:
    assert line.isprintable(), line
    assert len(line) < 6000, line
    file = next(
        (one for one in (path, *DATA.rglob("*")) if re.match(re.escape(str(one)) + ":", line)), None
    )
    assert file is not None, line
    said = line.removeprefix(str(file))
    if any(re.match(pattern, said) for pattern in OF_THE_FILE):
        return
    found = OF_AN_ELEMENT.match(said)
    assert found, line
    lines = (text if file == path else file.read_bytes()).splitlines()
    assert f"<{found[2]}".encode() in lines[int(found[1]) - 1], line


def check_world(world: World) -> None:
    assert_finite(world.gravity)
    assert unique(model.name for model in world.models)
    assert world.anchors <= {model.name for model in world.models}
    spans = sorted(span for model in world.models for span in model.spans)
    ends = [0, *(place for span in spans for place in span), len(world.text)]
    assert ends == sorted(ends), spans
    for model in world.models:
        for (start, end), tags in zip(
            model.spans, ((b"<model", b"<include"), (b"<model",)), strict=False
        ):
            assert world.text[start:end].startswith(tags), world.text[start:end]
            assert world.text[start:end].endswith(b">"), world.text[start:end]
        check_model(model)


def check_model(model: Model) -> None:
    assert model.links
    assert_finite(model.pose)
    assert unique(link.name for link in model.links)
    assert unique(joint.name for joint in model.joints)
    assert not (model.static and model.joints)
    for link in model.links:
        check_link(link, model.static)
    for joint in model.joints:
        check_joint(joint, {link.name for link in model.links})
    parents = {joint.child: joint.parent for joint in model.joints}
    assert len(parents) == len(model.joints)
    for link in parents:
        for _ in model.links:
            link = parents.get(link, "world")
        assert link == "world", "joints close a loop"


def check_link(link: Link, static: bool) -> None:
    assert_finite(link)
    for one in (*link.collisions, *link.visuals):
        check_shape(one.shape, convex=one in link.collisions)
    assert all(collision.mu >= 0 for collision in link.collisions)
    assert (link.inertia is None) == static
    if link.inertia is not None:
        assert link.inertia.mass > 0
        # Drake's own judgement: it raises for what no body can have.
        assert spatial_inertia(link.inertia, link.pose).IsPhysicallyValid()


def check_shape(shape: Shape, convex: bool) -> None:
    if isinstance(shape, Mesh):
        assert len(shape.vertices) >= 3 + convex
        assert np.isfinite(shape.vertices).all()
        assert len(shape.faces) > 0
        assert 0 <= shape.faces.min() <= shape.faces.max() < len(shape.vertices)
        # Drake refuses hulls of no volume.
        corners = shape.vertices[shape.faces] - shape.vertices.mean(axis=0)
        assert not convex or np.linalg.det(corners).sum() > 0
    elif not isinstance(shape, Plane):
        assert all(size > 0 for size in numbers_in(shape)), shape


def check_joint(joint: Joint, links: set[str]) -> None:
    assert joint.child in links
    assert joint.parent in links | {"world"}
    assert joint.parent != joint.child
    assert "world" not in links, "a parent 'world' would mean either of two things"
    assert_finite((joint.pose, joint.axis, joint.axis2 or (), joint.damping))
    assert math.isclose(math.hypot(*joint.axis), 1, abs_tol=1e-6)
    assert -math.inf <= joint.lower <= joint.upper <= math.inf
    assert joint.lower < math.inf and joint.upper > -math.inf
    assert joint.effort >= 0 and joint.velocity >= 0 and joint.damping >= 0


def unique(names: Iterable[str]) -> bool:
    names = list(names)
    return len(set(names)) == len(names)


def assert_finite(value: object) -> None:
    assert all(map(math.isfinite, numbers_in(value))), value


def numbers_in(value: object) -> list[float]:
    """All numbers in plain data."""
    if isinstance(value, float | int):
        return [value]
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    if isinstance(value, tuple | list):
        return [number for each in value for number in numbers_in(each)]
    if dataclasses.is_dataclass(value):
        return [
            number
            for field in dataclasses.fields(value)
            for number in numbers_in(getattr(value, field.name))
        ]
    return []


def check_smaller_worlds(world: World) -> None:
    """Without any of its elements the world reads again, and all others are as they were."""
    names = world.elements()
    for name in (
        names if len(names) < 4 else (names[0], names[len(world.text) % len(names)], names[-1])
    ):
        again = parse_world(without(world, frozenset([name])), world.path, READING)
        assert [model.links for model in again.models] == [
            model.links for model in world.models if model.name != name
        ]
