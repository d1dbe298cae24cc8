"""What a surface is like: friction, colour, and whether anything can touch it at all."""

from __future__ import annotations

from ddenv.world.sdf.context import Context
from ddenv.world.sdf.xml import Element, complain, number, numbers, text_of, truth

Color = tuple[float, float, float, float]

# SDF's default for <mu>, and what simulators use where a surface names none.
DEFAULT_MU = 1.0
# A collide_bitmask with which a collision touches all others.
EVERYTHING = 0xFFFF
# The colours of Gazebo's own materials that worlds name most often.
GAZEBO_COLORS: dict[str, tuple[float, float, float]] = {
    "Black": (0.05, 0.05, 0.05),
    "Blue": (0.1, 0.2, 0.8),
    "BlueTransparent": (0.1, 0.2, 0.8),
    "Bricks": (0.6, 0.3, 0.25),
    "DarkGray": (0.18, 0.18, 0.18),
    "DarkGrey": (0.18, 0.18, 0.18),
    "FlatBlack": (0.1, 0.1, 0.1),
    "Gold": (0.8, 0.65, 0.12),
    "Gray": (0.5, 0.5, 0.5),
    "Green": (0.1, 0.6, 0.15),
    "Grey": (0.5, 0.5, 0.5),
    "Indigo": (0.3, 0.0, 0.5),
    "LightWood": (0.78, 0.63, 0.45),
    "Orange": (1.0, 0.5, 0.1),
    "Purple": (0.6, 0.1, 0.6),
    "Red": (0.8, 0.1, 0.1),
    "Residential": (0.7, 0.65, 0.6),
    "Road": (0.25, 0.25, 0.27),
    "SkyBlue": (0.5, 0.7, 0.9),
    "Turquoise": (0.1, 0.75, 0.75),
    "White": (0.95, 0.95, 0.95),
    "Wood": (0.6, 0.42, 0.25),
    "WoodFloor": (0.65, 0.47, 0.3),
    "Yellow": (0.9, 0.85, 0.1),
    "ZincYellow": (0.95, 0.85, 0.3),
}


def read_friction(collision: Element, context: Context) -> float:
    """The Coulomb coefficient: the smaller of the two that SDF gives, for two directions. Raises UserError."""
    engine, names = collision.find("surface/friction/ode"), ("mu", "mu2")
    if engine is None:
        engine, names = collision.find("surface/friction/bullet"), ("friction", "friction2")
    if engine is None:
        return DEFAULT_MU
    both = []
    for name in names:
        mu = number(engine, name, DEFAULT_MU)
        if mu < 0:
            raise complain(engine.find(name), f"friction must not be negative, found {mu:g}")
        both.append(mu)
    if both[0] != both[1]:
        why = f"friction of {both[0]:g} and {both[1]:g} in two directions by {min(both):g} in all"
        context.note("replaced", engine, why)
    return min(both)


def can_be_touched(collision: Element, context: Context) -> bool:
    """Whether contacts with this collision push anything: those of sensors do not."""
    contact = collision.find("surface/contact")
    if contact is None:
        return True
    mask = text_of(contact.find("collide_bitmask"))
    bits = _integer(contact.find("collide_bitmask"), mask) & EVERYTHING if mask else EVERYTHING
    if bits == 0:
        context.note("ignored", collision, "its collide_bitmask lets nothing touch it")
        return False
    if bits != EVERYTHING:
        context.note("ignored", contact.find("collide_bitmask"), "it touches everything")
    if truth(contact, "collide_without_contact", False):
        context.note("ignored", collision, "it collides without contact")
        return False
    return True


def _integer(element: Element, text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise complain(element, f"expected a whole number, found '{text[:60]}'") from None


def read_color(visual: Element) -> Color | None:
    """The diffuse colour, else the ambient one, else that of a material of Gazebo's own; None where there is none."""
    opacity = 1.0 - min(max(number(visual, "transparency", 0.0), 0.0), 1.0)
    color = _written(visual) or _named(text_of(visual.find("material/script/name")))
    if color is None:
        return None
    # Files are full of colours with an alpha of zero, which the simulators that wrote them never looked at.
    red, green, blue, alpha = color
    return red, green, blue, (alpha or 1.0) * opacity


def _written(visual: Element) -> Color | None:
    for tag in ("material/diffuse", "material/ambient"):
        element = visual.find(tag)
        if element is not None and text_of(element):
            count = 4 if len((element.text or "").split()) == 4 else 3
            values = tuple(min(max(value, 0.0), 1.0) for value in numbers(element, count))
            return (*values, 1.0)[:4]
    return None


def _named(material: str) -> Color | None:
    color = GAZEBO_COLORS.get(material.removeprefix("Gazebo/"))
    return None if color is None else (*color, 1.0)
