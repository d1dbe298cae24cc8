"""The map of a world on a terminal: a picture in a frame with axes, and a legend of its models."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ddenv.map.cells import FAINT, picture, signs
from ddenv.map.colors import PLAIN
from ddenv.map.drawing import tick_step, tick_text, ticks
from ddenv.map.footprints import Drawn, plan
from ddenv.map.paint import Canvas, Run
from ddenv.map.raster import FINEST, View, arrow, extent
from ddenv.text import count, padded, shortened, width
from ddenv.world.model import World

# Columns for numbers and frame beside the picture, and lines above and below it: title, frame, frame, numbers.
NUMBERS, AXIS, AROUND = 6, 8, 4
LEAST_COLUMNS, LEAST_ROWS = 40, 12
LONGEST_NAME, SHORTEST_NAME = 28, 14
HEADER = (" ", "model", "centre x, y, m", "size, m")
GAP = "  "
START, GOAL, WHITE = 0x1F6FEB, 0x1A7F37, 0xFFFFFF

Entry = tuple[str, str, str, str]
# x, y m, and yaw rad.
Pose = tuple[float, float, float]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Layout:
    """The cells of the picture, and the lines of the legend, which stands `beside` the picture or below it."""

    columns: int
    rows: int
    legend_lines: int
    beside: bool


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
    """The world from above, without its ground: at most `rows` lines of at most `columns` characters (not less than 12 and 40).

    With `color` models are blocks of 24-bit colour; without, there is not one escape code, and models are areas of their letters.
    `spawn` is x, y (m) and yaw (rad), `goal` x, y (m), if they should be marked; all finite. Of the models `dim` there are only
    faint areas.
    """
    columns, rows = max(columns, LEAST_COLUMNS), max(rows, LEAST_ROWS)
    models = plan(world)
    low, high = extent([each.outline for each in models], [point[:2] for point in (spawn, goal) if point is not None])
    margin = np.maximum(0.3, 0.03 * (high - low))
    low, high = low - margin, high + margin
    entries = [entry for entry in _entries(models) if entry[1] not in dim]
    layout = _layout(high - low, columns, rows, entries)
    view = _view(low, high, layout)
    canvas = picture(models, view, color=color, dim=dim)
    _grid(canvas, view)
    _marks(canvas, view, spawn, goal, color)
    drawn = list(_framed(canvas, view, color))
    left = columns - AXIS - view.columns - len(GAP) if layout.beside else columns
    legend = _legend(entries, left, layout.legend_lines)
    title = shortened(_title(world, models, spawn, goal), columns)
    if not layout.beside:
        return "\n".join([title, *drawn, *legend])
    empty = " " * (view.columns + AXIS)
    height = max(len(drawn), len(legend))
    drawn += [empty] * (height - len(drawn))
    legend += [""] * (height - len(legend))
    return "\n".join([title, *(f"{line}{GAP}{text}".rstrip() for line, text in zip(drawn, legend, strict=True))])


def _title(world: World, models: Sequence[Drawn], spawn: Pose | None, goal: Point | None) -> str:
    words = [world.path.name, count(len(models), "model")]
    if spawn is not None:
        words.append(f"S start ({spawn[0]:g}, {spawn[1]:g}), yaw {spawn[2]:g}")
    if goal is not None:
        words.append(f"G goal ({goal[0]:g}, {goal[1]:g})")
    return " · ".join(words)


# The legend.


def _entries(models: Sequence[Drawn]) -> list[Entry]:
    """Sign, name, centre and size of each model, the largest first."""
    letters = signs(models)
    order = sorted(range(len(models)), key=lambda index: -models[index].outline.area)
    return [(letters[index], models[index].model.name, *_numbers(models[index])) for index in order]


def _numbers(each: Drawn) -> tuple[str, str]:
    (x, y, _), size = each.center, each.size
    words = " x ".join(f"{part:.2f}" for part in size) if each.outline.polygons else "no shapes"
    return f"{x:.2f}, {y:.2f}", words


def _widths(entries: Sequence[Entry], columns: int) -> list[int]:
    """The widths of the legend's columns: the names get the rest."""
    own = [max(map(width, column)) for column in zip(HEADER, *entries, strict=True)]
    own[1] = max(SHORTEST_NAME, min(own[1], LONGEST_NAME, columns - own[0] - own[2] - own[3] - 3 * len(GAP)))
    return own


