"""Puts a model together: its links and joints and those of the models nested in it, as `<state>` has them."""

from __future__ import annotations

import math
from dataclasses import replace

from ddenv.world.model import Joint, Link, Model, is_ground
from ddenv.world.pose import Pose, Vector
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.frames import WORLD, Scope
from ddenv.world.sdf.geometry import ONE
from ddenv.world.sdf.joints import Stand, check_tree, read_joints
from ddenv.world.sdf.links import Site, read_link
from ddenv.world.sdf.parts import Part
from ddenv.world.sdf.state import Saved
from ddenv.world.sdf.unread import note_unread
from ddenv.world.sdf.xml import Element, complain, name_of, truth

# A model that `<state>` has less than this from its own pose has not been moved, m.
MOVED = 0.001
# A few files that include each other many times can ask for more models than any machine holds.
MOST_MODELS = 50_000


def assemble(part: Part, name: str, outer: Scope, saved: Saved | None, context: Context) -> Model:
    """The model of `part`, under the unique `name`. Raises UserError."""
    context.model = name
    scope = outer.inside(part)
    nominal = outer.placed(part)
    static = truth(part.element, "static", False) if part.static is None else part.static
    builder = _Builder(static, context)
    actual = nominal if saved is None or saved.pose is None else saved.pose
    builder.add(scope, nominal, actual, "", saved)
    if not builder.links:
        raise complain(part.element, "has no <link>")
    _note_move(next(iter(builder.stands.values())), saved, context)
    spans = [(part.at.start, part.at.end)]
    if saved is not None:
        spans.append((saved.element.start, saved.element.end))
    elements = builder.elements
    model = Model(
        name=name,
        pose=actual,
        static=static,
        links=tuple(builder.links),
        joints=tuple(builder.joints),
        spans=tuple(spans),
        line=part.at.line,
        gravity=static or any(truth(link, "gravity", True) for link in elements),
        self_collide=truth(part.element, "self_collide", any(truth(link, "self_collide", False) for link in elements)),
    )
    if static:
        return model
    check_tree(builder.joints, part.element)
    _note_gravity(elements, context)
    return _held(model, part.element, context) if is_ground(model) else model


class _Builder:
    """Collects the links and joints of a model from its `<model>` and those inside it."""

    def __init__(self, static: bool, context: Context) -> None:
        self.static = static
        self.context = context
        self.links: list[Link] = []
        self.joints: list[Joint] = []
        self.elements: list[Element] = []
        self.stands: dict[str, Stand] = {}

    def add(
        self, scope: Scope, nominal: Pose, actual: Pose, prefix: str, saved: Saved | None, scale: Vector = ONE
    ) -> None:
        """Adds what is in `scope`, whose frame is nominally at one pose in the world and actually at another."""
        self.context.assembled += 1
        if self.context.assembled > MOST_MODELS:
            raise complain(
                scope.element, f"there are more than {MOST_MODELS} models, with those that are nested or included"
            )
        note_unread(scope.element, self.context)
        scale = scale if saved is None or saved.scale == ONE else saved.scale
        for element in scope.element.findall("link"):
            self._add_link(element, scope, nominal, actual, prefix, saved, scale)
        for part in scope.parts:
            self._add_part(part, scope, nominal, actual, prefix, saved, scale)
        if not self.static:
            self.joints += read_joints(scope, nominal, prefix, self.stands, self.context)

    def _add_link(self, element, scope, nominal, actual, prefix, saved, scale) -> None:
        own = name_of(element)
        name = prefix + own
        if own == WORLD:
            raise complain(element, "'world' is a name that SDF keeps for the world itself; give it another")
        if name in self.stands:
            raise complain(element, "this name stands twice; every link of a model needs a name of its own")
        local = scope.place(element)
        stand = Stand(nominal @ local, actual @ local)
        if saved is not None and own in saved.links:
            stand = Stand(stand.nominal, saved.links[own])
        self.stands[name] = stand
        self.elements.append(element)
        site = Site(name, stand.actual, local, scale, not self.static)
        self.links.append(read_link(element, scope, site, self.context))

    def _add_part(self, part, scope, nominal, actual, prefix, saved, scale) -> None:
        local = scope.placed(part)
        inner = None if saved is None else saved.models.get(part.name)
        there = actual @ local if inner is None or inner.pose is None else inner.pose
        before = len(self.links)
        self.add(scope.inside(part), nominal @ local, there, f"{prefix}{part.name}::", inner, scale)
        fixed = truth(part.element, "static", False) if part.static is None else part.static
        if fixed and not self.static:
            self._hold(self.links[before:], part)

    def _hold(self, links: list[Link], part: Part) -> None:
        """Welds the links of a static model, nested in one that moves, to the world."""
        self.joints = [joint for joint in self.joints if joint.child not in {link.name for link in links}]
        free = float("inf")
        for link in links:
            self.joints.append(
                Joint(
                    f"{link.name} (static)",
                    "fixed",
                    WORLD,
                    link.name,
                    link.pose,
                    (0.0, 0.0, 1.0),
                    -free,
                    free,
                    free,
                    free,
                    0.0,
                )
            )


def _held(model: Model, element: Element, context: Context) -> Model:
    """A ground that the file lets move: simulators never do."""
    context.note("replaced", element, "static, since an infinite plane does not move")
    links = tuple(replace(link, inertia=None) for link in model.links)
    return replace(model, static=True, links=links, joints=())


def _note_move(first_link: Stand, saved: Saved | None, context: Context) -> None:
    if saved is None:
        return
    way = math.dist(first_link.nominal.position, first_link.actual.position)
    if way > MOVED:
        context.note("replaced", saved.element, "its own <pose> by the one in <state>", f"{way:.2f} m away")
    if saved.scale != ONE:
        scale = " ".join(f"{part:g}" for part in saved.scale)
        context.note("replaced", saved.element, f"its sizes by those that <scale> {scale} gives")


def _note_gravity(elements: list[Element], context: Context) -> None:
    pulled = [truth(link, "gravity", True) for link in elements]
    if any(pulled) and not all(pulled):
        light = elements[pulled.index(False)]
        context.note("ignored", light.find("gravity"), "gravity acts on all links of a model, or on none")
