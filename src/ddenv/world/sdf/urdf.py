"""Converts a URDF robot to SDF elements: links with mass, shapes, colours and Gazebo's friction, and joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ddenv.schemas import nearest
from ddenv.world.model import Model
from ddenv.world.sdf.context import VERSIONS, Context, sdf_root
from ddenv.world.sdf.xml import Element, complain, name_of, numbers, parse, text_of

KINDS = ("fixed", "revolute", "continuous", "prismatic")
LIMITED = ("revolute", "prismatic")
# URDF's defaults; unlimited joints have a type of their own.
LIMITS = {"lower": "0", "upper": "0"}
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


def to_sdf(robot: Element, context: Context) -> Element:
    """The `<sdf>` for a URDF `<robot>`, its root link first. Raises UserError."""
    for each in robot.iter():
        if "xacro}" in each.tag or any("${" in text or "$(" in text for text in each.attrib.values()):
            raise complain(each, "is xacro, not URDF; run 'xacro FILE > robot.urdf' and name that file")
    # The reader would take it for an SDF version.
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
    return element("sdf", robot, "", model, version=VERSIONS[-1])


def root_of(text: bytes, path: Path, context: Context) -> Element:
    """The `<sdf>` of an SDF or URDF file. Raises UserError."""
    robot = parse(text, path) if f"<{ROOT}".encode() in text else None
    return sdf_root(text, path) if robot is None or robot.tag != ROOT else to_sdf(robot, context)


def is_urdf(element: Element) -> bool:
    """Whether a `<model>` was made of a URDF robot."""
    return element.parent is not None and element.parent.tag == ROOT


def without_mass(model: Model, element: Element) -> Model:
    """`model` with the links that have no mass in its URDF robot as mere frames, since the SDF reader gives every link a mass."""
    robot = element.parent
    if robot is None or robot.tag != ROOT:
        return model
    names = {name_of(link) for link in robot.findall("link") if not has_mass(link)}
    links = (replace(link, inertia=None) if link.name in names else link for link in model.links)
    return replace(model, links=tuple(links))


def has_mass(link: Element) -> bool:
    """Whether `link` has a mass; many links of robots are only frames. Raises UserError."""
    mass = link.find("inertial/mass")
    return mass is not None and value(mass, "value") != 0.0


def _root(robot: Element, links: list[str], children: set[str]) -> str:
    roots = [name for name in reversed(links) if name not in children]
    if len(roots) != 1:
        found = f"found {', '.join(roots[:5])}" if roots else "but joints close a loop"
        raise complain(robot, f"expected one link that is not the child of a joint, {found}")
    return roots[0]


def link_of(source: Element, robot: Element, context: Context) -> Element:
    """The SDF link for a URDF one, without its pose. Raises UserError."""
    name = name_of(source)
    made = twin(source, name=name)
    inertial = source.find("inertial")
    if inertial is not None and has_mass(source):
        made.append(_inertial(inertial))
    for tag in ("collision", "visual"):
        for count, part in enumerate(source.findall(tag)):
            more = _surface(name, part, robot) if tag == "collision" else _material(part, robot)
            own = part.get("name") or f"{tag}_{count}"
            made.append(twin(part, pose(part), _geometry(part, context), *more, name=own))
    return made


def _inertial(source: Element) -> Element:
    made = twin(source, pose(source))
    mass, tensor = source.find("mass"), source.find("inertia")
    if mass is not None:
        made.append(element("mass", mass, given(mass, "value")))
    if tensor is not None:
        made.append(twin(tensor, *(element(tag, tensor, given(tensor, tag)) for tag in TENSOR)))
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
        made.append(element(tag, shape, _found(text, shape, context) if tag == "uri" else text))
    if shape.tag == "mesh" and shape.get("scale"):
        made.append(element("scale", shape, three(shape, "scale", "")))
    return twin(source, made)


def _found(uri: str, shape: Element, context: Context) -> str:
    """The URI of a mesh; the path, if it is in the package that contains the robot's file."""
    package, _, rest = uri.removeprefix("package://").partition("/")
    if not uri.startswith("package://") or context.stand_in(uri) is not None:
        return uri
    folder = next((folder for folder in shape.source.absolute().parents if folder.name == package), None)
    return uri if folder is None else str(folder / rest)


def _surface(link: str, part: Element, robot: Element) -> list[Element]:
    """The `<surface>` of a collision from `<gazebo reference="link">`, if there is one."""
    coefficients = [
        element(ours, found, text_of(found) or given(found, "value"))
        for extension in robot.findall("gazebo")
        for tag, ours in FRICTION.items()
        if (found := extension.find(tag)) is not None and extension.get("reference") == link
    ]
    friction = element("friction", part, "", element("ode", part, "", *coefficients))
    return [element("surface", part, "", friction)] if coefficients else []


def _material(part: Element, robot: Element) -> list[Element]:
    """The `<material>` of a visual: its own colour, or that of the robot's material of the same name."""
    own = part.find("material")
    if own is None:
        return []
    named = [other for other in robot.findall("material") if other.get("name") == own.get("name")]
    color = next((found for each in (own, *named) if (found := each.find("color")) is not None), None)
    if color is None:
        return []
    return [twin(own, element("diffuse", color, given(color, "rgba")))]


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
    """The SDF joint for a URDF one. Raises UserError."""
    kind = (source.get("type") or "").strip()
    if kind not in KINDS:
        raise complain(source, f"joint type '{kind[:40]}' is not supported (only {', '.join(KINDS)})")
    made = twin(
        source, element("parent", source, parent), element("child", source, child), name=name_of(source), type=kind
    )
    if kind != "fixed":
        made.append(_axis(source, kind))
    return made


def _axis(source: Element, kind: str) -> Element:
    given_axis, limit, dynamics = source.find("axis"), source.find("limit"), source.find("dynamics")
    if kind in LIMITED and limit is None:
        raise complain(source, f"a {kind} joint needs a <limit>")
    place = source if given_axis is None else given_axis
    xyz = "1 0 0" if given_axis is None else three(given_axis, "xyz", "1 0 0")
    made = element("axis", source, "", element("xyz", place, xyz))
    if limit is not None:
        given_limits = {tag: text for tag in ("effort", "velocity") if (text := limit.get(tag))}
        defaults = {tag: limit.get(tag, default) for tag, default in LIMITS.items()} if kind in LIMITED else {}
        made.append(twin(limit, *(element(tag, limit, text) for tag, text in (defaults | given_limits).items())))
    if dynamics is not None:
        made.append(twin(dynamics, element("damping", dynamics, dynamics.get("damping", "0"))))
    return made


def element(tag: str, source: Element, text: str = "", *children: Element, **attributes: str) -> Element:
    """An SDF element with `text` and `children`, at the position of `source` in the file and with it as parent."""
    made = Element(tag, attributes)
    made.text = text
    made.extend(children)
    made.source, made.line, made.start, made.end = source.source, source.line, source.start, source.end
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


def value(source: Element, attribute: str) -> float:
    """An attribute that is one finite number. Raises UserError."""
    return numbers(element(attribute, source, given(source, attribute)), 1)[0]


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
    words = "0 0 0 0 0 0" if origin is None else f"{three(origin, 'xyz', '0 0 0')} {three(origin, 'rpy', '0 0 0')}"
    return element("pose", holder, words, **({"relative_to": relative_to} if relative_to else {}))
