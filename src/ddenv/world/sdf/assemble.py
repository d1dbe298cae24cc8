"""Assembles a model from its links and joints and those of its nested models, at the poses that
`<state>` gives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from ddenv.world.model import Joint, Link, Model, is_ground, still_links
from ddenv.world.pose import ONE, Pose, Vector, vector
from ddenv.world.sdf.casters import without_ball_joints
from ddenv.world.sdf.context import MOST_MODELS, Context, note_unread
from ddenv.world.sdf.frames import WORLD, Scope, pose_of
from ddenv.world.sdf.includes import Part
from ddenv.world.sdf.joints import LinkPose, Spot, check_tree, read_joints
from ddenv.world.sdf.links import read_link
from ddenv.world.sdf.xml import Element, complain, floats, name_of, numbers, text_of, truth

# Maximum speed of a link at rest in `<state>`, m/s and rad/s.
STILL = 0.01
# Smallest difference between `<state>` and a model's own pose that counts as a move, m and sine of
# half the angle.
MOVED = 0.001


@dataclass(frozen=True, kw_only=True)
class Saved:
    """The entry of one model in `<state>`; empty for the `element` of a model without one.

    Poses are in the world frame.
    """

    element: Element
    pose: Pose | None = None
    scale: Vector = ONE
    links: dict[str, Pose] = field(default_factory=dict)
    models: dict[str, Saved] = field(default_factory=dict)


def assemble(part: Part, name: str, outer: Scope, entry: Element | None, context: Context) -> Model:
    """The model of `part`, called by the unique `name`, with its `entry` in `<state>`. Raises
    UserError, also TooFar.
    """
    context.model = name
    saved = Saved(element=part.at) if entry is None else _saved(entry, context)
    nominal = outer.placed(part)
    actual = nominal if saved.pose is None else saved.pose
    spot = Spot(scope=outer.inside(part), nominal=nominal, actual=actual, static=_is_static(part))
    _check_has_link(part, spot.scope)
    builder = _Builder(context)
    builder.add(spot, saved)
    is_empty = not builder.links
    if is_empty:
        context.note("ignored", part.element, "it has no <link>: nothing can touch it")
        builder.links.append(
            Link(name="link", pose=actual, inertia=None, collisions=(), visuals=())
        )
    if entry is not None:
        _note_move(list(builder.poses.values()), saved, context)
    pulled = [truth(link, "gravity", True) for link in builder.elements]
    model = Model(
        name=name,
        pose=actual,
        static=spot.static,
        links=tuple(builder.links),
        joints=tuple(builder.joints),
        spans=tuple((one.start, one.end) for one in (part.at, entry) if one is not None),
        line=part.at.line,
        gravity=spot.static or any(pulled),
        self_collide=any(builder.self_collide),
    )
    if is_empty or len(still_links(model)) == len(model.links):
        return still(model)
    check_tree(builder.joints, part.element)
    # These settings differ between links, but are simulated for the model as a whole.
    if any(pulled) and not all(pulled):
        light = next(builder.elements[pulled.index(False)].iter("gravity"))
        context.note("ignored", light, "gravity acts on all links of a model or on none")
    if any(builder.self_collide) and not all(builder.self_collide):
        context.note(
            "replaced", part.element, "self-collision of some links by self-collision of all links"
        )
    if not is_ground(model):
        return without_ball_joints(model, part.element, context)
    context.note("replaced", part.element, "static, since ground does not move")
    return still(model)


def still(model: Model) -> Model:
    """`model`, static."""
    links = tuple(replace(link, inertia=None) for link in model.links)
    return replace(model, static=True, links=links, joints=(), gravity=True)


class _Builder:
    """Collects the links and joints of a model and of its nested models.

    `elements` and `self_collide` have one entry per link, in the same order.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self.links: list[Link] = []
        self.joints: list[Joint] = []
        self.elements: list[Element] = []
        self.self_collide: list[bool] = []
        self.poses: dict[str, LinkPose] = {}

    def add(self, spot: Spot, saved: Saved) -> None:
        """Adds everything in the model at `spot`, whose entry in `<state>` is `saved`. Raises
        UserError.
        """
        scope = spot.scope
        self.context.assembled += 1
        if self.context.assembled > MOST_MODELS:
            why = f"there are more than {MOST_MODELS} models, including nested and included ones"
            raise complain(scope.element, why)
        note_unread(scope.element, self.context)
        if saved.scale != ONE:
            spot = replace(spot, scale=saved.scale)
        collide = truth(scope.element, "self_collide", False)
        for element in scope.element.findall("link"):
            self._add_link(element, spot, saved)
            self.self_collide.append(truth(element, "self_collide", collide))
        for part in scope.parts:
            self._add_part(part, spot, saved)
        if not spot.static:
            self.joints += read_joints(spot, self.poses, self.context)
        known = {name_of(link) for link in scope.element.findall("link")}
        known |= {part.name for part in scope.parts}
        for name in (*saved.links, *saved.models):
            if name not in known:
                self.context.note("ignored", saved.element, f"the model has no '{name[:80]}'")

    def _add_link(self, element: Element, spot: Spot, saved: Saved) -> None:
        own = name_of(element)
        name = spot.prefix + own
        if own == WORLD:
            raise complain(element, "the name 'world' is reserved by SDF; choose another")
        if name in self.poses:
            raise complain(
                element, "this link name is used twice; give each link of the model its own name"
            )
        local = spot.scope.place(element)
        there = saved.links.get(own, spot.actual @ local)
        self.poses[name] = LinkPose(spot.nominal @ local, there)
        self.elements.append(element)
        self.links.append(read_link(element, spot, self.context, there, local))

    def _add_part(self, part: Part, spot: Spot, outer: Saved) -> None:
        local = spot.scope.placed(part)
        saved = outer.models.get(part.name, Saved(element=part.at))
        there = spot.actual @ local if saved.pose is None else saved.pose
        before = len(self.links)
        prefix = spot.prefix if part.merged else f"{spot.prefix}{part.name}::"
        static = spot.static or (_is_static(part) and not part.merged)
        inner = spot.scope.inside(part)
        _check_has_link(part, inner)
        self.add(
            Spot(
                scope=inner,
                nominal=spot.nominal @ local,
                actual=there,
                prefix=prefix,
                scale=spot.scale,
                static=static,
            ),
            saved,
        )
        if static and not spot.static:
            # A static model nested in a moving one: its links are welded to the world.
            links = self.links[before:]
            self.joints += [
                Joint(
                    name=f"{link.name} (static)",
                    kind="fixed",
                    parent=WORLD,
                    child=link.name,
                    pose=link.pose,
                )
                for link in links
            ]


