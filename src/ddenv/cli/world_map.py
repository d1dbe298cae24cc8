"""The map of a world on a terminal: a picture in a frame with axes, and a legend of its models."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import zip_longest

import numpy as np

from ddenv.map.cells import picture, signs
from ddenv.map.colors import PLAIN
from ddenv.map.drawing import tick_step, tick_text, ticks
from ddenv.map.footprints import plan
from ddenv.map.paint import Canvas, Run
from ddenv.map.raster import FINEST, View, arrow, extent
from ddenv.text import count, padded, shortened, width
from ddenv.world.model import World
from ddenv.world.pose import Point

# Columns for numbers and frame beside the picture, and lines above and below it: title, frame,
# frame, numbers.
NUMBERS = 6
AXIS = 8
AROUND = 4
LEAST_COLUMNS = 40
LEAST_ROWS = 12
LONGEST_NAME = 28
SHORTEST_NAME = 14
HEADER = (" ", "model", "centre x, y, m", "size, m")
GAP = "  "
START = 0x1F6FEB
GOAL = 0x1A7F37
WHITE = 0xFFFFFF

Entry = tuple[str, str, str, str]
# x, y m, and yaw rad.
Pose = tuple[float, float, float]


def terminal_map(
    world: World,
    columns: int,
    rows: int,
    *,
    color: bool,
    spawn: Pose | None = None,
    goal: Point | None = None,
    dim: frozenset[str] = frozenset(),
) -> str:
    """The world from above, without its ground: at most `rows` lines of at most `columns`
    characters (not less than 12 and 40).

    With `color` models are blocks of 24-bit colour; without, there is not one escape code, and
    models are areas of their letters. `spawn` is x, y (m) and yaw (rad), `goal` x, y (m), if they
    should be marked; all finite. Of the models `dim` there are only faint areas.
    """
    columns = max(columns, LEAST_COLUMNS)
    rows = max(rows, LEAST_ROWS)
    models = plan(world)
    low, high = extent(
        [each.outline for each in models],
        [point[:2] for point in (spawn, goal) if point is not None],
    )
    margin = np.maximum(0.3, 0.03 * (high - low))
    low = low - margin
    high = high + margin
    entries = []
    for sign, each in sorted(
        zip(signs(models), models, strict=True), key=lambda each: -each[1].outline.area
    ):
        if each.model.name in dim:
            continue
        x, y, _ = each.center
        size = "no shapes"
        if any(each.size):
            size = " x ".join(f"{part:.2f}" for part in each.size)
        entries.append((sign, each.model.name, f"{x:.2f}, {y:.2f}", size))
    legend = _legend(entries, columns, max(3, rows // 3))
    view = _view(low, high, columns - AXIS, rows - AROUND - len(legend))
    canvas = picture(models, view, color=color, dim=dim)
    fore = WHITE if color else PLAIN
    title = [world.path.name, count(len(models), "model")]
    if spawn is not None:
        title.append(f"S start ({spawn[0]:g}, {spawn[1]:g}), yaw {spawn[2]:g}")
        canvas.put(view.cell(*spawn[:2]), f"S{arrow(spawn[2])}", fore, START if color else None)
    if goal is not None:
        title.append(f"G goal ({goal[0]:g}, {goal[1]:g})")
        canvas.put(view.cell(*goal), "G", fore, GOAL if color else None)
    return "\n".join(
        [shortened(" · ".join(title), columns), *_framed(canvas, view, color), *legend]
    )


def _view(low: np.ndarray, high: np.ndarray, columns: int, rows: int) -> View:
    """At most so many cells, as many as the world needs, so that the frame fits tightly."""
    wide, tall = (high - low).tolist()
    scale = max(wide / columns, tall / (2 * rows), FINEST)
    x, y = ((low + high) / 2).tolist()
    needs = math.ceil(wide / scale - 1e-6)
    need_rows = math.ceil(tall / (2 * scale) - 1e-6)
    return View(
        x=x,
        y=y,
        scale=scale,
        columns=min(columns, max(2 * NUMBERS, needs)),
        rows=min(rows, max(3, need_rows)),
    )


# The legend.


def _legend(entries: Sequence[Entry], columns: int, most: int) -> list[str]:
    """At most `most` lines below the map with as many models as fit, from top to bottom and then
    from left to right.
    """
    if not entries:
        return []
    widths = [max(map(width, column)) for column in zip(HEADER, *entries, strict=True)]
    rest = sum(widths) - widths[1] + 3 * len(GAP)
    widths[1] = max(SHORTEST_NAME, min(widths[1], LONGEST_NAME, columns - rest))
    blocks = max(1, (columns + 2 * len(GAP)) // (rest + widths[1] + 2 * len(GAP)))
    lines = min(most - 1, math.ceil(len(entries) / blocks))
    shown = entries if len(entries) <= lines * blocks else entries[: lines * blocks - 1]
    cells = [_cell(entry, widths) for entry in shown]
    if more := len(entries) - len(shown):
        cells.append(shortened(f"... and {more} more (--svg FILE names them)", columns))
    stacks = [
        [_cell(HEADER, widths), *cells[start : start + lines]]
        for start in range(0, len(cells), lines)
    ]
    return [
        shortened((2 * GAP).join(row).rstrip(), columns)
        for row in zip_longest(*stacks, fillvalue="")
    ]


def _cell(entry: Entry, widths: Sequence[int]) -> str:
    sign, name, center, size = entry
    left = f"{padded(sign, widths[0])}{GAP}{padded(shortened(name, widths[1]), widths[1])}"
    return f"{left}{GAP}{center:>{widths[2]}}{GAP}{size:>{widths[3]}}"


# The frame.


def _framed(canvas: Canvas, view: View, color: bool) -> Iterator[str]:
    """The lines of the picture with its frame and its axes; all are equally wide."""
    wide = view.columns * view.scale / 2
    high = view.rows * view.scale
    x_step = tick_step(2 * wide, max(1, view.columns // 8))
    y_step = tick_step(2 * high, max(1, view.rows // 4))
    x_ticks = ticks(view.x - wide, view.x + wide, x_step)
    y_ticks = ticks(view.y - high, view.y + high, y_step)
    across = {cell[1]: tick_text(x, x_step) for x in x_ticks if (cell := view.cell(x, view.y))}
    down = {cell[0]: tick_text(y, y_step) for y in y_ticks if (cell := view.cell(view.x, y))}
    yield f"{'y, m':>{NUMBERS}}┌{'─' * view.columns}┐"
    for row in range(view.rows):
        number, corner = (down[row], "┤") if row in down else ("", "│")
        cells = "".join(map(_escaped, canvas.runs(row))) if color else canvas.text(row)
        yield f"{number[:NUMBERS]:>{NUMBERS}}{corner}{cells}│"
    axis = "".join("┬" if column in across else "─" for column in range(view.columns))
    yield f"{'':>{NUMBERS}}└{axis}┘"
    # The numbers along x, each below its place.
    full = view.columns + AXIS
    line = [" "] * full
    for column, text in across.items():
        start = NUMBERS + 1 + column - len(text) // 2
        if start + len(text) < full - 4:
            line[start : start + len(text)] = text
    line[-4:] = "x, m"
    yield "".join(line)


def _escaped(run: Run) -> str:
    """A run in its colours; the terminal's own need no code."""
    grounds = ((38, run.fore), (48, run.back))
    codes = [
        f"{ground};2;{color >> 16};{color >> 8 & 255};{color & 255}"
        for ground, color in grounds
        if color != PLAIN
    ]
    codes += ["1"] if run.bold else []
    if codes:
        return f"\x1b[{';'.join(codes)}m{run.text}\x1b[0m"
    return run.text
