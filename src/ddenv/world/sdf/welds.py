"""The world that Drake's model directives make: each model at the place where Drake puts it, and
what is welded to what.

A model that is welded to the world, or to what does not move, is a model of its own, tied to what
carries it. A model that is welded to one that can move is one body with that, and so a part of it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from yaml.nodes import Node

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.world.model import Joint, Link, Model, Shared, World, held_with
from ddenv.world.pose import HERE, Pose, turn, vector
from ddenv.world.sdf.assemble import assemble, still
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.directives import (
    WORLD,
    WORLD_INSTANCE,
    Directive,
    Source,
    Span,
    opened,
    spans_of,
)
from ddenv.world.sdf.frames import Scope
from ddenv.world.sdf.includes import included
from ddenv.world.sdf.joints import check_tree
from ddenv.world.sdf.urdf import is_urdf, without_mass
from ddenv.world.sdf.xml import Element, complain

GRAVITY = (0.0, 0.0, -9.81)  # Drake's default, m/s^2
OWN_FRAME = "__model__"
VERSION = "model directives"
Group = tuple[str, str]  # a model and the root of those of its links that joints connect


@dataclass(frozen=True)
class Frame:
    """A frame that is fixed to `link` of `model`, at `pose` where the model's own file puts that;
    the world if both are empty.

    Without any of the `owners` there is no such frame.
    """

    model: str = ""
    link: str = ""
    pose: Pose = HERE
    owners: frozenset[str] = frozenset()


@dataclass(frozen=True, kw_only=True)
class Fixing:
    """What places a group of links: its frame `own` stands at `pose` in the frame `base`, by a weld
    or as a free body.
    """

    own: Frame
    base: Frame
    pose: Pose
    complain: Callable[[str], UserError]
    weld: bool


@dataclass(kw_only=True)
class _Builder:
    """The models, frames and welds so far, by the names that Drake gives them."""

    context: Context
    models: dict[str, Model] = field(default_factory=dict)
    elements: dict[str, Element] = field(default_factory=dict)
    scopes: dict[int, Scope] = field(default_factory=dict)
    frames: dict[str, Frame] = field(
        default_factory=lambda: {f"{WORLD_INSTANCE}::{WORLD}": Frame()}
    )
    instances: set[str] = field(default_factory=lambda: {WORLD_INSTANCE})
    # By model and link.
    groups: dict[tuple[str, str], Group] = field(default_factory=dict)
    fixings: dict[Group, Fixing] = field(default_factory=dict)
    spans: dict[str, list[Span]] = field(default_factory=lambda: defaultdict(list))
    filters: list[Directive] = field(default_factory=list)
    places: dict[Group, Pose | None] = field(default_factory=dict)
    finished: dict[str, Model | None] = field(default_factory=dict)
    # By model: the one that it is a part of, and the joint that holds it there.
    carriers: dict[str, tuple[str, Joint]] = field(default_factory=dict)
    ties: dict[tuple[str, str], None] = field(default_factory=dict)
    anchors: set[str] = field(default_factory=set)

    def take(self, one: Directive) -> None:
        """Adds what `one` says. Raises UserError."""
        source = one.source
        keys = one.keys
        match one.kind:
            case "add_model":
                self._add_model(one)
            case "add_model_instance":
                self._new_model(one)
            case "add_frame":
                self._add_frame(one)
            case "add_weld":
                parent, child = (self._frame(keys[end], source) for end in ("parent", "child"))
                _, pose = source.pose(keys.get("X_PC"), with_base=False)
                if not child.model:
                    raise source.complain(
                        keys["child"], "the world cannot be welded to a model; make it the parent"
                    )
                self._fix(
                    Fixing(
                        own=child,
                        base=parent,
                        pose=pose,
                        complain=partial(source.complain, one.node),
                        weld=True,
                    )
                )
                for owner in child.owners:
                    self.spans[owner].append(one.span)
            case "add_collision_filter_group":
                self.filters.append(one)
            case _:
                name = source.inner(keys)
                if name and name not in self.instances:
                    node = keys.get("model_namespace", one.node)
                    why = f"there is no model instance '{name}' for the namespace"
                    raise source.complain(node, why)

    def _new_model(self, one: Directive) -> str:
        """The name of the model that `one` adds. Raises UserError if it is taken."""
        node = one.keys["name"]
        name = one.source.name_of(node)
        if name in self.instances or name == "DefaultModelInstance":
            raise one.source.complain(node, f"the model '{name}' is added twice")
        self.instances.add(name)
        return name

    def _add_model(self, one: Directive) -> None:
        source = one.source
        keys = one.keys
        name = self._new_model(one)
        at = source.path, int(one.node.start_mark.line) + 1, one.span
        include = _element("add_model", *at)
        uri = _element("uri", *at)
        uri.text = source.text_of(keys["file"])
        include.set("name", name)
        include.append(uri)
        self.context.model = name
        part = included(include, (source.path,), self.context)
        self.context.model = ""
        if part is None:
            return
        part = replace(part, name=name)
        outer = Scope(_element(WORLD, *at), (source.path,), self.context, self.scopes)
        model = without_mass(assemble(part, name, outer, None, self.context), part.element)
        positions = source.pairs(keys.get("default_joint_positions"))
        model, turned = _at_positions(model, positions, source)
        self.models[name] = model
        self.elements[name] = include
        self.spans[name].append(one.span)
        for own, pose, held in _frames(outer.inside(part), outer.placed(part), ""):
            if own != OWN_FRAME or not is_urdf(part.element):
                self.frames[f"{name}::{own}"] = Frame(
                    name, held, turned.get(held, HERE) @ pose, frozenset([name])
                )
                self.instances.add(f"{name}::{own}".rpartition("::")[0])
        # By joints, but for those to the world.
        parents = {joint.child: joint.parent for joint in model.joints if joint.parent != WORLD}
        for link in model.links:
            root = link.name
            while root in parents:
                root = parents[root]
            self.groups[name, link.name] = name, root
        for body, value in source.pairs(keys.get("default_free_body_pose")).items():
            frame = self.frames.get(f"{name}::{body}")
            if frame is None or "::" in body:
                raise source.complain(value, f"there is no body '{body}' in '{name}'")
            base, pose = source.pose(value)
            there = Frame() if base is None else self._frame(base, source)
            self._fix(
                Fixing(
                    own=frame,
                    base=there,
                    pose=pose,
                    complain=partial(source.complain, value),
                    weld=False,
                )
            )

    def _frame(self, node: Node, source: Source) -> Frame:
        """The frame that `node` names. Raises UserError."""
        name = source.name_of(node)
        found = [
            each
            for each in self.frames
            if name == (each if "::" in name else each.rpartition("::")[2])
        ]
        if not found:
            hint = nearest(name, self.frames)
            raise source.complain(node, f"there is no frame '{name}' here{hint}")
        if len(found) > 1:
            raise source.complain(node, f"'{name}' may be {' or '.join(found[:3])}")
        return self.frames[found[0]]

    def _add_frame(self, one: Directive) -> None:
        source = one.source
        base, pose = source.pose(one.keys["X_PF"])
        if base is None:
            raise source.complain(one.keys["X_PF"], "base_frame is missing")
        there = self._frame(base, source)
        instance, _, last = source.text_of(one.keys["name"]).rpartition("::")
        owners = there.owners
        if instance:
            instance = source.scoped(instance)
            if instance not in self.instances:
                raise source.complain(one.keys["name"], f"there is no model instance '{instance}'")
            words = instance.split("::")
            owners |= {
                name
                for end in range(len(words))
                if (name := "::".join(words[: end + 1])) in self.models
            }
        else:
            inner = there.link.rpartition("::")[0]
            instance = "::".join(each for each in (there.model or WORLD_INSTANCE, inner) if each)
        full = f"{instance}::{last}"
        if full in self.frames:
            raise source.complain(one.keys["name"], f"there already is a frame '{full}'")
        self.frames[full] = Frame(there.model, there.link, there.pose @ pose, owners)
        for owner in owners:
            self.spans[owner].append(one.span)

    def _fix(self, fixing: Fixing) -> None:
        name = fixing.own.model
        link = fixing.own.link
        group = self.groups[name, link]
        model = self.models[name]
        before = self.fixings.get(group)
        held = {self.groups[name, joint.child] for joint in model.joints if joint.parent == WORLD}
        if model.static or group in held:
            raise fixing.complain(f"'{name}' is fixed to the world by its own file")
        if before is not None and (before.weld or not fixing.weld or before.base.model):
            raise fixing.complain(f"'{name}' is placed twice")
        if not (fixing.weld or fixing.base.model or link == group[1]):
            raise fixing.complain(f"'{link}' is not free: joints hold it")
        self.fixings[group] = fixing

    # Where all of it is.

    def _place(self, group: Group) -> Pose:
        """How far a group of links moves from the place where its own file puts it. Raises
        UserError.
        """
        fixing = self.fixings.get(group)
        if fixing is None:
            return HERE
        if group not in self.places:
            self.places[group] = None
            self.places[group] = self._pose(fixing.base) @ fixing.pose @ fixing.own.pose.inverse()
        place = self.places[group]
        if place is None:
            raise fixing.complain(f"the place of '{group[0]}' depends on itself")
        return place

    def _pose(self, frame: Frame) -> Pose:
        """The pose of `frame` in the world."""
        if not frame.model:
            return frame.pose
        return self._place(self.groups[frame.model, frame.link]) @ frame.pose

    def finish(self, name: str) -> Model:
        """The model `name` at its place, with its welds to what does not move. Raises UserError."""
        if name not in self.finished:
            self.finished[name] = None
            self.finished[name] = self._finished(name)
        model = self.finished[name]
        if model is None:
            raise complain(self.elements[name], "its welds form a loop")
        return model

    def _finished(self, name: str) -> Model:
        model = self.models[name]
        place = {link.name: self._place(self.groups[name, link.name]) for link in model.links}
        joints = [_moved_joint(joint, place[joint.child]) for joint in model.joints]
        groups = dict.fromkeys(self.groups[name, link.name] for link in model.links)
        for fixing in (self.fixings[group] for group in groups if group in self.fixings):
            base = fixing.base
            others = (fixing.own.owners | base.owners) - {name}
            if not fixing.weld:
                self.anchors |= others
                continue
            at = fixing.own.link
            joints = _hung_from(at, joints)
            weld = Joint(
                name=f"{at} (weld)", kind="fixed", parent=WORLD, child=at, pose=self._pose(base)
            )
            if base.model == name:
                joints.append(replace(weld, parent=base.link))
            elif base.model and not _holds(self.finish(base.model), base.link):
                if name in self.carriers:
                    raise fixing.complain(f"'{name}' is welded to two models that can move")
                outer = base.model
                parent = base.link
                if outer in self.carriers:
                    parent = f"{outer}::{parent}"
                    outer = self.carriers[outer][0]
                weld = replace(
                    weld,
                    name=f"{name}::{weld.name}",
                    parent=parent,
                    child=f"{name}::{at}",
                )
                self.carriers[name] = outer, weld
            else:
                joints.append(weld)
            self.ties |= dict.fromkeys((name, other) for other in sorted(others))
        links = tuple(_moved_link(link, place[link.name]) for link in model.links)
        pose = place[model.links[0].name] @ model.pose
        model = replace(
            model, pose=pose, links=links, joints=tuple(joints), spans=tuple(self.spans[name])
        )
        if (
            name not in self.carriers
            and not model.static
            and all(_holds(model, link.name) for link in links)
        ):
            return still(model)
        return model

    def all(self) -> tuple[Model, ...]:
        """The models in the order of their directives, each with those that are parts of it. Raises
        UserError.
        """
        made = {name: self.finish(name) for name in self.models}
        for name, (outer, weld) in self.carriers.items():
            part = made.pop(name)
            whole = made[outer]
            joints = [
                replace(
                    joint,
                    name=f"{name}::{joint.name}",
                    parent=joint.parent if joint.parent == WORLD else f"{name}::{joint.parent}",
                    child=f"{name}::{joint.child}",
                )
                for joint in part.joints
            ]
            made[outer] = replace(
                whole,
                links=(
                    *whole.links,
                    *(replace(link, name=f"{name}::{link.name}") for link in part.links),
                ),
                joints=(*whole.joints, *joints, weld),
                spans=(*whole.spans, *part.spans),
            )
        for name, model in made.items():
            if not model.static:
                check_tree(list(model.joints), self.elements[name])
        return tuple(made.values())

    def carrier(self, name: str) -> str:
        """The model that `name` is a part of: itself, unless it is welded to one that can move."""
        if name in self.carriers:
            return self.carriers[name][0]
        return name

    def shared(self) -> Iterator[Shared]:
        """What of collision filter groups goes when all of some models are gone. Raises
        UserError.
        """
        groups: dict[str, Directive] = {}
        for one in self.filters:
            name = one.source.name_of(one.keys["name"])
            if name in groups:
                raise one.source.complain(one.node, f"the group '{name}' is added twice")
            groups[name] = one
        owners = {name: self._owners(one, "members", {}) for name, one in groups.items()}
        before: dict[str, frozenset[str]] = {}
        while before != owners:
            before = owners
            owners = {
                name: owners[name] | self._owners(one, "member_groups", owners)
                for name, one in groups.items()
            }
        for name, one in groups.items():
            if not owners[name]:
                raise one.source.complain(one.node, "a group needs members or member_groups")
            yield Shared(one.span, owners[name])
            value = one.source.pairs(one.node)[one.kind]
            for (key, listed), span in spans_of(one.source, value):
                if key.value == "name":
                    continue
                for node, inner in spans_of(one.source, listed):
                    yield Shared(
                        one.source.bytes_of(inner), self._owner(node, key.value, one.source, owners)
                    )
                if names := self._owners(one, key.value, owners):
                    yield Shared(one.source.bytes_of(span), names)

    def _owners(
        self, one: Directive, key: str, groups: Mapping[str, frozenset[str]]
    ) -> frozenset[str]:
        nodes = one.source.items(one.keys.get(key))
        return frozenset[str]().union(
            *(self._owner(node, key, one.source, groups) for node in nodes)
        )

    def _owner(
        self, node: Node, key: str, source: Source, groups: Mapping[str, frozenset[str]]
    ) -> frozenset[str]:
        """The models of a member, which is a body, or of a group. Raises UserError."""
        if key == "members":
            return frozenset(map(self.carrier, self._frame(node, source).owners))
        name = source.name_of(node)
        if name not in groups:
            raise source.complain(node, f"there is no group '{name}'{nearest(name, groups)}")
        return groups[name]


def parse_directives(text: bytes, path: Path, context: Context) -> World:
    """The world that the directives in `text`, the content of `path`, make. Raises UserError with
    file and line.

    Its text is that of the file; if that opens others, with their directives in place of
    `add_directives`.
    """
    found, flat = opened(text, path, context)
    builder = _Builder(context=context)
    for one in found:
        builder.take(one)
    models = builder.all()
    shared = list(builder.shared())
    context.complain_of_missing()
    if flat is not None:
        # Again, for the places in that text; what is wrong was said with the places in the files.
        return parse_directives(
            flat, path, Context(resources=context.resources, reading=context.reading)
        )
    going = {span for spans in builder.spans.values() for span in spans} | {
        one.span for one in builder.filters
    }
    if (
        models
        and text[found[0].span[0] :].startswith(b"-")
        and all(one.span in going for one in found)
    ):
        # Drake takes an empty list, but not a missing one.
        span = found[0].span[0], found[-1].span[1]
        shared.append(Shared(span, frozenset(model.name for model in models), b"\n  []"))
    context.note_unused(_element(WORLD, path))
    ties = ((builder.carrier(name), builder.carrier(other)) for name, other in builder.ties)
    world = World(
        path=path,
        name=path.name.split(".")[0],
        text=text,
        gravity=GRAVITY,
        models=models,
        version=VERSION,
        anchors=frozenset(map(builder.carrier, builder.anchors)),
        ties=tuple(dict.fromkeys((name, other) for name, other in ties if name != other)),
        shared=tuple(shared),
    )
    return context.recorded(world)


def _element(tag: str, path: Path, line: int = 1, span: Span = (0, 0)) -> Element:
    """An element at the place of a directive, for all that reads SDF."""
    made = Element(tag)
    made.source = path
    made.line = line
    made.parent = None
    made.start, made.end = span
    return made


def _frames(scope: Scope, here: Pose, prefix: str) -> Iterator[tuple[str, Pose, str]]:
    """The links and frames of a model and of those inside it: name, pose where the file puts it,
    and link.
    """
    named = [
        name
        for name, one in scope.named.items()
        if isinstance(one, Element) and one.tag in ("link", "frame")
    ]
    for name in (OWN_FRAME, *named):
        link = scope.link(name, scope.element)
        if link is not None:
            yield prefix + name, here @ scope.pose(name, scope.element), prefix + link
    for part in scope.parts:
        yield from _frames(scope.inside(part), here @ scope.placed(part), f"{prefix}{part.name}::")


def _at_positions(
    model: Model, positions: Mapping[str, Node], source: Source
) -> tuple[Model, dict[str, Pose]]:
    """`model` with joints at `positions` (rad, or m), and how far each link moves. Raises
    UserError.
    """
    joints = {joint.name: joint for joint in model.joints}
    at: dict[str, float] = {}
    turns: dict[str, Pose] = {}
    for name, node in positions.items():
        joint = joints.get(name)
        if joint is None:
            raise source.complain(node, f"there is no joint '{name}'{nearest(name, joints)}")
        if joint.kind not in ("revolute", "continuous", "prismatic"):
            why = f"only joints with one position are read; {joint.kind} is '{name}'"
            raise source.complain(node, why)
        (position,) = source.numbers(node, 1)
        at[name] = position
        if joint.kind == "prismatic":
            turns[joint.child] = Pose(vector(part * position for part in joint.axis))
        else:
            there = Pose(joint.pose.position)
            turns[joint.child] = there @ turn(joint.axis, position) @ there.inverse()
    if not turns:
        return model, {}
    parents = {joint.child: joint.parent for joint in model.joints}
    moved: dict[str, Pose] = {WORLD: HERE}

    def place(link: str) -> Pose:
        if link not in moved:
            base = place(parents[link]) if link in parents else HERE
            moved[link] = base @ turns.get(link, HERE)
        return moved[link]

    links = tuple(_moved_link(link, place(link.name)) for link in model.links)
    turned = (_moved_joint(one, place(one.child), at.get(one.name, 0.0)) for one in model.joints)
    return replace(model, links=links, joints=tuple(turned)), moved


def _moved_link(link: Link, by: Pose) -> Link:
    if by == HERE:
        return link
    inertia = None if link.inertia is None else replace(link.inertia, pose=by @ link.inertia.pose)
    collisions = tuple(replace(one, pose=by @ one.pose) for one in link.collisions)
    visuals = tuple(replace(one, pose=by @ one.pose) for one in link.visuals)
    return replace(
        link, pose=by @ link.pose, inertia=inertia, collisions=collisions, visuals=visuals
    )


def _moved_joint(joint: Joint, by: Pose, position: float = 0.0) -> Joint:
    """`joint` moved with its child, which stands at `position` now: limits are relative to that."""
    second = None if joint.axis2 is None else by.rotate(joint.axis2)
    lower = joint.lower - position
    upper = joint.upper - position
    return replace(
        joint,
        pose=by @ joint.pose,
        axis=by.rotate(joint.axis),
        axis2=second,
        lower=lower,
        upper=upper,
    )


def _hung_from(link: str, joints: list[Joint]) -> list[Joint]:
    """The joints of a model that hangs from `link`: those between that and the root turn the other
    way round.
    """
    holding = {joint.child: joint for joint in joints if joint.parent != WORLD}
    turned = {}
    while link in holding:
        joint = holding.pop(link)
        x, y, z = joint.axis
        turned[joint.name] = replace(joint, parent=link, child=joint.parent, axis=(-x, -y, -z))
        if joint.axis2 is not None:
            a, b, c = joint.axis2
            turned[joint.name] = replace(turned[joint.name], axis=(-a, -b, -c), axis2=(-x, -y, -z))
        link = joint.parent
    return [turned.get(joint.name, joint) for joint in joints]


def _holds(model: Model, link: str) -> bool:
    """Whether `link` never moves."""
    return model.static or link in held_with(model, WORLD)
