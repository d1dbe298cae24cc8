"""How many models were left after each test, as steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from ddenv.map.drawing import tick, tick_step, tick_text, ticks
from ddenv.runfile.state import RunState
from ddenv.text import count

WIDTH = 880.0
HEIGHT = 300.0
LEFT = 52.0
TOP = 26.0
RIGHT = 24.0
BOTTOM = 46.0

Steps = list[tuple[float, float]]
# Where (tests, models) is on the chart, pixels.
At = Callable[[float, float], tuple[float, float]]


def chart(state: RunState) -> str:
    """The chart as SVG, its colours as classes of `style.css`."""
    last = max(1, state.tests_done, *(point.tests for point in state.history))
    most = max(1, *(point.models for point in state.history))
    points = [*state.history, replace(state.history[-1], tests=last)]
    models = steps([(point.tests, point.models) for point in points])
    at = scale(last, most)
    line = path(models, at)
    first, floor = at(0, 0)
    end, _ = at(last, 0)
    parts = [
        opening(HEIGHT),
        *axes(at, last, most),
        f'<path class="area" d="M{first:.1f} {floor:.1f}L{line}L{end:.1f} {floor:.1f}Z"/>',
        f'<path class="steps" d="M{line}"/>',
    ]
    parts += _labels(state, at, last)
    return "\n".join([*parts, "</svg>"])


def opening(height: float) -> str:
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" class="drawing" role="img" viewBox="0 0 '
        f'{WIDTH:.0f} {height:.0f}">'
    )


def scale(last: int, most: int, height: float = HEIGHT) -> At:
    """Places on a chart of this height, pixels, for up to `last` tests and `most` models."""

    def at(tests: float, models: float) -> tuple[float, float]:
        x = LEFT + (WIDTH - LEFT - RIGHT) * tests / last
        return x, height - BOTTOM - (height - TOP - BOTTOM) * models / most

    return at


def path(corners: Sequence[tuple[float, float]], at: At) -> str:
    """A line through `corners` of tests and models, as in the `d` of an SVG path."""
    return "L".join(f"{x:.1f} {y:.1f}" for x, y in (at(*corner) for corner in corners))


def steps(points: Sequence[tuple[int, int]]) -> Steps:
    """Corners of a line through points of tests and models: each number holds until another one."""
    corners: Steps = list(points[:1])
    for tests, models in points:
        if models != corners[-1][1]:
            corners += [(tests, corners[-1][1]), (tests, models)]
    end = (points[-1][0], corners[-1][1])
    if corners[-1] == end:
        return corners
    return [*corners, end]


def axes(at: At, last: int, most: int) -> Iterator[str]:
    """Both axes up to `last` tests and `most` models; `at` gives x and y of a number of tests and
    of models, pixels.
    """
    right, floor = at(last, 0)
    step = max(1.0, tick_step(most, 6))
    for value in ticks(0, most, step):
        left, y = at(0, value)
        yield f'<path class="grid" d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
        yield tick(left - 7, y + 4, "end", tick_text(value, step))
    step = max(1.0, tick_step(last, 12))
    for value in ticks(0, last, step):
        yield tick(at(value, 0)[0], floor + 17, "middle", tick_text(value, step))
    yield tick(right, floor + 36, "end", "tests")
    yield tick(LEFT - 7, 13, "start", "models left")


def _labels(state: RunState, at: At, last: int) -> Iterator[str]:
    x, y = at(last, len(state.environment))
    for node in state.nodes:
        if node.how == "sliced":
            place, top = at(min(node.tests, last), len(node.environment))
            yield f'<circle class="dot" cx="{place:.1f}" cy="{top:.1f}" r="3"/>'
            yield f'<text class="tick" x="{place + 8:.1f}" y="{top - 6:.1f}">without a test</text>'
    yield f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>'
    words = f"{count(len(state.environment), 'model')} left"
    yield f'<text class="said" x="{x - 8:.1f}" y="{y - 10:.1f}" text-anchor="end">{words}</text>'
