"""Cuts a mesh into convex pieces, with the space between its parts: doors, the room below a table.

Each connected part that encloses a solid is cut along planes of its own faces, where it is concave,
until each piece fills its convex hull. So walls at right angles become boxes, exactly. Of a part
that encloses nothing, each flat area becomes a thin plate below it; a curved one with many
triangles becomes the hulls of small patches. Manifold (github.com/elalish/manifold) does the
geometry. A run stores its pieces, so that its bits depend on no other machine's.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from itertools import count

import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule, Manifold, Mesh64, OpType
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.world.files.boxes import volume
from ddenv.world.hull import Surface, convex_hull
from ddenv.world.model import Mesh

# A piece that leaves at most this share of its hull empty is that hull.
EMPTY = 0.002
# So is one that leaves at most so much empty, m^3 (a cube of 4 cm), or this share of the whole
# mesh's hull, whichever is less.
# Beyond `MANY` cuts this grows with the square of their number: what is finer costs more time than
# it is worth.
LITTLE = 6e-5
LITTLE_SHARE = 3e-4
MANY = 64
SMALLEST = 1e-9  # of a piece, m^3
WELD = 1e-6  # vertices this near are one, as a share of the mesh's size
MOST_PLATES = 256  # of one part; of a part with more flat areas patches are taken
MOST_PATCHES = 128  # of one mesh
PLATE = 0.01  # the thickness of what stands for a flat area without a solid below it, m
CONCAVE = 1e-6  # how far a face rises above its neighbour at a concave edge, as a share of the size
BEYOND = 1e-7  # how far beyond a face a cut is, as a share of the size
# The planes that are tried for a cut: fewer for finer parts, since each cut of these takes longer.
MOST_PLANES = 40
FEWEST_PLANES = 6
CHECKED_TRIANGLES = 20_000
# A finer part is simplified, by at most so many m, since each of its cuts takes long.
MOST_TRIANGLES = 4_000
SIMPLER = 0.01
# Triangles times planes that are looked at for one mesh, some 20 s: what is not cut by then is its
# hull.
MOST_WORK = 10_000_000
# A plane's unit normal (3,), and its distance from the origin along that, m.
Plane = tuple[Floats, float]


def convex_pieces(vertices: Floats, faces: Integers, most: int) -> list[Surface]:
    """The convex pieces of a mesh, at most `most`, in m; a single one is its hull. Raises
    ValueError if there is no hull.
    """
    whole = convex_hull(vertices[np.unique(faces)])
    parts = connected_parts(vertices, faces)
    solids: list[Manifold] = []
    uneven: list[Floats] = []
    for part in parts:
        solid = solid_of(part)
        if solid is not None:
            solids.append(solid)
        elif len(flat_areas(part)) <= MOST_PLATES:
            solids += _plates(part)
        else:
            uneven.append(part.triangles)
    most_patches = min(MOST_PATCHES, most // 4)
    patches = _patches(uneven, most_patches)
    little = min(LITTLE, LITTLE_SHARE * volume(Mesh("hull", *whole)))
    hulls = sorted(_cut(solids, most - len(patches), little), key=Manifold.volume, reverse=True)
    pieces = [_surface(hull) for hull in hulls]
    if len(pieces) + len(patches) > most:
        # Of more solids than that the smallest are joined where they are near each other.
        small = pieces[most - 2 * most_patches :]
        pieces = pieces[: most - 2 * most_patches]
        patches += _patches([vertices[faces] for vertices, faces in small], most_patches)
    pieces += [convex_hull(corners) for corners in patches]
    if len(pieces) > 1:
        return pieces
    return [whole]


def connected_parts(vertices: Floats, faces: Integers) -> list[trimesh.Trimesh]:
    """The connected parts of a mesh, without triangles that have no area, or stand twice."""
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    places = np.round(vertices / (WELD * size)).astype(np.int64)
    _, first, same = np.unique(places, axis=0, return_index=True, return_inverse=True)
    faces = same.reshape(-1)[faces]
    corners = np.sort(faces, axis=1)
    faces = faces[(corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])]
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    mesh = trimesh.Trimesh(vertices[first], faces[np.sort(once)], process=False)
    return list(mesh.split(only_watertight=False, repair=False))


def solid_of(part: trimesh.Trimesh) -> Manifold | None:
    """What a closed, connected surface encloses; None if it is not closed, or encloses nothing."""
    faces = part.faces if _is_closed(part.faces) else _wound_alike(part)
    # Of what is not closed Manifold only says so, or reads memory that it does not own.
    if not _is_closed(faces):
        return None
    if volume(Mesh("part", part.vertices, faces)) < 0:
        faces = faces[:, ::-1]
    solid = Manifold(
        Mesh64(np.ascontiguousarray(part.vertices), np.ascontiguousarray(faces, dtype=np.uint64))
    )
    if solid.volume() > SMALLEST:
        return solid
    return None


def _is_closed(faces: Integers) -> bool:
    """Whether along each edge as many faces run one way as the other."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    back = edges[:, ::-1]
    return np.array_equal(edges[np.lexsort(edges.T)], back[np.lexsort(back.T)])


