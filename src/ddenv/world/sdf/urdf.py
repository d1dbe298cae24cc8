"""Converts a URDF robot to SDF elements: links with mass, shapes, colours and Gazebo's friction,
and joints.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from ddenv.schemas import nearest
from ddenv.world.model import Model
from ddenv.world.sdf.context import VERSIONS, Context, first_macro, refuse_xacro, sdf_root
from ddenv.world.sdf.xml import Element, complain, name_of, numbers, parse, text_of

KINDS = ("fixed", "revolute", "continuous", "prismatic")
LIMITED = ("revolute", "prismatic")
# The attributes of each URDF shape, with the corresponding SDF elements.
SHAPES = {
    "box": {"size": "size"},
    "cylinder": {"radius": "radius", "length": "length"},
    "sphere": {"radius": "radius"},
    "capsule": {"radius": "radius", "length": "length"},
    "mesh": {"filename": "uri"},
}
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
FRICTION = {"mu1": "mu", "mu2": "mu2"}
ROOT = "robot"


def _has_expression(element: Element) -> bool:
    """Whether an attribute has an expression or a substitution of xacro."""
    return any("${" in text or "$(" in text for text in element.attrib.values())


def to_sdf(robot: Element, context: Context) -> Element:
    """The `<sdf>` for a URDF `<robot>`, its root link first. Raises UserError."""
    macro = first_macro(robot)
    if macro is None:
        macro = next(filter(_has_expression, robot.iter()), None)
    if macro is not None:
        raise refuse_xacro(macro, "URDF", "robot.urdf")
    # The reader would take it for an SDF version.
    robot.attrib.pop("version", None)
    links = {name_of(link): link for link in robot.findall("link")}
    if not links:
        raise complain(robot, "has no <link>")
    origins = {}
    joints = []
    for source in robot.findall("joint"):
        parent, child = (_end(source, tag, links) for tag in ("parent", "child"))
        origins[child] = pose(source, parent)
        joints.append(joint_of(source, parent, child))
    roots = [name for name in links if name not in origins]
    if len(roots) != 1:
        found = f"found {', '.join(roots[:5])}" if roots else "but joints close a loop"
        raise complain(robot, f"expected one link that is not the child of a joint, {found}")
    model = element("model", robot, name=name_of(robot))
    for source in sorted(robot.findall("link"), key=lambda link: name_of(link) != roots[0]):
        model.append(link_of(source, robot, context))
        if name_of(source) in origins:
            model[-1].append(origins[name_of(source)])
    model.extend(joints)
    return element("sdf", robot, "", model, version=VERSIONS[-1])


def root_of(text: bytes, path: Path, context: Context) -> Element:
    """The `<sdf>` of an SDF or URDF file. Raises UserError."""
    robot = parse(text, path) if f"<{ROOT}".encode() in text else None
    root = sdf_root(text, path) if robot is None or robot.tag != ROOT else to_sdf(robot, context)
    context.note_tolerance(root, text)
    return root


def is_urdf(element: Element) -> bool:
    """Whether a `<model>` was made of a URDF robot."""
    return element.parent is not None and element.parent.tag == ROOT


def without_mass(model: Model, element: Element) -> Model:
    """`model` with the links that have no mass in its URDF robot as mere frames, since the SDF
    reader gives every link a mass.
    """
    robot = element.parent
    if robot is None or robot.tag != ROOT:
        return model
    names = {name_of(link) for link in robot.findall("link") if not has_mass(link)}
    links = (replace(link, inertia=None) if link.name in names else link for link in model.links)
    return replace(model, links=tuple(links))


def has_mass(link: Element) -> bool:
    """Whether `link` has a mass; many links of robots are only frames. Raises UserError."""
    mass = link.find("inertial/mass")
    return mass is not None and numbers(element("value", mass, given(mass, "value")), 1) != (0.0,)


def link_of(source: Element, robot: Element, context: Context) -> Element:
    """The SDF link for a URDF one, without its pose. Raises UserError."""
    made = twin(source, name=name_of(source))
    inertial = source.find("inertial")
    if inertial is not None and has_mass(source):
        parts = [
            pose(inertial),
            *(element("mass", mass, given(mass, "value")) for mass in inertial.findall("mass")[:1]),
        ]
        for tensor in inertial.findall("inertia")[:1]:
            parts.append(
                twin(tensor, *(element(tag, tensor, given(tensor, tag)) for tag in TENSOR))
            )
        made.append(twin(inertial, *parts))
    for tag in ("collision", "visual"):
        for count, part in enumerate(source.findall(tag)):
            if tag == "collision":
                more = _surface(name_of(source), part, robot)
            else:
                more = _material(part, robot)
            own = part.get("name") or f"{tag}_{count}"
            made.append(twin(part, pose(part), _geometry(part, context), *more, name=own))
    return made


def _geometry(part: Element, context: Context) -> Element:
    source = part.find("geometry")
    if source is None or not len(source):
        raise complain(part, "has no <geometry> with a shape in it")
    shape = source[0]
    if shape.tag not in SHAPES:
        raise complain(shape, f"<{shape.tag}> is not a URDF shape; use one of {', '.join(SHAPES)}")
    made = twin(shape)
    for attribute, tag in SHAPES[shape.tag].items():
        text = given(shape, attribute)
        if tag == "uri" and text.startswith("package://") and context.stand_in(text) is None:
            # It may be in the package that contains the robot's file.
            package, _, rest = text.removeprefix("package://").partition("/")
            folders = (
                folder for folder in shape.source.absolute().parents if folder.name == package
            )
            text = next((str(folder / rest) for folder in folders), text)
        made.append(element(tag, shape, text))
    if shape.tag == "mesh" and shape.get("scale"):
        made.append(element("scale", shape, three(shape, "scale", "")))
    return twin(source, made)


def _surface(link: str, part: Element, robot: Element) -> list[Element]:
    """What says how slippery a collision is: a `<surface>` from `<gazebo reference="link">`, and
    Drake's own properties.
    """
    coefficients = [
        element(ours, found, text_of(found) or given(found, "value"))
        for extension in robot.findall("gazebo")
        for tag, ours in FRICTION.items()
        if (found := extension.find(tag)) is not None and extension.get("reference") == link
    ]
    friction = element("friction", part, "", element("ode", part, "", *coefficients))
    surface = [element("surface", part, "", friction)] if coefficients else []
    return surface + [
        _drake_properties(own) for own in part.findall("drake:proximity_properties")[:1]
    ]


def _drake_properties(own: Element) -> Element:
    """Drake's own properties of a collision, whose values are attributes in URDF and text in
    SDF.
    """
    values = [element(each.tag, each, given(each, "value")) for each in own if each.get("value")]
    return element(own.tag, own, "", *values)


def _material(part: Element, robot: Element) -> list[Element]:
    """The `<material>` of a visual: its own colour, or that of the robot's material of the same
    name.
    """
    own = part.findall("material")[:1]
    named = [
        other
        for one in own
        for other in robot.findall("material")
        if other.get("name") == one.get("name")
    ]
    colors = [color for each in (*own, *named) for color in each.findall("color")[:1]]
    return [twin(own[0], element("diffuse", color, given(color, "rgba"))) for color in colors[:1]]


def _end(joint: Element, tag: str, links: Collection[str]) -> str:
    """The name of the parent or the child link of `joint`. Raises UserError."""
    end = joint.find(tag)
    if end is None:
        raise complain(joint, f"has no <{tag}>")
    name = given(end, "link")
    if name not in links:
        raise complain(end, f"there is no link '{name}'{nearest(name, links)}")
    return name


def joint_of(source: Element, parent: str, child: str) -> Element:
    """The SDF joint for a URDF one. Raises UserError."""
    kind = source.get("type", "").strip()
    if kind not in KINDS:
        raise complain(
            source, f"joint type '{kind[:40]}' is not supported (only {', '.join(KINDS)})"
        )
    ends = element("parent", source, parent), element("child", source, child)
    made = twin(source, *ends, name=name_of(source), type=kind)
    if kind == "fixed":
        return made
    own = source.find("axis")
    limit = source.find("limit")
    dynamics = source.find("dynamics")
    if kind in LIMITED and limit is None:
        raise complain(source, f"a {kind} joint needs a <limit>")
    xyz = "1 0 0" if own is None else three(own, "xyz", "1 0 0")
    axis = element("axis", source, "", element("xyz", source if own is None else own, xyz))
    if limit is not None:
        said = {tag: limit.get(tag, "0") for tag in ("lower", "upper") if kind in LIMITED}
        said |= {tag: text for tag in ("effort", "velocity") if (text := limit.get(tag))}
        axis.append(twin(limit, *(element(tag, limit, text) for tag, text in said.items())))
    if dynamics is not None:
        axis.append(twin(dynamics, element("damping", dynamics, dynamics.get("damping", "0"))))
    made.append(axis)
    return made


def element(
    tag: str, source: Element, text: str = "", *children: Element, **attributes: str
) -> Element:
    """An SDF element with `text` and `children`, at the position of `source` in the file and with
    it as parent.
    """
    made = Element(tag, attributes)
    made.text = text
    made.extend(children)
    made.source = source.source
    made.line = source.line
    made.start = source.start
    made.end = source.end
    made.parent = source
    return made


def twin(source: Element, *children: Element, **attributes: str) -> Element:
    """An SDF element of `children` with the tag, the position and the parent of `source`."""
    made = element(source.tag, source, "", *children, **attributes)
    made.parent = source.parent
    return made


def given(source: Element, attribute: str) -> str:
    """A required attribute. Raises UserError if it is missing."""
    value = source.get(attribute)
    if value is None or not value.strip():
        raise complain(source, f"has no attribute '{attribute}'")
    return value.strip()


def three(source: Element, attribute: str, default: str) -> str:
    """An attribute of three words, or `default`. Raises UserError."""
    text = source.get(attribute, default)
    if len(text.split()) != 3:
        raise complain(source, f"{attribute} must be three numbers, found '{text[:60]}'")
    return text


def pose(source: Element, relative_to: str = "") -> Element:
    """The `<pose>` for the `<origin>` in `source`. Raises UserError."""
    origin = source.find("origin")
    holder = source if origin is None else origin
    if origin is None:
        words = "0 0 0 0 0 0"
    else:
        words = f"{three(origin, 'xyz', '0 0 0')} {three(origin, 'rpy', '0 0 0')}"
    return element("pose", holder, words, **({"relative_to": relative_to} if relative_to else {}))
