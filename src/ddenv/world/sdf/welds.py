"""The world that Drake's model directives make: each model at the place where Drake puts it, and what is welded to what.

A model that is welded to the world, or to what does not move, is a model of its own, tied to what carries it. A model that is
welded to one that can move is one body with that, and so a part of it.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from ddenv.schemas import nearest
from ddenv.world.model import Joint, Link, Model, World, held_with
from ddenv.world.pose import HERE, Pose
from ddenv.world.sdf.assemble import assemble
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.directives import (
    FILTERS,
    WORLD,
    WORLD_INSTANCE,
    AddDirectives,
    AddFrame,
    AddModel,
    AddModelInstance,
    AddWeld,
    Directive,
    opened,
)
from ddenv.world.sdf.frames import Scope
from ddenv.world.sdf.includes import included
from ddenv.world.sdf.joints import check_tree, link_of
from ddenv.world.sdf.urdf import is_urdf, without_mass
from ddenv.world.sdf.xml import Element

GRAVITY = (0.0, 0.0, -9.81)  # Drake's default, m/s^2
OWN_FRAME = "__model__"
VERSION = "model directives"


@dataclass(frozen=True)
class Frame:
    """A frame that is fixed to `link` of `model`, at `pose` where the model's own file puts that; the world if both are empty.

    Without any of the `owners` there is no such frame.
    """

    model: str = ""
    link: str = ""
    pose: Pose = HERE
    owners: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Fixing:
    """What places a model: its frame `own` stands at `pose` in the frame `base`, by a weld or as a free body.

    `root` is the link that all others of the model hang on.
    """

    own: Frame
    base: Frame
    pose: Pose
    directive: Directive
    weld: bool
    root: str = ""


@dataclass
class _Builder:
    """The models, frames and welds so far, by the names that Drake gives them."""

    context: Context
    models: dict[str, Model] = field(default_factory=dict)
    elements: dict[str, Element] = field(default_factory=dict)
    scopes: dict[int, Scope] = field(default_factory=dict)
    frames: dict[str, Frame] = field(default_factory=lambda: {f"{WORLD_INSTANCE}::{WORLD}": Frame()})
    instances: set[str] = field(default_factory=lambda: {WORLD_INSTANCE})
    fixings: dict[str, Fixing] = field(default_factory=dict)
    spans: dict[str, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))
    places: dict[str, Pose | None] = field(default_factory=dict)
    finished: dict[str, Model] = field(default_factory=dict)
    # By model: the one that it is a part of, and the joint that holds it there.
    carriers: dict[str, tuple[str, Joint]] = field(default_factory=dict)
    ties: dict[tuple[str, str], None] = field(default_factory=dict)
    anchors: set[str] = field(default_factory=set)

    def take(self, one: Directive) -> None:
        """Adds what `one` says. Raises UserError."""
        match one.value:
            case AddModel():
                self._add_model(one, one.value)
            case AddModelInstance(name=name):
                self._claim(name, one)
            case AddFrame():
                self._add_frame(one, one.value)
            case AddWeld():
                self._add_weld(one, one.value)
            case AddDirectives(model_namespace=name):
                if name and name not in self.instances:
                    raise one.complain(f"there is no model instance '{name[:80]}' for the namespace")

    def _claim(self, name: str, one: Directive) -> None:
        if name in self.instances or name == "DefaultModelInstance":
            raise one.complain(f"the model '{name[:80]}' is added twice")
        self.instances.add(name)

    def _add_model(self, one: Directive, value: AddModel) -> None:
        name = value.name
        self._claim(name, one)
        include, uri = (_element(tag, one.path, one.line, one.span) for tag in ("add_model", "uri"))
        uri.text = value.file
        include.set("name", name)
        include.append(uri)
        self.context.model = name
        part = included(include, (one.path,), self.context)
        self.context.model = ""
        if part is None:
            return
        part = replace(part, name=name)
        outer = Scope(_element(WORLD, one.path), (one.path,), self.context, self.scopes)
        model = assemble(part, name, outer, None, self.context)
        model, turned = _at_positions(without_mass(model, part.element), value, one)
        self.models[name], self.elements[name] = model, include
        self.spans[name].append(one.span)
        for own, pose, link in _frames(outer.inside(part), outer.placed(part), "", self.context):
            if own == OWN_FRAME and is_urdf(part.element):
                continue
            self.frames[f"{name}::{own}"] = Frame(name, link, turned.get(link, HERE) @ pose, frozenset([name]))
            self.instances.add(f"{name}::{own}".rpartition("::")[0])
        for body, there in value.default_free_body_pose.items():
            frame = self.frames.get(f"{name}::{body}")
            if frame is None or "::" in body:
                raise one.complain(f"there is no body '{body[:80]}' in '{name[:80]}'")
            base = Frame() if there.base_frame is None else self._frame(there.base_frame, one)
            self._fix(Fixing(frame, base, there.pose, one, weld=False))

    def _frame(self, name: str, one: Directive) -> Frame:
        """The frame called `name`. Raises UserError."""
        if "::" in name:
            found = [name] if name in self.frames else []
        else:
            found = [each for each in self.frames if each.rpartition("::")[2] == name]
        if not found:
            near = nearest(name[:80], list(self.frames)[:500])
            raise one.complain(f"there is no frame '{name[:80]}' here{near}")
        if len(found) > 1:
            raise one.complain(f"'{name[:80]}' may be {' or '.join(found[:3])}")
        return self.frames[found[0]]

    def _add_frame(self, one: Directive, value: AddFrame) -> None:
        if value.X_PF.base_frame is None:
            raise one.complain("X_PF: base_frame is missing")
        there = self._frame(value.X_PF.base_frame, one)
        instance, _, last = value.name.rpartition("::")
        owners = there.owners
        if instance:
            if instance not in self.instances:
                raise one.complain(f"there is no model instance '{instance[:80]}'")
            words = instance.split("::")
            owners |= {name for end in range(len(words)) if (name := "::".join(words[: end + 1])) in self.models}
        else:
            inner = there.link.rpartition("::")[0]
            instance = "::".join(each for each in (there.model or WORLD_INSTANCE, inner) if each)
        full = f"{instance}::{last}"
        if full in self.frames:
            raise one.complain(f"there already is a frame '{full[:80]}'")
        self.frames[full] = Frame(there.model, there.link, there.pose @ value.X_PF.pose, owners)
        for owner in owners:
            self.spans[owner].append(one.span)

    def _add_weld(self, one: Directive, value: AddWeld) -> None:
        parent, child = self._frame(value.parent, one), self._frame(value.child, one)
        if not child.model:
            raise one.complain("the world cannot be welded to a model; make it the parent")
        self._fix(Fixing(child, parent, value.X_PC.pose, one, weld=True))
        for owner in child.owners:
            self.spans[owner].append(one.span)

    def _fix(self, fixing: Fixing) -> None:
        name, link = fixing.own.model, fixing.own.link
        model, before = self.models[name], self.fixings.get(name)
        if model.static or any(joint.parent == WORLD for joint in model.joints):
            raise fixing.directive.complain(f"'{name[:80]}' is fixed to the world by its own file")
        if before is not None and (before.weld or not fixing.weld or before.base.model):
            raise fixing.directive.complain(f"'{name[:80]}' is placed twice")
        hung = {joint.child for joint in model.joints}
        first, *others = (each.name for each in model.links if each.name not in hung)
        if others:
            raise fixing.directive.complain(f"'{name[:80]}' has parts that no joint connects; add each as a model")
        # A weld of a link that others hold would turn their joints round; what is fixed to the first one moves with it.
        if link not in held_with(model, first):
            raise fixing.directive.complain(f"'{link[:80]}' hangs on a joint; only '{first[:80]}' can be placed")
        self.fixings[name] = replace(fixing, root=first)

    # Where all of it is.

    def _place(self, name: str) -> Pose:
        """How far a model moves from the place where its own file puts it. Raises UserError."""
        fixing = self.fixings.get(name)
        if fixing is None:
            return HERE
        if name not in self.places:
            self.places[name] = None
            self.places[name] = self._pose(fixing.base) @ fixing.pose @ fixing.own.pose.inverse()
        place = self.places[name]
        if place is None:
            raise fixing.directive.complain(f"the place of '{name[:80]}' depends on itself")
        return place

    def _pose(self, frame: Frame) -> Pose:
        """The pose of `frame` in the world."""
        return self._place(frame.model) @ frame.pose if frame.model else frame.pose

    def finish(self, name: str) -> Model:
        """The model `name` at its place, with its weld to what does not move. Raises UserError."""
        if name not in self.finished:
            self.finished[name] = self._finished(name)
        return self.finished[name]

    def _finished(self, name: str) -> Model:
        model, fixing, place = self.models[name], self.fixings.get(name), self._place(name)
        joints = [_moved_joint(joint, place) for joint in model.joints]
        if fixing is not None:
            others = dict.fromkeys((name, other) for other in sorted((fixing.own.owners | fixing.base.owners) - {name}))
            if fixing.weld:
                self.ties |= others
                joints += self._welds(name, fixing)
            else:
                self.anchors |= {other for _, other in others}
        links = tuple(_moved_link(link, place) for link in model.links)
        model = replace(
            model, pose=place @ model.pose, links=links, joints=tuple(joints), spans=tuple(self.spans[name])
        )
        if name not in self.carriers and not model.static and all(_holds(model, link.name) for link in links):
            bare = tuple(replace(link, inertia=None) for link in links)
            return replace(model, static=True, links=bare, joints=(), gravity=True)
        return model

    def _welds(self, name: str, fixing: Fixing) -> list[Joint]:
        """The weld of a model to the world or to what does not move; what is welded to something that can move gets a carrier."""
        base, at = fixing.base, fixing.root
        if not base.model or _holds(self.finish(base.model), base.link):
            return [Joint(f"{at} (weld)", "fixed", WORLD, at, self._pose(base))]
        outer, parent = base.model, base.link
        if outer in self.carriers:
            outer, parent = self.carriers[outer][0], f"{outer}::{parent}"
        at = f"{name}::{at}"
        self.carriers[name] = outer, Joint(f"{at} (weld)", "fixed", parent, at, self._pose(base))
        return []

    def all(self) -> tuple[Model, ...]:
        """The models in the order of their directives, each with those that are parts of it. Raises UserError."""
        made = {name: self.finish(name) for name in self.models}
        for name, (outer, weld) in self.carriers.items():
            part, whole = made.pop(name), made[outer]
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
                links=(*whole.links, *(replace(link, name=f"{name}::{link.name}") for link in part.links)),
                joints=(*whole.joints, *joints, weld),
                spans=(*whole.spans, *part.spans),
            )
        for name, model in made.items():
            if not model.static:
                check_tree(list(model.joints), self.elements[name])
        return tuple(made.values())

    def carrier(self, name: str) -> str:
        """The model that `name` is a part of: itself, unless it is welded to one that can move."""
        return self.carriers[name][0] if name in self.carriers else name


def parse_directives(text: bytes, path: Path, context: Context) -> World:
    """The world that the directives in `text`, the content of `path`, make. Raises UserError with file and line.

    Its text has all of them, a line each, with those of the files that they open in place of `add_directives`.
    """
    directives, joint_text = opened(text, path, context)
    builder = _Builder(context)
    for one in directives:
        builder.take(one)
    models = builder.all()
    context.complain_of_missing()
    if any(isinstance(one.value, AddDirectives) for one in directives):
        # Again, for the places in that text; what is wrong was said with the places in the files.
        filters = [note for note in context.notes if note.what == FILTERS]
        return parse_directives(joint_text, path, Context(context.resources, context.reading, filters))
    context.note_unused(_element(WORLD, path))
    ties = ((builder.carrier(name), builder.carrier(other)) for name, other in builder.ties)
    return World(
        path=path,
        name=path.name.split(".")[0],
        text=joint_text,
        gravity=GRAVITY,
        models=models,
        version=VERSION,
        notes=tuple(context.notes),
        anchors=frozenset(map(builder.carrier, builder.anchors)),
        resources=context.resources.taken,
        ties=tuple(dict.fromkeys((name, other) for name, other in ties if name != other)),
    )


def _element(tag: str, path: Path, line: int = 1, span: tuple[int, int] = (0, 0)) -> Element:
    """An element at the place of a directive, for all that reads SDF."""
    made = Element(tag)
    made.source, made.line, (made.start, made.end), made.parent = path, line, span, None
    return made


def _frames(scope: Scope, here: Pose, prefix: str, context: Context) -> Iterator[tuple[str, Pose, str]]:
    """The links and frames of a model and of those inside it: name, pose where the file puts it, and link."""
    named = [name for name, one in scope.named.items() if isinstance(one, Element) and one.tag in ("link", "frame")]
    for name in (OWN_FRAME, *named):
        link = link_of(scope, name, scope.element, context)
        if link is not None:
            yield prefix + name, here @ scope.pose(name, scope.element), prefix + link
    for part in scope.parts:
        yield from _frames(scope.inside(part), here @ scope.placed(part), f"{prefix}{part.name}::", context)


def _at_positions(model: Model, value: AddModel, one: Directive) -> tuple[Model, dict[str, Pose]]:
    """`model` with joints at their positions, and how far each link moves. Raises UserError."""
    joints = {joint.name: joint for joint in model.joints}
    turns: dict[str, tuple[float, Pose]] = {}
    for name, (at,) in value.default_joint_positions.items():
        joint = joints.get(name)
        if joint is None or joint.kind not in ("revolute", "continuous", "prismatic"):
            near = nearest(name[:80], list(joints)[:500])
            raise one.complain(f"there is no joint '{name[:80]}' with one position{near}")
        x, y, z = joint.axis
        if joint.kind == "prismatic":
            turns[joint.child] = at, Pose((x * at, y * at, z * at))
        else:
            sine, there = math.sin(at / 2), Pose(joint.pose.position)
            turn = Pose((0.0, 0.0, 0.0), (math.cos(at / 2), x * sine, y * sine, z * sine))
            turns[joint.child] = at, there @ turn @ there.inverse()
    if not turns:
        return model, {}
    parents = {joint.child: joint.parent for joint in model.joints}
    moved: dict[str, Pose] = {WORLD: HERE}

    def place(link: str) -> Pose:
        if link not in moved:
            moved[link] = (place(parents[link]) if link in parents else HERE) @ turns.get(link, (0.0, HERE))[1]
        return moved[link]

    links = tuple(_moved_link(link, place(link.name)) for link in model.links)
    new = (_moved_joint(joint, place(joint.child), turns.get(joint.child, (0.0, HERE))[0]) for joint in model.joints)
    return replace(model, links=links, joints=tuple(new)), moved


def _moved_link(link: Link, by: Pose) -> Link:
    if by == HERE:
        return link
    inertia = None if link.inertia is None else replace(link.inertia, pose=by @ link.inertia.pose)
    collisions = tuple(replace(one, pose=by @ one.pose) for one in link.collisions)
    visuals = tuple(replace(one, pose=by @ one.pose) for one in link.visuals)
    return replace(link, pose=by @ link.pose, inertia=inertia, collisions=collisions, visuals=visuals)


def _moved_joint(joint: Joint, by: Pose, position: float = 0.0) -> Joint:
    """`joint` moved with its child, which stands at `position` now: limits are relative to that."""
    second = None if joint.axis2 is None else by.rotate(joint.axis2)
    lower, upper = joint.lower - position, joint.upper - position
    return replace(joint, pose=by @ joint.pose, axis=by.rotate(joint.axis), axis2=second, lower=lower, upper=upper)


def _holds(model: Model, link: str) -> bool:
    """Whether `link` never moves."""
    return model.static or link in held_with(model, WORLD)
