"""Reads Drake's model directives (`.dmd.yaml`) with those of the files that `add_directives` opens, and writes them as one text.

Frames and models have the names that Drake gives them: `model::frame`, with a namespace before. What Drake refuses is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError
from yaml.nodes import MappingNode, Node, SequenceNode

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.text import printable
from ddenv.world.access import Missing, Unusable
from ddenv.world.load import complaint
from ddenv.world.model import Note
from ddenv.world.pose import Pose
from ddenv.world.scenario import Coordinate, Corner, Finite, Section
from ddenv.world.sdf.context import Context

# Maximum number of directives: a few files that open each other could ask for more than any machine can hold.
MOST = 50_000
WORLD, WORLD_INSTANCE = "world", "WorldModelInstance"
FILTERS = "add_collision_filter_group"
ROTATIONS = ("!Identity", "!Rpy", "!AngleAxis")
Name = Annotated[str, Field(min_length=1)]


class Rotation(Section):
    """`!Rpy` with `deg`, or `!AngleAxis` with `angle_deg` and `axis`; nothing of these turns nothing."""

    deg: Corner | None = None
    angle_deg: Finite | None = None
    axis: Corner | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Rotation:
        rpy, angle, axis = (each is not None for each in (self.deg, self.angle_deg, self.axis))
        if angle != axis or (rpy and axis):
            raise PydanticCustomError("rotation", "should be !Rpy with deg, or !AngleAxis with angle_deg and axis")
        if self.axis is not None and not 1e-9 < math.hypot(*self.axis) < 1e9:
            raise PydanticCustomError("rotation", "the axis has no usable length")
        return self

    @property
    def pose(self) -> Pose:
        if self.deg is not None:
            return Pose.from_rpy(0.0, 0.0, 0.0, *map(math.radians, self.deg))
        if self.axis is None or self.angle_deg is None:
            return Pose()
        half, length = math.radians(self.angle_deg) / 2, math.hypot(*self.axis)
        x, y, z = (part / length * math.sin(half) for part in self.axis)
        return Pose((0.0, 0.0, 0.0), (math.cos(half), x, y, z))


class Offset(Section):
    """A place in m and degrees."""

    translation: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    rotation: Rotation = Rotation()

    @property
    def pose(self) -> Pose:
        return Pose(self.translation, self.rotation.pose.quaternion)


class Transform(Offset):
    """A place in the frame `base_frame`, by default the world."""

    base_frame: Name | None = None


class AddModel(Section):
    """The joints named stand at their positions, rad or m; the bodies named, which are free, at their places."""

    name: Name
    file: Name
    default_joint_positions: Mapping[str, tuple[Finite]] = Field(default={})
    default_free_body_pose: Mapping[str, Transform] = Field(default={})


class AddModelInstance(Section):
    name: Name


class AddFrame(Section):
    name: Name
    X_PF: Transform


class AddWeld(Section):
    parent: Name
    child: Name
    X_PC: Offset = Offset()


class AddDirectives(Section):
    file: Name
    model_namespace: str = ""


KINDS: dict[str, type[Section]] = {
    "add_model": AddModel,
    "add_model_instance": AddModelInstance,
    "add_frame": AddFrame,
    "add_weld": AddWeld,
    "add_directives": AddDirectives,
}


@dataclass(frozen=True)
class Directive:
    """A directive with its names as seen from the outermost file, and its place; `span` (start, end) are bytes of the one text."""

    value: Section
    path: Path
    line: int
    span: tuple[int, int] = (0, 0)

    def complain(self, message: str) -> UserError:
        """A UserError with file and line."""
        return _wrong(self.path, self.line, message)


def _wrong(path: Path, line: int, message: str) -> UserError:
    return UserError(f"{path}:{line}: {printable(message)}")


class _Loader(yaml.BaseLoader):
    """Reads all scalars as text. An alias could stand for endless text, and without its anchor it stands for nothing."""

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]  # the stubs lack it
            raise yaml.MarkedYAMLError(problem="aliases (*name) are not read; write the value out", problem_mark=mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        if node.tag.startswith("!") and node.tag not in ROTATIONS:
            raise yaml.MarkedYAMLError(
                problem=f"{node.tag[:40]}: only fixed poses are read", problem_mark=node.start_mark
            )
        found: dict[Any, Any] = super().construct_mapping(node, deep)
        if len(found) < len(node.value):
            raise yaml.MarkedYAMLError(problem="a key stands twice", problem_mark=node.start_mark)
        return found


def opened(text: bytes, path: Path, context: Context) -> tuple[list[Directive], bytes]:
    """All directives in `text`, the content of `path`, and in the files that it opens; and one text that has them, a line each.

    Raises UserError with file and line.
    """
    found: list[Directive] = []
    lines, at = [b"directives: ["], len(b"directives: [")
    for one in _all(text, path, "", (path,), {}, context):
        if len(found) >= MOST:
            raise one.complain(f"more than {MOST} directives")
        if not isinstance(one.value, AddDirectives):
            lines.append(f"{_written(one.value)},".encode())
            one = replace(one, span=(at + 1, at + 1 + len(lines[-1])))
            at = one.span[1]
        found.append(one)
    return found, b"\n".join([*lines, b"]", b""])


Items = list[tuple[Section, int]]


def _all(
    text: bytes, path: Path, namespace: str, files: tuple[Path, ...], parsed: dict[Path, Items], context: Context
) -> Iterator[Directive]:
    """The directives of a file and, after each that opens another one, those of that."""
    if path not in parsed:
        parsed[path] = list(_items(text, path, context))
    for value, line in parsed[path]:
        one = Directive(_scoped(value, namespace, path if len(files) > 1 else None), path, line)
        yield one
        if isinstance(one.value, AddDirectives):
            inner, content = _file(one, one.value.file, context)
            if inner in files:
                chain = " opens ".join(each.name for each in (*files[files.index(inner) :], inner))
                raise one.complain(f"add_directives form a cycle: {chain}")
            yield from _all(content, inner, one.value.model_namespace, (*files, inner), parsed, context)


def _items(text: bytes, path: Path, context: Context) -> Iterator[tuple[Section, int]]:
    """The directives of a file with their lines; collision filters are noted."""
    try:
        loader = _Loader(text.decode())
        root = loader.get_single_node()
    except (yaml.YAMLError, ValueError) as error:
        raise _not_yaml(path, error) from None
    key, listed = root.value[0] if isinstance(root, MappingNode) and len(root.value) == 1 else (None, None)
    if key is None or key.value != "directives" or not isinstance(listed, SequenceNode):
        raise UserError(f"{path}: expected 'directives:' with a list, and nothing else")
    for node in listed.value:
        line = node.start_mark.line + 1
        try:
            data = loader.construct_object(node, deep=True)
        except yaml.YAMLError as error:
            raise _not_yaml(path, error) from None
        if not isinstance(data, dict) or len(data) != 1:
            raise _wrong(path, line, f"expected one directive: {', '.join(KINDS)}")
        ((kind, content),) = data.items()
        if kind == FILTERS:
            why = "collision filters are not simulated, nor written with what is left"
            context.notes.append(Note("ignored", "", f"{path}:{line}", kind, why))
            continue
        if kind not in KINDS:
            raise _wrong(path, line, f"unknown directive '{kind[:80]}'{nearest(kind[:80], list(KINDS))}")
        try:
            yield KINDS[kind].model_validate(content), line
        except ValidationError as error:
            # A misspelled key, before the one that is missing.
            first = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
            words, what = complaint(first, KINDS[kind])
            raise _wrong(path, line, ": ".join(each for each in (kind, words, what) if each)) from None


def _not_yaml(path: Path, error: Exception) -> UserError:
    mark = getattr(error, "problem_mark", None)
    line = "" if mark is None else f":{mark.line + 1}"
    return UserError(f"{path}{line}: not valid YAML: {getattr(error, 'problem', None) or 'not UTF-8 text'}")


def _file(one: Directive, uri: str, context: Context) -> tuple[Path, bytes]:
    """Path and content of the directives that `one` opens. Raises UserError."""
    try:
        return context.resources.sdf(uri, one.path.parent)
    except Missing as missing:
        raise one.complain(f"'{uri[:200]}' was not found ({missing}); give its folder with --model-path") from None
    except Unusable as error:
        raise one.complain(f"'{uri[:200]}' cannot be opened: {error}") from None


def _scoped(value: Section, namespace: str, inner: Path | None) -> Section:
    """`value` with its names as seen from outside the namespace, and where the file `inner` names another one, with its path."""

    def full(name: str) -> str:
        return f"{namespace}::{name}" if namespace and name != WORLD else name

    def based(pose: Transform) -> Transform:
        return pose if pose.base_frame is None else pose.model_copy(update={"base_frame": full(pose.base_frame)})

    match value:
        case AddModel(name=name, file=file, default_free_body_pose=places):
            there = {body: based(place) for body, place in places.items()}
            if inner is not None and "://" not in file:
                file = f"file://{(inner.parent / file).absolute()}"
            changed: dict[str, Any] = {"name": full(name), "file": file, "default_free_body_pose": there}
        case AddFrame(name=name, X_PF=place):
            # A frame of the world is in no namespace.
            changed = {"name": full(name) if "::" in name else name, "X_PF": based(place)}
        case AddWeld(parent=parent, child=child):
            changed = {"parent": full(parent), "child": full(child)}
        case AddDirectives(model_namespace=own):
            changed = {"model_namespace": full(own) if own else namespace}
        case AddModelInstance(name=name):
            changed = {"name": full(name)}
        case _:
            raise TypeError(type(value).__name__)
    return value.model_copy(update=changed)


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True


def _mapping(dumper: yaml.SafeDumper, value: Section) -> Node:
    tag = "tag:yaml.org,2002:map"
    if isinstance(value, Rotation):
        tag = ROTATIONS[1 if value.deg is not None else 2 if value.axis is not None else 0]
    given = {name: each for name, each in value if name in value.model_fields_set and each not in (None, {})}
    return dumper.represent_mapping(tag, given)


_Dumper.add_multi_representer(Section, _mapping)


def _written(value: Section) -> str:
    kind = next(kind for kind, section in KINDS.items() if isinstance(value, section))
    return yaml.dump(
        {kind: value}, Dumper=_Dumper, default_flow_style=True, width=math.inf, allow_unicode=True, sort_keys=False
    ).strip()