def _legend(entries: Sequence[Entry], columns: int, most: int) -> list[str]:
    """At most `most` lines with as many models as fit, from top to bottom and then from left to right."""
    if not entries:
        return []
    widths = _widths(entries, columns)
    wide = sum(widths) + 3 * len(GAP)
    lines = most - 1
    blocks = max(1, (columns + 2 * len(GAP)) // (wide + 2 * len(GAP)))
    room = lines * blocks
    shown = entries if len(entries) <= room else entries[: room - 1]
    cells = [_cell(entry, widths) for entry in shown]
    if len(shown) < len(entries):
        cells.append(padded(_more(len(entries) - len(shown), columns), wide))
    stacks = [[_cell(HEADER, widths), *cells[start : start + lines]] for start in range(0, len(cells), lines)]
    height = max(map(len, stacks))
    rows = zip(*([*stack, *[""] * (height - len(stack))] for stack in stacks), strict=True)
    return [shortened((2 * GAP).join(row).rstrip(), columns) for row in rows]


def _more(number: int, columns: int) -> str:
    words = f"... and {number} more"
    remedy = f"{words} (--svg FILE names them)"
    return remedy if width(remedy) <= columns else words


def _cell(entry: Entry, widths: Sequence[int]) -> str:
    sign, name, center, size = entry
    left = f"{padded(sign, widths[0])}{GAP}{padded(shortened(name, widths[1]), widths[1])}"
    return f"{left}{GAP}{center:>{widths[2]}}{GAP}{size:>{widths[3]}}"


# The layout.


def _layout(spans: np.ndarray, columns: int, rows: int, entries: Sequence[Entry]) -> _Layout:
    """The layout with the larger map; `spans` is what it shows, m."""
    widths = _widths(entries, columns // 2)
    wide = sum(widths) + 3 * len(GAP)
    beside = _Layout(columns - AXIS - len(GAP) - wide, rows - AROUND, rows - 1, True)
    blocks = max(1, (columns + 2 * len(GAP)) // (wide + 2 * len(GAP)))
    lines = min(1 + math.ceil(len(entries) / blocks), max(3, rows // 3)) if entries else 0
    below = _Layout(columns - AXIS, rows - AROUND - lines, lines, False)
    if not entries or beside.columns < 2 * NUMBERS or _scale(spans, below) < _scale(spans, beside):
        return below
    return beside


def _scale(spans: np.ndarray, layout: _Layout) -> float:
    """Metres of one pixel, of which a cell has two, one above the other."""
    return max(float(spans[0]) / layout.columns, float(spans[1]) / (2 * layout.rows), FINEST)


def _view(low: np.ndarray, high: np.ndarray, layout: _Layout) -> View:
    """The number of cells that the world needs, so that the frame fits tightly."""
    scale = _scale(high - low, layout)
    x, y = ((low + high) / 2).tolist()
    columns = math.ceil((high[0] - low[0]) / scale - 1e-6)
    rows = math.ceil((high[1] - low[1]) / (2 * scale) - 1e-6)
    return View(x, y, scale, min(layout.columns, max(2 * NUMBERS, columns)), min(layout.rows, max(3, rows)))


# Axes and marks.


def _x_ticks(view: View) -> tuple[list[float], float]:
    span = view.columns * view.scale
    step = tick_step(span, max(1, view.columns // 8))
    return ticks(view.x - span / 2, view.x + span / 2, step), step


def _y_ticks(view: View) -> tuple[list[float], float]:
    span = 2 * view.rows * view.scale
    step = tick_step(span, max(1, view.rows // 4))
    return ticks(view.y - span / 2, view.y + span / 2, step), step


def _places(view: View) -> tuple[dict[int, str], dict[int, str]]:
    """The numbers along x by column, and along y by row."""
    (xs, x_step), (ys, y_step) = _x_ticks(view), _y_ticks(view)
    across = {view.cell(x, view.y): tick_text(x, x_step) for x in xs}
    down = {view.cell(view.x, y): tick_text(y, y_step) for y in ys}
    return {cell[1]: text for cell, text in across.items() if cell}, {
        cell[0]: text for cell, text in down.items() if cell
    }


def _grid(canvas: Canvas, view: View) -> None:
    """A dot on free ground where the lines of two numbers cross."""
    across, down = _places(view)
    for row in down:
        for column in across:
            if canvas.chars[row, column] == ord(" "):
                canvas.chars[row, column] = ord("·")
                canvas.fore[row, column] = FAINT


def _marks(canvas: Canvas, view: View, spawn: Pose | None, goal: Point | None, color: bool) -> None:
    signs: list[tuple[Pose | Point, str, int]] = [] if spawn is None else [(spawn, f"S{arrow(spawn[2])}", START)]
    signs += [] if goal is None else [(goal, "G", GOAL)]
    for point, sign, back in signs:
        canvas.put(view.cell(*point[:2]), sign, WHITE if color else PLAIN, back if color else None)


def _framed(canvas: Canvas, view: View, color: bool) -> Iterator[str]:
    """The lines of the picture with its frame; all are equally wide."""
    across, down = _places(view)
    yield f"{'y, m':>{NUMBERS}}┌{'─' * view.columns}┐"
    for row in range(view.rows):
        number, corner = (down[row], "┤") if row in down else ("", "│")
        cells = "".join(map(_escaped, canvas.runs(row))) if color else canvas.text(row)
        yield f"{number[:NUMBERS]:>{NUMBERS}}{corner}{cells}│"
    yield f"{'':>{NUMBERS}}└{''.join('┬' if column in across else '─' for column in range(view.columns))}┘"
    yield _under(across, view.columns)


def _under(across: dict[int, str], columns: int) -> str:
    """The numbers along x, each below its place."""
    full = columns + AXIS
    line = [" "] * full
    for column, text in across.items():
        start = NUMBERS + 1 + column - len(text) // 2
        if start + len(text) < full - 4:
            line[start : start + len(text)] = text
    line[-4:] = "x, m"
    return "".join(line)


def _escaped(run: Run) -> str:
    """A run in its colours; the terminal's own need no code."""
    codes = [_code(38, run.fore), _code(48, run.back), "1" if run.bold else ""]
    chosen = ";".join(filter(None, codes))
    return f"\x1b[{chosen}m{run.text}\x1b[0m" if chosen else run.text


def _code(ground: int, color: int) -> str:
    return "" if color == PLAIN else f"{ground};2;{color >> 16};{color >> 8 & 255};{color & 255}"