def _check_has_link(part: Part, scope: Scope) -> None:
    """Raises UserError for a model that has none, except a static one (of a plugin), and one that
    holds other models.
    """
    if not scope.parts and scope.element.find("link") is None and not _is_static(part):
        raise complain(part.element, "has no <link>")


def _is_static(part: Part) -> bool:
    if part.static is None:
        return truth(part.element, "static", False)
    return part.static


def _note_move(poses: list[LinkPose], saved: Saved, context: Context) -> None:
    farthest = max(
        (math.dist(pose.nominal.position, pose.actual.position) for pose in poses), default=0.0
    )
    turns = [math.hypot(*(pose.nominal.inverse() @ pose.actual).quaternion[1:]) for pose in poses]
    if farthest > MOVED or max(turns, default=0.0) > MOVED:
        how = f"{farthest:.2f} m away" if farthest > MOVED else "turned"
        context.note("replaced", saved.element, "its own <pose> by the one in <state>", how)
    if saved.scale != ONE:
        scale = " ".join(f"{part:g}" for part in saved.scale)
        context.note("replaced", saved.element, f"its sizes by those with <scale> {scale}")


def state_entries(world: Element) -> dict[str, list[Element]]:
    """The entries of models in the world's `<state>`, by name, in the file's order. Raises
    UserError.
    """
    states = world.findall("state")
    if len(states) > 1:
        raise complain(states[1], "a second <state>; a world may have only one")
    entries: dict[str, list[Element]] = {}
    if not states:
        return entries
    for tag in ("insertions", "deletions"):
        child = states[0].find(tag)
        if child is not None and len(child):
            raise complain(child, f"<{tag}> in <state> is not supported; save the world without it")
    for model in states[0].findall("model"):
        entries.setdefault(name_of(model), []).append(model)
    return entries


def _saved(model: Element, context: Context) -> Saved:
    scale = model.find("scale")
    factors = ONE if scale is None else vector(numbers(scale, 3))
    if scale is not None and (min(factors) < 1e-6 or max(factors) > 1e6):
        raise complain(scale, f"a scale must be from 1e-06 to 1e+06, found '{text_of(scale)[:60]}'")
    for velocity in model.findall("link/velocity"):
        if any(abs(part) > STILL for part in floats(velocity)):
            context.note("ignored", velocity, "every run starts at rest")
    links = {
        name_of(link): pose for link in model.findall("link") if (pose := _pose(link)) is not None
    }
    models = {name_of(inner): _saved(inner, context) for inner in model.findall("model")}
    return Saved(element=model, pose=_pose(model), scale=factors, links=links, models=models)


def _pose(holder: Element) -> Pose | None:
    element = holder.find("pose")
    if element is None or not text_of(element):
        return None
    return pose_of(element)
