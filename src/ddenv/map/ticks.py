"""Round numbers along an axis."""

from __future__ import annotations

import math


def tick_step(span: float, most: int) -> float:
    """The least of 1, 2, 5, 10, 20 ... (and 0.5, 0.2, 0.1 ...) m of which at most `most` fit into `span` m."""
    least = span / max(1, most)
    if not (math.isfinite(least) and least > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in (1, 2, 5, 10, 20) if power * factor >= least * (1 - 1e-9))


def ticks(low: float, high: float, step: float) -> list[float]:
    """The multiples of `step` from `low` to `high`, m."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # Adding zero makes -0.0 the same as 0.0.
    return [number * step + 0.0 for number in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """`value` with as many decimals as `step` needs."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{value:.{decimals}f}"
