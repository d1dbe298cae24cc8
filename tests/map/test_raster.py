"""Models and paths as pixels and cells; thousands of models at once are drawn as each one would be
by itself.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.map.footprints import Footprint, footprints
from ddenv.map.paint import Canvas
from ddenv.map.raster import (
    EMPTY,
    SHORT,
    View,
    arrow,
    braille,
    extent,
    fit,
    label_cells,
    masks,
    owners,
)
from ddenv.workbench.map.map_colors import mixed
from ddenv.workbench.map.model_looks import Kept, fill, looks
from ddenv.world.extent import polygon_area
from ddenv.world.hull import convex_outline
from ddenv.world.pose import heading
from tests.map.worlds import GROUND, box, world_of
from tests.tiers import examples

VIEW = View(x=0.0, y=0.0, scale=0.5, columns=20, rows=8)


def prints_of(*models: str):
    return footprints(world_of(*models))


def grid_of(*models: str, view: View = VIEW):
    return owners(masks(prints_of(*models), view), view)


def test_up_is_the_greater_y_and_right_the_greater_x():
    assert VIEW.cell(4.9, 3.9) == (0, 19)
    assert VIEW.cell(-4.9, -3.9) == (7, 0)
    assert VIEW.cell(5.1, 0) is None


def test_small_models_lie_on_top_of_large_ones():
    grid = grid_of(box("small", 0, 0, size=(1, 1, 1)), box("large", 0, 0, size=(6, 6, 1)))
    assert grid[8, 10] == 1
    assert grid[3, 5] == 0


def test_the_ground_is_not_drawn():
    names = [
        each.name
        for each in prints_of(GROUND, box("crate", 0, 0), box("floor", 0, 0, size=(15, 8, 0.02)))
    ]
    assert names == ["floor", "crate"]


def test_a_path_has_no_gaps():
    cells = braille(np.array([[-4.9, 0.1], [4.9, 0.1]]), VIEW)
    assert (cells.any(axis=0)).all()
    assert (cells > 0).sum() == 20


def test_the_first_dot_is_top_left():
    cells = braille(np.array([[-4.99, 3.99]]), VIEW)
    assert cells[0, 0] == 0x01


@pytest.mark.parametrize("points", [[], [[math.nan, 0.0]], [[1e9, 1e9], [-1e9, 1e9]]])
def test_what_cannot_be_seen_is_no_path(points):
    assert not braille(np.array(points, dtype=float).reshape(-1, 2), VIEW).any()


def test_a_fit_shows_all_models_and_points_in_proportion():
    prints = prints_of(box("a", 5, 0), box("b", -5, 1))
    view = fit(prints, [(0.0, 8.0)], 60, 15)
    for x, y in [(5.6, 0.4), (-5.6, 0.6), (0.0, 8.0)]:
        assert view.cell(x, y) is not None


def test_a_fit_clips_a_huge_model_and_is_ten_metres_for_nothing():
    prints = prints_of(box("hangar", 0, 0, size=(900, 900, 1)), box("a", 1, 1), box("b", 3, 2))
    view = fit(prints, [(0.0, 0.0)], 60, 15)
    assert view.scale * view.columns < 60
    assert fit((), (), 20, 10, margin=0).scale == pytest.approx(0.5)


def test_zooming_keeps_the_centre_and_has_an_end():
    assert VIEW.zoomed(2) == View(x=0, y=0, scale=0.25, columns=20, rows=8)
    assert VIEW.zoomed(1e9).scale > 0


@pytest.mark.parametrize(
    ("degrees", "sign"),
    [(0, "→"), (45, "↗"), (90, "↑"), (180, "←"), (-90, "↓"), (-45, "↘"), (359, "→")],
)
def test_arrows_point_where_the_robot_does(degrees, sign):
    half = math.radians(degrees) / 2
    assert arrow(heading((math.cos(half), 0, 0, math.sin(half)))) == sign


SMALL = View(x=0.3, y=-0.2, scale=0.5, columns=12, rows=6)
coordinates = st.floats(-6, 6).map(lambda value: round(value, 3))
clouds = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=7)
models = st.lists(st.lists(clouds, max_size=2), max_size=6)


def prints_of_shapes(shapes) -> list[Footprint]:
    prints = []
    for number, parts in enumerate(shapes):
        polygons = tuple(convex_outline(np.array(points)) for points in parts)
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
    # What is smaller than a pixel stays visible.
    boxes = [(polygon.min(axis=0), polygon.max(axis=0)) for polygon in each.polygons]
    small = [
        (low + high) / 2 for low, high in boxes if np.hypot(*(high - low)) <= SHORT * view.scale
    ]
    for middle in small if each.polygons else [each.center]:
        x, y = view.pixels(np.array([middle]))[0]
        if 0 <= x < view.columns and 0 <= y < 2 * view.rows:
            inside[int(y), int(x)], unsure[int(y), int(x)] = True, False
    return inside, unsure


@examples(0.3)
@given(models)
def test_all_models_fill_the_pixels_that_each_one_fills(shapes):
    prints = prints_of_shapes(shapes)
    expected, unsure = (
        np.full((2 * SMALL.rows, SMALL.columns), EMPTY),
        np.zeros((2 * SMALL.rows, SMALL.columns), dtype=bool),
    )
    for index, each in enumerate(prints):
        inside, doubtful = slowly(each, SMALL)
        expected[inside] = index
        unsure |= doubtful
    grid = owners(masks(prints, SMALL), SMALL)
    assert (grid == expected)[~unsure].all()


@given(models, st.lists(st.integers(0, 5), max_size=4, unique=True))
def test_of_the_drawn_models_the_last_one_is_on_top(shapes, wanted):
    prints = prints_of_shapes(shapes)
    drawn = [index for index in sorted(wanted) if index < len(prints)]
    expected = np.full((2 * SMALL.rows, SMALL.columns), EMPTY)
    for index in drawn:
        alone = owners(masks(prints[index : index + 1], SMALL), SMALL)
        expected[alone == 0] = index
    assert (owners(masks(prints, SMALL), SMALL, drawn) == expected).all()


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
    prints = prints_of_shapes(shapes)
    low, high = np.array([math.inf] * 2), np.array([-math.inf] * 2)
    for point in points:
        low, high = np.minimum(low, point), np.maximum(high, point)
    for number, each in enumerate(sorted(prints, key=lambda each: each.area)):
        spread = np.maximum(high - low, 4.0)
        # The smallest one is never huge.
        if number and each.area > 4 * spread[0] * spread[1]:
            break
        low, high = np.minimum(low, each.low), np.maximum(high, each.high)
    found = extent(prints, points)
    if not np.isfinite(low).all():
        low, high = np.array([-5.0, -5.0]), np.array([5.0, 5.0])
    assert (found[0] == low).all()
    assert (found[1] == high).all()


def test_a_building_around_a_short_way_is_seen_whole():
    wall = np.array([[-9.0, -5.0], [9.0, -5.0], [9.0, 5.0], [-9.0, 5.0]])
    low, high = extent(
        [Footprint("house", (wall,), (-9.0, -5.0), (9.0, 5.0))], [(0.0, 0.0), (1.0, 0.0)]
    )
    assert (low.tolist(), high.tolist()) == ([-9.0, -5.0], [9.0, 5.0])


def test_many_large_models_on_top_of_each_other_are_drawn_in_parts(monkeypatch):
    monkeypatch.setattr("ddenv.map.raster.MOST_PIXELS", 100)
    square = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])
    prints = [Footprint(f"m{number}", (square,), (-9.0, -9.0), (9.0, 9.0)) for number in range(9)]
    grid = owners(masks(prints, SMALL), SMALL)
    assert set(np.unique(grid)) == {8}


# Models thinner than a pixel are drawn without gaps, and gaps between models stay seen, wherever
# the pixels fall.

DARK = (15, 20, 27), (213, 219, 229)


def wall(length: float, width: float, yaw: float, x: float = 0.0, y: float = 0.0) -> Footprint:
    corners = np.array([(-length, -width), (length, -width), (length, width), (-length, width)]) / 2
    turned = corners @ np.array(
        [(math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))]
    ) + (x, y)
    return Footprint(
        "wall", (turned,), tuple(turned.min(axis=0).tolist()), tuple(turned.max(axis=0).tolist())
    )


@given(
    length=st.floats(2.5, 30),
    part=st.floats(0.001, 0.9),
    yaw=st.floats(-math.pi, math.pi),
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
)
def test_a_thin_wall_is_one_line_from_end_to_end(length, part, yaw, x, y):
    view = View(x=0, y=0, scale=0.5, columns=24, rows=12)
    grid = owners(masks([wall(length, part * view.scale, yaw, x, y)], view), view) != EMPTY
    for away in np.arange(-length / 2 + 0.3, length / 2 - 0.3, 0.2):
        column, row = view.pixels(np.array([(x + away * math.cos(yaw), y + away * math.sin(yaw))]))[
            0
        ]
        if 1 <= column < 23 and 1 <= row < 23:
            near = grid[int(row) - 1 : int(row) + 2, int(column) - 1 : int(column) + 2]
            assert near.any(), away
    # One line, not a block.
    assert grid.sum() <= 2.2 * (min(length, 40) / view.scale + 2)


def test_far_and_endless_walls_are_cut_at_the_view():
    view = View(x=0, y=0, scale=0.5, columns=24, rows=12)
    for length in (1e4, 1e6):
        grid = owners(masks([wall(length, 0.01, 0.3)], view), view)
        assert (grid != EMPTY).sum() in range(20, 60)


@given(gap=st.floats(0.05, 0.5), offset=st.floats(-1, 1))
def test_a_gap_between_platforms_is_seen_wherever_the_pixels_fall(gap, offset):
    view = View(x=offset, y=0, scale=0.5, columns=24, rows=6)
    sides = [wall(6, 4, 0, x=sign * (3 + gap / 2)) for sign in (-1, 1)]
    prints = [
        Footprint(f"side{number}", each.polygons, each.low, each.high)
        for number, each in enumerate(sides)
    ]
    names = frozenset(each.name for each in prints)
    palette = mixed(*DARK)
    for who in (
        Kept(elements=names, environment=names),
        Kept(elements=frozenset({"other"}), environment=frozenset()),
    ):
        canvas = Canvas(view.rows, view.columns, palette.back)
        fill(canvas, owners(masks(prints, view), view), looks(prints, who, palette))
        row = [
            (chr(char), int(back))
            for char, back in zip(canvas.chars[3], canvas.back[3], strict=True)
        ]
        inside = row[4:20]
        assert len(set(inside)) > 1, "no seam and no gap"
