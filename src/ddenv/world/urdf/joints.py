"""The `<joint>`s of URDF, which also say where the links are."""

from __future__ import annotations

from ddenv.schemas import nearest
from ddenv.world.sdf.xml import Element, complain, name_of
from ddenv.world.urdf.elements import element, given, three, twin

KINDS = ("fixed", "revolute", "continuous", "prismatic")
LIMITED = ("revolute", "prismatic")
# URDF's own defaults. Not to be limited at all is a joint of another kind.
LIMITS = {"lower": "0", "upper": "0"}


def ends(joint: Element, links: list[str]) -> tuple[str, str]:
    """The names of the parent and the child link of `joint`. Raises UserError."""
    found = []
    for tag in ("parent", "child"):
        end = joint.find(tag)
        if end is None:
            raise complain(joint, f"has no <{tag}>")
        name = given(end, "link")
        if name not in links:
            raise complain(end, f"there is no link '{name[:80]}'{nearest(name[:80], links[:500])}")
        found.append(name)
    return found[0], found[1]


def joint_of(source: Element, parent: str, child: str) -> Element:
    """The SDF joint. Raises UserError."""
    kind = (source.get("type") or "").strip()
    if kind not in KINDS:
        raise complain(source, f"joint type '{kind[:40]}' is not supported (only {', '.join(KINDS)})")
    made = twin(source, name=name_of(source), type=kind)
    made.extend([element("parent", source, parent), element("child", source, child)])
    if kind != "fixed":
        made.append(_axis(source, kind))
    return made


def _axis(source: Element, kind: str) -> Element:
    given_axis, limit, dynamics = source.find("axis"), source.find("limit"), source.find("dynamics")
    if kind in LIMITED and limit is None:
        raise complain(source, f"a {kind} joint needs a <limit>")
    place = source if given_axis is None else given_axis
    made = element("axis", source)
    made.append(element("xyz", place, "1 0 0" if given_axis is None else three(given_axis, "xyz", "1 0 0")))
    if limit is not None:
        made.append(_limit(limit, kind))
    if dynamics is not None:
        damped = twin(dynamics)
        damped.append(element("damping", dynamics, dynamics.get("damping", "0")))
        made.append(damped)
    return made


def _limit(source: Element, kind: str) -> Element:
    made = twin(source)
    for tag, default in LIMITS.items() if kind in LIMITED else ():
        made.append(element(tag, source, source.get(tag, default)))
    made.extend([element(tag, source, source.get(tag)) for tag in ("effort", "velocity") if source.get(tag)])
    return made
