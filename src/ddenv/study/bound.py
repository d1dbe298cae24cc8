"""The least number of tests that a method needs, however it chooses."""

from __future__ import annotations

import math


def least_to_show(models: int, needed: int, iterations: int, baseline_runs: int) -> int:
    """What it takes to show that `needed` of `models` models are minimal: no method needs less.

    After the baseline f has to show in what is left, once, and each of its models has to be left out in vain, for which a candidate
    is run `1 + iterations` times.
    """
    return baseline_runs + (1 if needed < models else 0) + needed * (1 + iterations)


def least_to_find(models: int, needed: int, iterations: int, baseline_runs: int) -> int:
    """What it takes on average to find them if each set of so many models is as likely to be the needed one.

    A candidate without f costs 1 + iterations tests, one with f at least one. So a test tells log2(1/x) bits at most, where
    x + x^(1 + iterations) = 1 (Kraft's inequality; a bit a test without re-runs), and log2 C(n, k) bits have to be told. A
    method that knows more, as that models near f are likelier, may need less.
    """
    told = math.log(math.comb(models, needed)) / -math.log(_root(1 + iterations))
    return max(baseline_runs + math.ceil(told - 1e-9), least_to_show(models, needed, iterations, baseline_runs))


def _root(cost: int) -> float:
    """x in (0, 1) with x + x^cost = 1."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if middle + middle**cost < 1 else (low, middle)
    return (low + high) / 2
