"""Reads the shape in a `<geometry>`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ddenv.arrays import Floats
from ddenv.text import Names
from ddenv.world.access import Missing, Unusable
from ddenv.world.extent import circle, polygon_area
from ddenv.world.files.boxes import box_of
from ddenv.world.files.resources import MeshPart
from ddenv.world.hull import convex_hull, convex_outline
from ddenv.world.model import (
    UNCUT,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Terrain,
)
from ddenv.world.pose import HERE, ONE, Pose, Vector, pointing, vector
from ddenv.world.sdf.context import Context, refuse
from ddenv.world.sdf.standin import AUTO, NONE, SIZES, Placed
from ddenv.world.sdf.xml import Element, complain, number, numbers, text_of, truth
from ddenv.world.write import primitive

SIDES = 32  # of a cone
SHAPES = (
    "box",
    "cylinder",
    "sphere",
    "plane",
    "capsule",
    "ellipsoid",
    "cone",
    "mesh",
    "polyline",
    "heightmap",
)
SMALLEST = 1e-6
LARGEST = 1e6  # m
# The sizes of each shape, m, by the elements that say them: libsdformat takes these where one is
# missing.
DEFAULT_SIZES: dict[str, dict[str, tuple[float, ...]]] = {
    "box": {"size": ONE},
    "capsule": {"radius": (0.5,), "length": (1.0,)},
    "cone": {"radius": (0.5,), "length": (1.0,)},
    "cylinder": {"radius": (1.0,), "length": (1.0,)},
    "ellipsoid": {"radii": ONE},
    "heightmap": {"size": ONE},
    "plane": {"size": (1.0, 1.0)},
    "polyline": {"height": (1.0,)},
    "sphere": {"radius": (1.0,)},
}
# The maximum number of convex pieces of one mesh, and that of libsdformat for
# <convex_decomposition> without a number.
MOST_PIECES = 512
DEFAULT_HULLS = 16
MOST_POINTS = 2_000  # of all outlines of a polyline; of a finer one the hull is taken
ROUGH = "contact at the edges of those that are no boxes is rough"
RANGE = f"sizes must be from {SMALLEST:g} to {LARGEST:g} m"


@dataclass(frozen=True, kw_only=True)
class Lost:
    """A mesh or heightmap that was not found, or is `unreadable`, and the reason.

    `word` is what the user wants in its place, as in `StandIn`. `scale` is its own, times that of
    its model.
    """

    element: Element
    uri: str
    reason: str
    word: str = ""
    scale: Vector = ONE
    unreadable: bool = False

    @property
    def problem(self) -> str:
        """What is wrong with it, to follow its name."""
        if self.unreadable:
            return "is unreadable"
        return "is not available"


def read_shape(parent: Element, context: Context, scale: Vector = ONE) -> Placed | Lost | None:
    """The shape of a `<collision>` or `<visual>`; None if it is empty or left out. Raises
    UserError.

    `scale` multiplies its sizes, along the shape's own axes.
    """
    geometry = parent.find("geometry")
    if geometry is None or not len(geometry):
        context.note("ignored", parent, "it has no shape in its <geometry>")
        return None
    element = next((child for child in geometry if child.tag in SHAPES), geometry[0])
    for other in geometry:
        if other is not element and (other.tag, element.tag) != ("polyline", "polyline"):
            context.note("ignored", other, f"a <geometry> has one shape; <{element.tag}> is used")
    match element.tag:
        case "mesh":
            return _of_file(element, parent, context, scale)
        case "polyline":
            return _polyline(geometry, context, scale)
        case "empty":
            return None
        case "heightmap" | "image":
            return _heightmap(element, parent, context, scale)
        case "plane":
            return Placed(Plane(*_sizes(element)), _turned(element.find("normal")))
    return Placed(_scaled(_primitive(element), scale, element))


def _primitive(element: Element) -> Shape:
    kinds: dict[str, Callable[..., Shape]] = {
        "box": Box,
        "capsule": Capsule,
        "cone": cone,
        "cylinder": Cylinder,
        "ellipsoid": Ellipsoid,
        "sphere": Sphere,
    }
    if element.tag not in kinds:
        known = ", ".join(SHAPES)
        raise complain(element, f"<{element.tag}> is not a known shape; use one of {known}")
    return kinds[element.tag](*_sizes(element))


def _turned(normal: Element | None) -> Pose:
    """The shortest rotation from the z axis to a `<normal>`."""
    if normal is None:
        return HERE
    direction = np.array(numbers(normal, 3))
    length = float(np.linalg.norm(direction))
    if not 1e-9 < length < 1e9:
        raise complain(normal, "the normal has no usable length")
    return pointing(vector(direction / length))


def _of_file(element: Element, parent: Element, context: Context, scale: Vector) -> Placed | Lost:
    """What a `<mesh>` or a `<heightmap>` stands for, or what the user wants in place of its file.
    Raises UserError.
    """
    if element.tag == "image":
        raise refuse(element, "image", "an image is not supported: nothing would collide with it")
    uri = text_of(element.find("uri"))
    if not uri:
        raise complain(element, "has no <uri>")
    factor = element.find("scale")
    own = ONE if factor is None else vector(numbers(factor, 3))
    if factor is not None and (min(map(abs, own)) < 1e-9 or max(map(abs, own)) > LARGEST):
        raise complain(
            factor, f"a scale must be from 1e-09 to 1e+06 or negative, found '{text_of(factor)}'"
        )
    given = context.stand_in(uri)
    if given is not None:
        text, stand_in = given
        if isinstance(stand_in, str):
            reason = "left out" if stand_in == NONE else f"the {stand_in} shapes replace it"
            return Lost(element=element, uri=uri, reason=reason, word=stand_in)
        context.note("replaced", element, f"'{uri}' by the stand-in {text}")
        return scaled(stand_in, scale, element)
    full = _times(own, scale)
    level = _terrain(element, np.zeros((2, 2)), full) if element.tag == "heightmap" else None
    try:
        if level is not None:
            return _terrain(
                element, context.resources.heights(MeshPart(uri, element.source.parent)), full
            )
        return _mesh(uri, element, parent, context, full)
    except (Missing, Unusable) as error:
        word = AUTO if context.may_guess(uri) else ""
        if word and level is not None:
            context.guessed.append((context.model, uri))
            context.note("replaced", element, f"'{uri}' by a guess, level ground: {error}")
            return level
        return Lost(
            element=element,
            uri=uri,
            reason=str(error),
            word=word,
            scale=full,
            unreadable=isinstance(error, Unusable),
        )


def _mesh(uri: str, element: Element, parent: Element, context: Context, scale: Vector) -> Placed:
    """Raises Missing, Unusable and UserError."""
    submesh = element.find("submesh")
    name = "" if submesh is None else text_of(submesh.find("name"))
    center = submesh is not None and truth(submesh, "center", False)
    part = MeshPart(uri, element.source.parent, name, center)
    if parent.tag == "collision":
        return _solid(part, element, parent, context, scale)
    mesh = context.resources.mesh(part, convex=False)
    if mesh.simplified:
        context.note(
            "replaced", element, f"'{uri}' by its convex hull, since it is too fine to be drawn"
        )
    return Placed(_scaled(mesh, scale, element))


def _heightmap(
    element: Element, parent: Element, context: Context, scale: Vector
) -> Placed | Lost | None:
    """As `_of_file`; None if it is left out or not drawn."""
    if parent.tag == "visual":
        context.note("ignored", element, f"a {element.tag} is not drawn")
        return None
    if context.ignores(element.tag):
        context.note("ignored", element, "left out by --ignore: nothing collides with it")
        return None
    return _of_file(element, parent, context, scale)


def _terrain(element: Element, shares: Floats, scale: Vector) -> Placed:
    """The ground that a `<heightmap>` stands for: `shares` (R, C) of its height. Raises
    UserError.
    """
    place = element.find("pos")
    middle = (0.0, 0.0, 0.0) if place is None else _times(vector(numbers(place, 3)), scale)
    return _ground(
        text_of(element.find("uri")), shares, _times(vector(*_sizes(element)), scale), middle
    )


def _ground(uri: str, shares: Floats, size: Vector, middle: Vector) -> Placed:
    """The ground that `shares` (R, C) of the height of a box give, which has its bottom's `middle`
    (m) there.
    """
    digest = hashlib.blake2b(shares.tobytes(), digest_size=8).hexdigest()
    return Placed(Terrain(size[:2], shares * size[2], f"{uri} {digest} {size}"), Pose(middle))


def _solid(
    part: MeshPart, element: Element, parent: Element, context: Context, scale: Vector
) -> Placed:
    """What collides in place of a mesh: its convex pieces, or its hull. Raises Missing, Unusable
    and UserError.
    """
    hull = _scaled_mesh(context.resources.mesh(part, convex=True), scale, element)
    most = _most_pieces(element, parent, context)
    try:
        shares = context.resources.ground(part, scale) if most > 1 else None
    except (Missing, Unusable):
        shares = None
    if shares is not None:
        low = hull.vertices.min(axis=0)
        high = hull.vertices.max(axis=0)
        context.note("replaced", element, f"'{part.uri}' by the solid ground below it")
        return _ground(
            part.uri, shares, vector(high - low), vector([*(low + high)[:2] / 2, low[2]])
        )
    pieces = context.resources.pieces(part, scale, most) if most > 1 else []
    if len(pieces) == 1 and (box := box_of(hull)) is not None:
        return Placed(*box)
    if len(pieces) < 2:
        why = ROUGH if pieces or most == 1 else UNCUT
        context.note("replaced", element, f"'{part.uri}' by its convex hull; {why}")
        return Placed(hull)
    context.note(
        "replaced", element, f"'{part.uri}' by its convex pieces; {ROUGH}", f"{len(pieces)} pieces"
    )
    whole = _scaled_mesh(context.resources.mesh(part, convex=False), scale, element)
    return _of_pieces(whole, pieces)


def _most_pieces(element: Element, parent: Element, context: Context) -> int:
    """The maximum number of convex pieces of the `<mesh>` of a collision; 1 for its hull. Raises
    UserError.
    """
    wanted = element.get("optimization", "")
    if wanted == "convex_hull" or context.reading.mesh == "hull" or _is_turned(parent):
        return 1
    decomposition = element.find("convex_decomposition")
    if wanted != "convex_decomposition" or decomposition is None:
        return MOST_PIECES
    return int(min(max(number(decomposition, "max_convex_hulls", DEFAULT_HULLS), 1), MOST_PIECES))


def _is_turned(collision: Element) -> bool:
    """Whether a joint turns the link of a `<collision>`: a wheel rolls on its hull, and what stands
    for it is found by that.
    """
    link = collision.parent
    if link is None or link.parent is None:
        return False
    joints = (
        joint
        for joint in link.parent.findall("joint")
        if joint.get("type") in ("revolute", "continuous")
    )
    return any(text_of(joint.find("child")) == link.get("name") for joint in joints)


def scaled(stand_in: Placed, scale: Vector, element: Element) -> Placed:
    """A stand-in for the mesh `element` in a model of this scale. Raises UserError."""
    return Placed(
        _scaled(stand_in.shape, scale, element), Pose(_times(stand_in.offset.position, scale))
    )


def remedies(lost: Lost, siblings: Names) -> str:
    """The error for a missing file of a collision, with all remedies; `siblings` are the kinds of
    other shapes in its link.
    """
    # For model://barrel/meshes/barrel.dae name the model: one stand-in then covers all of its
    # meshes.
    if lost.uri.startswith(("model://", "package://")):
        package = "/".join(lost.uri.split("/")[:3])
    else:
        package = lost.uri
    others = ", ".join(f"{kind}:{sizes}" for kind, sizes in SIZES.items() if kind != "cylinder")
    also = "".join(
        f", or '{lost.uri[:200]}={kind}' for the box around its link's {kind} shapes"
        for kind in siblings
    )
    # Another folder would not help if the file is there.
    folder = "" if lost.unreadable else "its folder with --model-path, "
    return (
        f"{lost.element.tag} '{lost.uri[:200]}' {lost.problem}: {lost.reason}; give {folder}a "
        f"shape in m with --stand-in '{package[:200]}=cylinder:0.3,1.0' (radius, length; or "
        f"{others}){also}, have one guessed with --stand-in auto, or leave it out with --ignore "
        f"{lost.element.tag}"
    )


def _scaled(shape: Shape, scale: Vector, element: Element) -> Shape:
    """`shape`, with its sizes along its own axes times `scale`. Raises UserError if it is too small
    or too large then.
    """
    match shape:
        case Mesh():
            return _scaled_mesh(shape, scale, element)
        case _ if scale == ONE:
            pass
        case Box(size):
            shape = Box(_times(size, scale))
        case Cylinder(radius, length) | Capsule(radius, length):
            shape = replace(shape, radius=radius * max(scale[:2]), length=length * scale[2])
        case Sphere(radius):
            shape = Sphere(radius * max(scale))
        case Ellipsoid(radii):
            shape = Ellipsoid(_times(radii, scale))
    _check_sizes([size for each in primitive(shape)[1].values() for size in each], element)
    return shape


def _scaled_mesh(mesh: Mesh, scale: Vector, element: Element) -> Mesh:
    if scale != ONE:
        # Mirroring turns a surface inside out: reverse its faces.
        faces = mesh.faces[:, ::-1] if np.prod(scale) < 0 else mesh.faces
        vertices = mesh.vertices * np.array(scale)
        mesh = Mesh(f"{mesh.origin} * {scale}", vertices, faces, simplified=mesh.simplified)
    largest = float(np.ptp(mesh.vertices, axis=0).max())
    _check_sizes([largest, max(float(np.abs(mesh.vertices).max()), SMALLEST)], element)
    return mesh


def _check_sizes(sizes: Sequence[float], element: Element) -> None:
    if min(sizes) < SMALLEST or max(sizes) > LARGEST:
        wrong = min(sizes) if min(sizes) < SMALLEST else max(sizes)
        raise complain(element, f"{RANGE}, found {wrong:g} m after scaling")


def _times(vector: Vector, scale: Vector) -> Vector:
    return (vector[0] * scale[0], vector[1] * scale[1], vector[2] * scale[2])


def _sizes(shape: Element) -> list[Any]:
    """The sizes of a shape, m, as in DEFAULT_SIZES: numbers, or vectors. Raises UserError."""
    sizes: list[Any] = []
    for tag, usual in DEFAULT_SIZES[shape.tag].items():
        element = shape.find(tag)
        values = usual if element is None else numbers(element, len(usual))
        if element is not None and (min(values) < SMALLEST or max(values) > LARGEST):
            raise complain(element, f"{RANGE}, found '{text_of(element)[:60]}'")
        sizes.append(values[0] if len(values) == 1 else values)
    return sizes


def _polyline(geometry: Element, context: Context, scale: Vector) -> Placed:
    """All `<polyline>`s of a `<geometry>`, extruded upwards from z = 0; what lies in two of them is
    a hole. Raises UserError.
    """
    elements = geometry.findall("polyline")
    (height,) = _sizes(elements[0])
    outlines = [
        np.array([numbers(point, 2) for point in element.findall("point")]) for element in elements
    ]
    corners = convex_outline(np.vstack([outline.reshape(-1, 2) for outline in outlines]))
    if len(corners) < 3:
        raise complain(elements[0], "needs at least three <point>s that are not on one line")
    # Meshes of equal outlines compare equal.
    digest = hashlib.blake2b(
        repr([outline.tolist() for outline in outlines]).encode(), digest_size=8
    ).hexdigest()
    origin = f"polyline {digest} {height!r}"
    is_convex = len(elements) == 1 and abs(polygon_area(outlines[0])) >= 0.99 * polygon_area(
        corners
    )
    is_fine = sum(map(len, outlines)) > MOST_POINTS
    if is_fine and not is_convex:
        context.note(
            "replaced",
            elements[0],
            f"a polyline of more than {MOST_POINTS} points by its convex hull",
        )
    if is_convex or is_fine:
        low = np.column_stack([corners, np.zeros(len(corners))])
        try:
            convex = Mesh(origin, *convex_hull(np.vstack([low, low + np.array([0, 0, height])])))
        except ValueError as error:
            raise complain(elements[0], str(error)) from None
        return Placed(_scaled(convex, scale, elements[0]))
    # Loaded late: most worlds have no such shape.
    from ddenv.world.files.pieces import convex_pieces, extruded

    whole = _scaled_mesh(Mesh(origin, *extruded(outlines, height)), scale, elements[0])
    try:
        pieces = convex_pieces(whole.vertices, whole.faces, MOST_PIECES)
    except ValueError as error:
        raise complain(elements[0], str(error)) from None
    return _of_pieces(
        whole, [Mesh(f"{origin} {number}", *piece) for number, piece in enumerate(pieces)]
    )


def _of_pieces(whole: Shape, pieces: list[Mesh]) -> Placed:
    """A mesh that collides as its convex pieces, of which those that are boxes become boxes."""
    return Placed(whole, pieces=tuple(box_of(piece) or (piece, HERE) for piece in pieces))


def cone(radius: float, length: float) -> Mesh:
    """A cone centred on its frame's origin, its tip up, m."""
    rim = np.column_stack([radius * circle(SIDES), np.full(SIDES, -length / 2)])
    return Mesh(
        f"cone {radius!r} {length!r}", *convex_hull(np.vstack([rim, [0.0, 0.0, length / 2]]))
    )
