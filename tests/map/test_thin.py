"""Models thinner than a pixel are drawn without gaps, and gaps between models stay seen, wherever the pixels fall."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ddenv.map.footprints import Footprint
from ddenv.map.paint import Canvas
from ddenv.map.raster import EMPTY, View, masks, owners
from ddenv.workbench.map.map_colors import mixed
from ddenv.workbench.map.model_looks import Kept, fill, looks

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
        fill(canvas, owners(masks(prints, view), view), looks(prints, who, *DARK, palette))
        row = [(chr(char), int(back)) for char, back in zip(canvas.chars[3], canvas.back[3], strict=True)]
        inside = row[4:20]
        assert len(set(inside)) > 1, "no seam and no gap"
