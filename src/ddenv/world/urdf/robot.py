"""A URDF robot as one SDF model, with the same links and joints, fixed ones included."""

from __future__ import annotations

from dataclasses import replace

from ddenv.world.model import Model
from ddenv.world.sdf.context import VERSIONS, Context
from ddenv.world.sdf.xml import Element, complain, name_of
from ddenv.world.urdf.elements import element, pose
from ddenv.world.urdf.joints import ends, joint_of
from ddenv.world.urdf.links import has_mass, link_of

ROOT = "robot"


def to_sdf(robot: Element, context: Context) -> Element:
    """The `<sdf>` for the outermost element of a URDF file, its root link first. Raises UserError."""
    _check_expanded(robot)
    # Nothing like the version of SDF, for which it would be taken.
    robot.attrib.pop("version", None)
    links = {name_of(link): link for link in reversed(robot.findall("link"))}
    if not links:
        raise complain(robot, "has no <link>")
    joints = [(joint, *ends(joint, list(links))) for joint in robot.findall("joint")]
    origins = {child: pose(joint, parent) for joint, parent, child in joints}
    root = _root(robot, list(links), set(origins))
    model = element("model", robot, name=name_of(robot))
    for link in sorted(robot.findall("link"), key=lambda link: name_of(link) != root):
        made = link_of(link, robot, context)
        if name_of(link) in origins:
            made.append(origins[name_of(link)])
        model.append(made)
    model.extend([joint_of(joint, parent, child) for joint, parent, child in joints])
    sdf = element("sdf", robot, version=VERSIONS[-1])
    sdf.append(model)
    return sdf


def massless(robot: Element) -> frozenset[str]:
    """The names of the links without a mass of their own."""
    return frozenset(name_of(link) for link in robot.findall("link") if not has_mass(link))


def without_mass(model: Model, names: frozenset[str]) -> Model:
    """`model` with the links `names` as mere frames: to those the SDF reader gives a mass."""
    links = (replace(link, inertia=None) if link.name in names else link for link in model.links)
    return replace(model, links=tuple(links))


def _check_expanded(robot: Element) -> None:
    for each in robot.iter():
        if "xacro}" in each.tag or any("${" in text or "$(" in text for text in each.attrib.values()):
            raise complain(each, "is xacro, not URDF; run 'xacro FILE > robot.urdf' and name that file")


def _root(robot: Element, links: list[str], children: set[str]) -> str:
    roots = [name for name in reversed(links) if name not in children]
    if len(roots) != 1:
        found = f"found {', '.join(roots[:5])}" if roots else "but joints close a loop"
        raise complain(robot, f"expected one link that is no joint's child, {found}")
    return roots[0]
