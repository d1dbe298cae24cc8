import math

import numpy as np
import pytest

from ddenv.map.footprints import footprints
from ddenv.map.raster import View, arrow, braille, fit, masks, owners
from ddenv.world.pose import heading
from tests.map.worlds import GROUND, box, world_of

VIEW = View(0.0, 0.0, 0.5, 20, 8)


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
    names = [each.name for each in prints_of(GROUND, box("crate", 0, 0), box("floor", 0, 0, size=(15, 8, 0.02)))]
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
    assert VIEW.zoomed(2) == View(0, 0, 0.25, 20, 8)
    assert VIEW.zoomed(1e9).scale > 0


@pytest.mark.parametrize(
    ("degrees", "sign"), [(0, "→"), (45, "↗"), (90, "↑"), (180, "←"), (-90, "↓"), (-45, "↘"), (359, "→")]
)
def test_arrows_point_where_the_robot_does(degrees, sign):
    half = math.radians(degrees) / 2
    assert arrow(heading((math.cos(half), 0, 0, math.sin(half)))) == sign
