"""`<state>`: where Gazebo Classic saved its models, links and scales. Its poses are absolute and win over all others."""

from __future__ import annotations

from dataclasses import dataclass, field

from ddenv.world.pose import ONE, Pose, Vector
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.frames import pose_of
from ddenv.world.sdf.xml import Element, complain, floats, name_of, numbers, text_of

# A model that moved faster than this when the world was saved did not stand still, m/s and rad/s.
STILL = 0.01


@dataclass(frozen=True)
class Saved:
    """What `<state>` says of one model; poses are in the world frame, and of the links that it names."""

    element: Element
    pose: Pose | None = None
    scale: Vector = ONE
    links: dict[str, Pose] = field(default_factory=dict)
    models: dict[str, Saved] = field(default_factory=dict)


def read_state(world: Element, context: Context) -> dict[str, list[Saved]]:
    """What the world's `<state>` says of its models, by name, in the file's order. Raises UserError."""
    states = world.findall("state")
    if len(states) > 1:
        raise complain(states[1], "a second <state>; a world has one")
    saved: dict[str, list[Saved]] = {}
    if not states:
        return saved
    for tag in ("insertions", "deletions"):
        child = states[0].find(tag)
        if child is not None and len(child):
            raise complain(child, f"<{tag}> in a <state> are not supported; save the world again without them")
    for model in states[0].findall("model"):
        saved.setdefault(name_of(model), []).append(_saved(model, context))
    return saved


def _saved(model: Element, context: Context) -> Saved:
    scale = model.find("scale")
    return Saved(
        element=model,
        pose=_pose(model),
        scale=ONE if scale is None else _scale(scale),
        links={name_of(link): pose for link in model.findall("link") if (pose := _still(link, context)) is not None},
        models={name_of(inner): _saved(inner, context) for inner in model.findall("model")},
    )


def _still(link: Element, context: Context) -> Pose | None:
    velocity = link.find("velocity")
    if velocity is not None and any(abs(part) > STILL for part in floats(velocity)):
        context.note("ignored", velocity, "every run begins at rest")
    return _pose(link)


def _pose(holder: Element) -> Pose | None:
    element = holder.find("pose")
    return None if element is None or not text_of(element) else pose_of(element)


def _scale(element: Element) -> Vector:
    values = numbers(element, 3)
    if min(values) < 1e-6 or max(values) > 1e6:
        raise complain(element, f"a scale must be from 1e-06 to 1e+06, found '{text_of(element)[:60]}'")
    return values  # type: ignore[return-value]
