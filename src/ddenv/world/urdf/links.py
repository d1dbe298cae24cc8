"""The `<link>`s of URDF: mass, shapes, colours, and the friction that Gazebo's own elements give them."""

from __future__ import annotations

from ddenv.world.sdf.context import Context
from ddenv.world.sdf.xml import Element, complain, name_of, text_of
from ddenv.world.urdf.elements import element, given, pose, three, twin, value

# What URDF says of each shape, by the attribute, with the SDF element that says it.
SHAPES = {
    "box": {"size": "size"},
    "cylinder": {"radius": "radius", "length": "length"},
    "sphere": {"radius": "radius"},
    "capsule": {"radius": "radius", "length": "length"},
    "mesh": {"filename": "uri"},
}
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
FRICTION = {"mu1": "mu", "mu2": "mu2"}


def has_mass(link: Element) -> bool:
    """Whether `link` has a mass: many of a robot's links are frames only. Raises UserError."""
    mass = link.find("inertial/mass")
    return mass is not None and value(mass, "value") != 0.0


def link_of(source: Element, robot: Element, context: Context) -> Element:
    """The SDF link without its pose. Raises UserError."""
    name = name_of(source)
    made = twin(source, name=name)
    if has_mass(source):
        made.append(_inertial(source.find("inertial")))
    for tag in ("collision", "visual"):
        for count, part in enumerate(source.findall(tag)):
            shape = twin(part, name=part.get("name") or f"{tag}_{count}")
            shape.extend([pose(part), _geometry(part, context)])
            made.append(shape)
            shape.extend(_surface(name, part, robot) if tag == "collision" else _material(part, robot))
    return made


def _inertial(source: Element) -> Element:
    made = twin(source)
    made.append(pose(source))
    mass, tensor = source.find("mass"), source.find("inertia")
    made.append(element("mass", mass, given(mass, "value")))
    if tensor is not None:
        inertia = twin(tensor)
        inertia.extend([element(tag, tensor, given(tensor, tag)) for tag in TENSOR])
        made.append(inertia)
    return made


def _geometry(part: Element, context: Context) -> Element:
    source = part.find("geometry")
    if source is None or not len(source):
        raise complain(part, "has no <geometry> with a shape in it")
    shape = source[0]
    if shape.tag not in SHAPES:
        raise complain(shape, f"<{shape.tag}> is no shape of URDF; use one of {', '.join(SHAPES)}")
    made = twin(shape)
    for attribute, tag in SHAPES[shape.tag].items():
        text = given(shape, attribute)
        made.append(element(tag, shape, _found(text, shape, context) if tag == "uri" else text))
    if shape.tag == "mesh" and shape.get("scale"):
        made.append(element("scale", shape, three(shape, "scale", "")))
    geometry = twin(source)
    geometry.append(made)
    return geometry


def _found(uri: str, shape: Element, context: Context) -> str:
    """The URI of a mesh; one in the package that the file itself lies in is its path."""
    package, _, rest = uri.removeprefix("package://").partition("/")
    if not uri.startswith("package://") or context.stand_in(uri) is not None:
        return uri
    folder = next((folder for folder in shape.source.absolute().parents if folder.name == package), None)
    return uri if folder is None else str(folder / rest)


def _surface(link: str, part: Element, robot: Element) -> list[Element]:
    """The `<surface>` that `<gazebo reference="link">` gives a collision, if there is one."""
    ode = element("ode", part)
    for extension in robot.findall("gazebo"):
        for tag, ours in FRICTION.items():
            found = extension.find(tag)
            if found is not None and extension.get("reference") == link:
                ode.append(element(ours, found, text_of(found) or given(found, "value")))
    friction, surface = element("friction", part), element("surface", part)
    friction.append(ode)
    surface.append(friction)
    return [surface] if len(ode) else []


def _material(part: Element, robot: Element) -> list[Element]:
    """The `<material>` of a visual: its own colour, or that of the robot's material of that name."""
    own = part.find("material")
    if own is None:
        return []
    named = [other for other in robot.findall("material") if other.get("name") == own.get("name")]
    color = next((found for each in (own, *named) if (found := each.find("color")) is not None), None)
    if color is None:
        return []
    made = twin(own)
    made.append(element("diffuse", color, given(color, "rgba")))
    return [made]
