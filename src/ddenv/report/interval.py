"""The failure rate of the whole world with its interval, on a line from 0 to 100 %."""

from __future__ import annotations

from ddenv.report.numbers import percent
from ddenv.runfile.state import Baseline

WIDTH, HEIGHT, LEFT, RIGHT, LINE = 880.0, 58.0, 20.0, 36.0, 26.0


def interval(base: Baseline) -> str:
    """The line as SVG, its colours as classes of `style.css`."""

    def at(rate: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * min(1.0, max(0.0, rate))

    ticks = "".join(
        f'<path class="grid" d="M{at(each):.1f} {LINE - 9}v18"/>'
        f'<text class="tick" x="{at(each):.1f}" y="{LINE + 26}" text-anchor="middle">{percent(each)}</text>'
        for each in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" role="img" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}">'
        f'{ticks}<path class="grid" d="M{at(0):.1f} {LINE}H{at(1):.1f}"/>'
        f'<path class="span" d="M{at(base.low):.1f} {LINE}H{at(base.high):.1f}"/>'
        f'<circle class="dot" cx="{at(base.rate):.1f}" cy="{LINE}" r="6"/>'
        f'<text class="said" x="{at(base.rate):.1f}" y="{LINE - 13}" text-anchor="middle">{percent(base.rate)}</text></svg>'
    )
