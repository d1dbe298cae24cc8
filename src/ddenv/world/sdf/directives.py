"""Reads Drake's model directives (`.dmd.yaml`) as YAML nodes that know their place; opens the files
that `add_directives` names.

Frames and models have the names that Drake gives them: `model::frame`, with a namespace before.
What Drake refuses is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.text import printable
from ddenv.world.access import Missing, Unusable, not_yaml
from ddenv.world.pose import HERE, Pose, turn, vector
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.frames import FARTHEST

Span = tuple[int, int]
# Maximum number of directives: a few files that open each other could ask for more than any machine
# can hold.
MOST = 50_000
WORLD = "world"
WORLD_INSTANCE = "WorldModelInstance"
# The keys of each directive; those with a star are required.
KEYS = {
    kind: tuple(keys.split())
    for kind, keys in {
        "add_model": "*name *file default_joint_positions default_free_body_pose",
        "add_model_instance": "*name",
        "add_frame": "*name *X_PF",
        "add_weld": "*parent *child X_PC",
        "add_collision_filter_group": "*name members member_groups ignored_collision_filter_groups",
        "add_directives": "*file model_namespace",
    }.items()
}
_DASH = re.compile(r"^[ \t]*(-)(?=\s)", re.MULTILINE)
_COMMENT = re.compile(r"[ \t]*(#[^\n\r]*)?(?=[\n\r]|\Z)")
_COMMA = re.compile(r"\s*,")


@dataclass(frozen=True)
class Source:
    """A file of directives as text; `namespace` is that of its names."""

    path: Path
    text: str
    namespace: str = ""

    def complain(self, node: Node, message: str) -> UserError:
        """A UserError with file and line of `node`."""
        return UserError(f"{self.path}:{node.start_mark.line + 1}: {printable(message)}")

    def scoped(self, name: str) -> str:
        """`name` with the namespace before it; `world` has none."""
        if name == WORLD or not self.namespace:
            return name
        return f"{self.namespace}::{name}"

    def name_of(self, node: Node) -> str:
        """The name in a scalar, with the namespace before it. Raises UserError."""
        return self.scoped(self.text_of(node))

    def inner(self, keys: Mapping[str, Node]) -> str:
        """The namespace that `model_namespace` of a directive says. Raises UserError."""
        own = keys.get("model_namespace")
        if own is None:
            return self.namespace
        return self.name_of(own)

    def bytes_of(self, span: Span) -> Span:
        """Byte positions in the encoded text for positions in the text."""
        if self.text.isascii():
            return span
        start, end = (len(self.text[:at].encode()) for at in span)
        return start, end

    def text_of(self, node: Node) -> str:
        """The text of a scalar. Raises UserError for anything else, and for an empty one."""
        if not isinstance(node, ScalarNode) or not node.value.strip():
            raise self.complain(node, "expected a name or a file")
        return str(node.value)

    def pairs(self, node: Node | None) -> dict[str, Node]:
        """The values of a mapping by key; none without one.

        Raises UserError for anything else, and for a key that stands twice.
        """
        if node is None:
            return {}
        if not isinstance(node, MappingNode):
            raise self.complain(node, "expected keys with values")
        found: dict[str, Node] = {}
        for key, value in node.value:
            name = self.text_of(key)
            if name in found:
                raise self.complain(key, f"the key '{name}' appears twice")
            found[name] = value
        return found

    def keys(self, node: Node, what: str, keys: tuple[str, ...]) -> dict[str, Node]:
        """The same with only `keys`, of which those with a star are required. Raises UserError."""
        found = self.pairs(node)
        known = [key.lstrip("*") for key in keys]
        for key in found:
            if key not in known:
                hint = f"{nearest(key, known)}; allowed are {', '.join(known)}"
                raise self.complain(node, f"{what}: unknown key '{key}'{hint}")
        for key in keys:
            if key[0] == "*" and key[1:] not in found:
                raise self.complain(node, f"{what}: {key[1:]} is missing")
        return found

    def items(self, node: Node | None) -> list[Node]:
        """The items of a list; none without one. Raises UserError for anything else."""
        if node is None:
            return []
        if not isinstance(node, SequenceNode):
            raise self.complain(node, "expected a list")
        return list(node.value)

    def numbers(self, node: Node, count: int) -> tuple[float, ...]:
        """A list of `count` finite numbers. Raises UserError."""
        items = self.items(node)
        if len(items) != count:
            raise self.complain(node, f"expected {count} numbers, found {len(items)}")
        return tuple(map(self.number, items))

    def number(self, node: Node) -> float:
        """A finite number. Raises UserError."""
        said = node.value if isinstance(node, ScalarNode) else "something else"
        try:
            number = math.nan if "_" in said else float(said)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise self.complain(node, f"expected a finite number, found {said[:60]!r}")
        return number

    def pose(self, node: Node | None, *, with_base: bool = True) -> tuple[Node | None, Pose]:
        """The `base_frame` of a transform, which may be missing, and its pose in that: m, and
        degrees. Raises UserError.
        """
        if node is None:
            return None, HERE
        keys = self.keys(node, "pose", ("base_frame",) * with_base + ("translation", "rotation"))
        for value in keys.values():
            if value.tag == "!Uniform" or value.tag.startswith("!Gaussian"):
                raise self.complain(value, f"{value.tag} is random; only fixed poses are read")
        x, y, z = self.numbers(keys["translation"], 3) if "translation" in keys else (0.0, 0.0, 0.0)
        if max(abs(x), abs(y), abs(z)) > FARTHEST:
            raise self.complain(node, f"is farther than {FARTHEST:g} m away")
        rotation = self._rotation(keys.get("rotation"))
        return keys.get("base_frame"), Pose((x, y, z), rotation.quaternion)

    def _rotation(self, node: Node | None) -> Pose:
        if node is None:
            return HERE
        if node.tag == "!Rpy":
            angles = self.numbers(self.keys(node, "!Rpy", ("*deg",))["deg"], 3)
            return Pose.from_rpy(0.0, 0.0, 0.0, *map(math.radians, angles))
        if node.tag == "!AngleAxis":
            keys = self.keys(node, "!AngleAxis", ("*angle_deg", "*axis"))
            axis = self.numbers(keys["axis"], 3)
            length = math.hypot(*axis)
            if not 1e-9 < length < 1e9:
                raise self.complain(node, "the axis has no usable length")
            angle = math.radians(self.number(keys["angle_deg"]))
            return turn(vector(part / length for part in axis), angle)
        if node.tag in ("!Identity", "tag:yaml.org,2002:map") and not node.value:
            return HERE
        raise self.complain(node, f"expected a rotation !Rpy or !AngleAxis, found {node.tag[:40]}")


@dataclass(frozen=True, kw_only=True)
class Directive:
    """One directive: its `kind`, its values by key, and its place; `span` (start, end) are bytes of
    the outermost file.
    """

    kind: str
    keys: Mapping[str, Node]
    node: Node
    source: Source
    span: Span


class _Loader(yaml.SafeLoader):
    """Composes nodes; an alias could stand for endless text, and without its anchor it stands for
    nothing.
    """

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(
                problem="aliases (*name) are not read; write the value out", problem_mark=mark
            )
        return super().compose_node(parent, index)


def opened(text: bytes, path: Path, context: Context) -> tuple[list[Directive], bytes | None]:
    """The directives in `text`, the content of `path`, and of all that they open, in order; one
    text for all of them, if others were opened. Raises UserError with file and line.
    """
    found: list[Directive] = []
    pieces = _open(_source(text, path), (path,), context, found)
    if all(one.kind != "add_directives" for one in found):
        return found, None
    flat = text.decode()
    for (start, end), piece in reversed(pieces):
        flat = flat[:start] + piece + flat[end:]
    return found, flat.encode()


def _open(
    source: Source, files: tuple[Path, ...], context: Context, found: list[Directive]
) -> list[tuple[Span, str]]:
    """Adds the directives of `source` to `found`; returns what to write in place of each
    `add_directives` of the outermost file.
    """
    pieces = []
    try:
        root = _Loader(source.text).get_single_node()
    except (yaml.YAMLError, ValueError) as error:
        raise not_yaml(source.path, error) from None
    if root is None:
        raise UserError(f"{source.path}: the file is empty; expected directives")
    listed: Any = source.keys(root, "file", ("*directives",))["directives"]
    source.items(listed)
    for node, (start, end) in spans_of(source, listed):
        if len(source.pairs(node)) != 1:
            raise source.complain(node, f"expected one directive: {', '.join(KEYS)}")
        ((kind, value),) = source.pairs(node).items()
        if kind not in KEYS:
            raise source.complain(node, f"unknown directive '{kind}'{nearest(kind, KEYS)}")
        one = Directive(
            kind=kind,
            keys=source.keys(value, kind, KEYS[kind]),
            node=node,
            source=source,
            span=source.bytes_of((start, end)),
        )
        if len(found) >= MOST:
            raise source.complain(node, f"more than {MOST} directives")
        found.append(one)
        if kind == "add_directives":
            first = len(found)
            inner = _inner(one, files, context)
            _open(inner, (*files, inner.path), context, found)
            if len(files) == 1:
                texts = [_flat(each) for each in found[first:] if each.kind != "add_directives"]
                new_line = "\n" + " " * (start - source.text.rfind("\n", 0, start) - 1)
                block = new_line.join(f"- {each}" for each in texts)
                pieces.append(
                    (
                        (start, end),
                        "".join(f"{each}, " for each in texts) if listed.flow_style else block,
                    )
                )
    return pieces


def _inner(one: Directive, files: tuple[Path, ...], context: Context) -> Source:
    """The directives that `one` opens. Raises UserError."""
    node = one.keys["file"]
    source = one.source
    uri = source.text_of(node)
    try:
        path, text = context.resources.sdf(uri, source.path.parent)
    except Missing as missing:
        why = f"'{uri[:200]}' was not found ({missing}); give its folder with --model-path"
        raise source.complain(node, why) from None
    except Unusable as error:
        raise source.complain(node, f"'{uri[:200]}' cannot be opened: {error}") from None
    if path in files:
        chain = " opens ".join(each.name for each in (*files[files.index(path) :], path))
        raise source.complain(node, f"add_directives form a cycle: {chain}")
    return _source(text, path, source.inner(one.keys))


def _source(text: bytes, path: Path, namespace: str = "") -> Source:
    try:
        return Source(path, text.decode(), namespace)
    except UnicodeDecodeError:
        raise UserError(f"{path}: cannot be decoded; save it as UTF-8") from None


def spans_of(source: Source, listed: Any) -> list[tuple[Any, Span]]:
    """The items of a list, or the pairs of keys and values, each with the text that goes with it:
    its dash or its comma, too.
    """
    found: list[tuple[Any, Span]] = []
    before = listed.start_mark.index
    for item in listed.value:
        node, last = item if isinstance(item, tuple) else (item, item)
        start = node.start_mark.index
        end = _end(last)
        if isinstance(listed, SequenceNode) and not listed.flow_style:
            dash = _DASH.search(source.text, before) if found else None
            # The list itself begins with the first dash, which may stand behind another one.
            start = before if dash is None else dash.start(1)
        after = (_COMMA if listed.flow_style else _COMMENT).match(source.text, end)
        end = end if after is None else after.end()
        found.append((item, (start, end)))
        before = end
    return found


def _end(node: Any) -> int:
    """Where the last word of `node` ends: PyYAML ends a block where the next one begins."""
    if isinstance(node, ScalarNode) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(last[1] if isinstance(node, MappingNode) else last)


def _flat(one: Directive) -> str:
    """A directive on one line, its names as seen from the outermost file."""
    node = deepcopy(one.node)
    source = one.source
    keys = source.pairs(source.pairs(node)[one.kind])
    groups = source.items(keys.get("member_groups"))
    groups += source.items(keys.get("ignored_collision_filter_groups"))
    named: list[Any] = [*groups, *source.items(keys.get("members"))]
    named += [keys[key] for key in ("parent", "child") if key in keys]
    # A frame of the world is in no namespace.
    if "name" in keys and (one.kind != "add_frame" or "::" in keys["name"].value):
        named.append(keys["name"])
    poses = [keys["X_PF"]] if "X_PF" in keys else []
    poses += source.pairs(keys.get("default_free_body_pose")).values()
    named += [base for pose in poses if (base := source.pairs(pose).get("base_frame")) is not None]
    for each in named:
        each.value = source.scoped(each.value)
    if one.kind == "add_collision_filter_group":
        # Drake takes no scopes in the names of groups.
        for group in (keys["name"], *groups):
            group.value = group.value.replace("::", ".")
    if one.kind == "add_model" and "://" not in keys["file"].value:
        keys["file"].value = f"file://{(source.path.parent / keys['file'].value).absolute()}"
    left: list[Any] = [node]
    while left:
        each = left.pop()
        if isinstance(each, ScalarNode):
            each.style = "'" if each.style in ("|", ">") else each.style
            continue
        each.flow_style = True
        left += chain(*each.value) if isinstance(each, MappingNode) else each.value
    return str(
        yaml.serialize(node, Dumper=yaml.SafeDumper, width=math.inf, allow_unicode=True)
    ).strip()