def _wound_alike(part: trimesh.Trimesh) -> Integers:
    """The faces of `part`, each turned so that it runs along an edge in the other direction than
    its neighbour there.
    """
    first, second = part.face_adjacency.T
    edges = part.face_adjacency_edges
    alike = _runs_along(part.faces[first], edges) == _runs_along(part.faces[second], edges)
    neighbours = coo_matrix(
        (np.where(alike, 2, 1), (first, second)), shape=(len(part.faces), len(part.faces))
    ).tocsr()
    neighbours = neighbours + neighbours.T
    order, before = breadth_first_order(neighbours, 0)
    turned = np.zeros(len(part.faces), dtype=bool)
    for face in order[1:]:
        turned[face] = turned[before[face]] ^ (neighbours[before[face], face] == 2)
    return np.where(turned[:, None], part.faces[:, ::-1], part.faces)


def _runs_along(faces: Integers, edges: Integers) -> Booleans:
    """Whether each of `faces` (N, 3) has its own one of `edges` (N, 2) from start to end, not from
    end to start.
    """
    after = np.roll(faces, -1, axis=1)
    along: Booleans = ((faces == edges[:, :1]) & (after == edges[:, 1:])).any(axis=1)
    return along


def flat_areas(part: trimesh.Trimesh) -> list[Integers]:
    """The triangles of `part`, by number, those together that are neighbours in one plane."""
    areas = [np.sort(area) for area in part.facets]
    alone = np.setdiff1d(np.arange(len(part.faces)), np.concatenate([[], *areas]))
    return [*areas, *alone.astype(int).reshape(-1, 1)]


def _plates(part: trimesh.Trimesh) -> Iterator[Manifold]:
    """A thin solid below each flat area of `part`."""
    for area in flat_areas(part):
        normal = part.face_normals[area[0]]
        to_plane: Floats = trimesh.geometry.plane_transform(part.triangles[area[0], 0], normal)
        flat = trimesh.transform_points(part.triangles[area].reshape(-1, 3), to_plane)[:, :2]
        outline = union(
            CrossSection([corners], FillRule.NonZero) for corners in flat.reshape(-1, 3, 2)
        )
        plate = outline.extrude(PLATE).translate((0.0, 0.0, -PLATE))
        yield plate.transform(np.linalg.inv(to_plane)[:3])


def extruded(outlines: Iterable[Floats], height: float) -> Surface:
    """The surface of what outlines (N, 2) m enclose, from z = 0 up to `height` m; what lies in two
    of them is a hole.
    """
    return _triangles(CrossSection(list(outlines), FillRule.EvenOdd).extrude(height))


def union(outlines: Iterable[CrossSection]) -> CrossSection:
    """All that any of `outlines` covers."""
    return CrossSection.batch_boolean(list(outlines), OpType.Add)


def _cut(solids: Iterable[Manifold], most: int, little: float) -> list[Manifold]:
    """The hulls of the convex pieces of `solids`: what fills its hull least is cut first, with
    `most` cuts.

    What leaves `little` (m^3) empty is not cut.
    """
    numbers = count()
    waiting: list[tuple[float, int, Manifold]] = []
    done: list[Manifold] = []

    def add(solid: Manifold) -> None:
        for part in solid.decompose():
            hull = part.hull()
            empty = hull.volume() - part.volume()
            if empty > max(EMPTY * hull.volume(), little):
                heapq.heappush(waiting, (-empty, next(numbers), part))
            elif hull.volume() > SMALLEST:
                done.append(hull)

    for solid in solids:
        add(solid if solid.num_tri() <= MOST_TRIANGLES else solid.simplify(SIMPLER))
    work = 0
    cuts = 0
    while waiting and work < MOST_WORK and cuts < most:
        if -waiting[0][0] < little * (cuts / MANY) ** 2:
            break
        cuts += 1
        part = heapq.heappop(waiting)[-1]
        planes = _planes(part)
        work += part.num_tri() * len(planes)
        halves = _halves(part, planes)
        if not halves:
            done.append(part.hull())
        for half in halves:
            add(half)
    hulls = (_rounded(hull) for hull in (*done, *(part.hull() for _, _, part in waiting)))
    return [hull for hull in hulls if not hull.is_empty()]


