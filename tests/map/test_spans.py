"""Thousands of models at once are drawn as each one would be by itself."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ddenv.map.footprints import Footprint
from ddenv.map.paint import Canvas
from ddenv.map.raster import EMPTY, SHORT, View, extent, label_cells, masks, owners
from ddenv.workbench.map.map_colors import mixed
from ddenv.workbench.map.model_looks import Kept, fill, looks
from ddenv.world.extent import convex_hull, polygon_area
from tests.tiers import examples

VIEW = View(0.3, -0.2, 0.5, 12, 6)
coordinates = st.floats(-6, 6).map(lambda value: round(value, 3))
clouds = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=7)
models = st.lists(st.lists(clouds, max_size=2), max_size=6)


def prints_of(shapes) -> list[Footprint]:
    prints = []
    for number, parts in enumerate(shapes):
        polygons = tuple(convex_hull(np.array(points)) for points in parts)
        corners = np.vstack(polygons) if polygons else np.array([[number - 3.0, 0.5]])
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        prints.append(Footprint(f"m{number}", polygons, tuple(low), tuple(high)))
    return prints


def slowly(each: Footprint, view: View) -> tuple[np.ndarray, np.ndarray]:
    """The pixels that a model fills, and those of which rounding may decide."""
    shape = (2 * view.rows, view.columns)
    inside, unsure = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    for row, column in np.ndindex(shape):
        for polygon in each.polygons:
            corners = view.pixels(polygon)
            sides = np.roll(corners, -1, axis=0) - corners
            away = np.array([column + 0.5, row + 0.5]) - corners
            turns = sides[:, 0] * away[:, 1] - sides[:, 1] * away[:, 0]
            # What is thinner than a pixel is widened to one.
            length = np.hypot(*np.ptp(corners, axis=0))
            width = abs(polygon_area(corners)) / max(length, 1e-9)
            wider = (1 - width) / 2 if length > SHORT and width < 1 else 0.0
            low, high = np.floor(corners.min(axis=0) - wider), np.ceil(corners.max(axis=0) + wider)
            if len(corners) > 2 and (low <= (column, row)).all() and ((column, row) < high).all():
                beyond = turns - wider * np.hypot(*sides.T)
                inside[row, column] |= bool((beyond <= 0).all())
                unsure[row, column] |= bool((abs(beyond) < 1e-6).any())
    x, y = view.pixels(np.array([each.center]))[0]
    if (each.area < 4 * view.scale**2 or not each.polygons) and 0 <= x < view.columns and 0 <= y < 2 * view.rows:
        inside[int(y), int(x)], unsure[int(y), int(x)] = True, False
    return inside, unsure


@examples(0.3)
@given(models)
def test_all_models_fill_the_pixels_that_each_one_fills(shapes):
    prints = prints_of(shapes)
    expected, unsure = (
        np.full((2 * VIEW.rows, VIEW.columns), EMPTY),
        np.zeros((2 * VIEW.rows, VIEW.columns), dtype=bool),
    )
    for index, each in enumerate(prints):
        inside, doubtful = slowly(each, VIEW)
        expected[inside] = index
        unsure |= doubtful
    grid = owners(masks(prints, VIEW), VIEW)
    assert (grid == expected)[~unsure].all()


@given(models, st.lists(st.integers(0, 5), max_size=4, unique=True))
def test_of_the_drawn_models_the_last_one_is_on_top(shapes, wanted):
    prints = prints_of(shapes)
    drawn = [index for index in sorted(wanted) if index < len(prints)]
    expected = np.full((2 * VIEW.rows, VIEW.columns), EMPTY)
    for index in drawn:
        alone = owners(masks(prints[index : index + 1], VIEW), VIEW)
        expected[alone == 0] = index
    assert (owners(masks(prints, VIEW), VIEW, drawn) == expected).all()


@given(st.lists(st.integers(-1, 3), min_size=24, max_size=24), st.integers(0, 100))
def test_a_letter_stands_on_the_cell_nearest_to_the_centre(values, seed):
    grid = np.array(values).reshape(6, 4)
    centers = np.random.default_rng(seed).uniform(-1, 6, (4, 2))
    for index, (row, column) in enumerate(label_cells(grid, centers).tolist()):
        upper, lower = grid[0::2] == index, grid[1::2] == index
        own = next((cells for cells in (upper & lower, upper, lower) if cells.any()), None)
        if own is None:
            assert (row, column) == (-1, -1)
            continue
        assert own[row, column]
        away = {
            (r, c): math.hypot(c + 0.5 - centers[index, 0], 2 * r + 1 - centers[index, 1])
            for r, c in np.argwhere(own).tolist()
        }
        assert away[row, column] == min(away.values())


@given(models, st.lists(st.tuples(coordinates, coordinates), max_size=3))
def test_huge_models_do_not_widen_the_map(shapes, points):
    prints = prints_of(shapes)
    low, high = np.array([math.inf] * 2), np.array([-math.inf] * 2)
    for point in points:
        low, high = np.minimum(low, point), np.maximum(high, point)
    for each in sorted(prints, key=lambda each: each.area):
        spread = np.maximum(high - low, 4.0)
        if np.isfinite(low).all() and each.area > 4 * spread[0] * spread[1]:
            break
        low, high = np.minimum(low, each.low), np.maximum(high, each.high)
    found = extent(prints, points)
    if not np.isfinite(low).all():
        low, high = np.array([-5.0, -5.0]), np.array([5.0, 5.0])
    assert (found[0] == low).all()
    assert (found[1] == high).all()


def test_many_large_models_on_top_of_each_other_are_drawn_in_parts(monkeypatch):
    monkeypatch.setattr("ddenv.map.raster.MOST_PIXELS", 100)
    square = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])
    prints = [Footprint(f"m{number}", (square,), (-9.0, -9.0), (9.0, 9.0)) for number in range(9)]
    grid = owners(masks(prints, VIEW), VIEW)
    assert set(np.unique(grid)) == {8}


# Models thinner than a pixel are drawn without gaps, and gaps between models stay seen, wherever the pixels fall.

DARK = (15, 20, 27), (213, 219, 229)


def wall(length: float, width: float, yaw: float, x: float = 0.0, y: float = 0.0) -> Footprint:
    corners = np.array([(-length, -width), (length, -width), (length, width), (-length, width)]) / 2
    turned = corners @ np.array([(math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))]) + (x, y)
    return Footprint("wall", (turned,), tuple(turned.min(axis=0).tolist()), tuple(turned.max(axis=0).tolist()))


@given(
    length=st.floats(2.5, 30),
    part=st.floats(0.001, 0.9),
    yaw=st.floats(-math.pi, math.pi),
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
)
def test_a_thin_wall_is_one_line_from_end_to_end(length, part, yaw, x, y):
    view = View(0, 0, 0.5, 24, 12)
    grid = owners(masks([wall(length, part * view.scale, yaw, x, y)], view), view) != EMPTY
    for away in np.arange(-length / 2 + 0.3, length / 2 - 0.3, 0.2):
        column, row = view.pixels(np.array([(x + away * math.cos(yaw), y + away * math.sin(yaw))]))[0]
        if 1 <= column < 23 and 1 <= row < 23:
            near = grid[int(row) - 1 : int(row) + 2, int(column) - 1 : int(column) + 2]
            assert near.any(), away
    # One line, not a block.
    assert grid.sum() <= 2.2 * (min(length, 40) / view.scale + 2)


def test_far_and_endless_walls_are_cut_at_the_view():
    view = View(0, 0, 0.5, 24, 12)
    for length in (1e4, 1e6):
        grid = owners(masks([wall(length, 0.01, 0.3)], view), view)
        assert (grid != EMPTY).sum() in range(20, 60)


@given(gap=st.floats(0.05, 0.5), offset=st.floats(-1, 1))
def test_a_gap_between_platforms_is_seen_wherever_the_pixels_fall(gap, offset):
    view = View(offset, 0, 0.5, 24, 6)
    sides = [wall(6, 4, 0, x=sign * (3 + gap / 2)) for sign in (-1, 1)]
    prints = [Footprint(f"side{number}", each.polygons, each.low, each.high) for number, each in enumerate(sides)]
    names = frozenset(each.name for each in prints)
    palette = mixed(*DARK)
    for who in (Kept(names, names), Kept(frozenset({"other"}), frozenset())):
        canvas = Canvas(view.rows, view.columns, palette.back)
        fill(canvas, owners(masks(prints, view), view), looks(prints, who, palette))
        row = [(chr(char), int(back)) for char, back in zip(canvas.chars[3], canvas.back[3], strict=True)]
        inside = row[4:20]
        assert len(set(inside)) > 1, "no seam and no gap"