def _halves(solid: Manifold, planes: list[Plane]) -> list[Manifold]:
    """Both sides of the one of `planes` that leaves least empty in the hulls of what it parts; none
    if none cuts `solid`.
    """
    best: list[Manifold] = []
    least = np.inf
    for normal, height in planes:
        halves = [half for half in solid.split_by_plane(normal, height) if half.volume() > SMALLEST]
        if len(halves) < 2:
            continue
        filled = sum(part.hull().volume() for half in halves for part in half.decompose())
        if filled < least - SMALLEST:
            least = filled
            best = halves
    return best


def _planes(solid: Manifold) -> list[Plane]:
    """Planes along which `solid` can be cut: those of faces that meet in a concave edge, the ones
    with the longest edges first.
    """
    vertices, faces = _triangles(solid)
    size = float(np.ptp(vertices, axis=0).max())
    normals, points, lengths = _concave_edges(vertices, faces, CONCAVE * size)
    heights = np.einsum("ij,ij->i", normals, points)
    rounded = np.round(np.column_stack([normals, heights / size]), 4)
    planes, first, same = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    total = np.bincount(same.reshape(-1), lengths, len(planes))
    most = int(np.clip(CHECKED_TRIANGLES / len(faces), FEWEST_PLANES, MOST_PLANES))
    longest = first[np.argsort(-total, kind="stable")[:most]]
    # Just beyond the face: a cut in its own plane could leave what it parts joined by triangles
    # without area.
    return [(normals[edge], float(heights[edge] + BEYOND * size)) for edge in longest]


def _concave_edges(
    vertices: Floats, faces: Integers, least: float
) -> tuple[Floats, Floats, Floats]:
    """The edges of a closed surface at which a face rises more than `least` (m) above the plane of
    its neighbour.

    For each, and from either side: the neighbour's unit normal (N, 3), a point of the edge (N, 3)
    m, and its length (N,) m.
    """
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    starts = faces.T.reshape(-1)
    ends = np.roll(faces, -1, axis=1).T.reshape(-1)
    opposite = np.roll(faces, -2, axis=1).T.reshape(-1)
    # Each edge of a face runs the other way along the neighbouring face.
    forth = starts * len(vertices) + ends
    back = ends * len(vertices) + starts
    order = np.argsort(forth)
    neighbour = order[np.searchsorted(forth, back, sorter=order)]
    own = np.tile(normals, (3, 1))
    rise = np.einsum("ij,ij->i", own, vertices[opposite[neighbour]] - vertices[starts])
    concave = rise > least
    points = vertices[starts[concave]]
    lengths = np.linalg.norm(vertices[ends[concave]] - points, axis=1)
    return own[concave], points, lengths


def _rounded(hull: Manifold) -> Manifold:
    """`hull` without the tiny edges that cuts beyond faces leave."""
    low, high = np.reshape(hull.bounding_box(), (2, 3))
    return hull.simplify(WELD * float((high - low).max()))


def _surface(hull: Manifold) -> Surface:
    return convex_hull(_triangles(hull)[0])


def _triangles(solid: Manifold) -> Surface:
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)


def _patches(parts: list[Floats], most: int) -> list[Floats]:
    """The corners (N, 3) m of patches of the triangles `parts` (M, 3, 3) m: the largest patch is
    halved until there are `most`.
    """
    if not parts:
        return []
    triangles = np.concatenate(parts)
    numbers = count()
    waiting = [(-_size(triangles), next(numbers), triangles)]
    while len(waiting) < most and len(waiting[0][-1]) > 1:
        triangles = heapq.heappop(waiting)[-1]
        middles = triangles.mean(axis=1)
        order = np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")
        for half in np.array_split(triangles[order], 2):
            heapq.heappush(waiting, (-_size(half), next(numbers), half))
    return [triangles.reshape(-1, 3) for _, _, triangles in waiting]


def _size(triangles: Floats) -> float:
    """The diagonal of the box around `triangles`, m; 0 for a single one, which cannot be halved."""
    if len(triangles) == 1:
        return 0.0
    corners = triangles.reshape(-1, 3)
    return float(np.linalg.norm(np.ptp(corners, axis=0)))
