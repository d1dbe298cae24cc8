"""Which workers of a cluster may make tests: those that compute the same bits as this machine."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ddenv import __version__
from ddenv.arrays import Floats
from ddenv.engine.cluster.made_there import Hello
from ddenv.engine.pool import Broken
from ddenv.engine.shared import machine, simulator
from ddenv.robot.result import RunResult


def refusal(hello: Hello, there: RunResult | Broken | None, here: RunResult | None) -> str:
    """Why a worker is left out whose first run of the whole world is `there`; "" if it may make tests.

    Without a run `here` to compare with, only the version of ddenv counts.
    """
    if hello.version != __version__:
        return f"it has ddenv {hello.version}, here is ddenv {__version__}"
    if here is None:
        return ""
    if isinstance(there, Broken):
        return f"its first run of the whole world broke: {there.failure}"
    if there is None or not same_bits(there, here):
        return f"its first run of the whole world has other bits than here; {_difference(hello)}"
    return ""


def _difference(hello: Hello) -> str:
    there = f"{hello.simulator}, {hello.machine}".split(", ")
    here = f"{simulator()}, {machine()}".split(", ")
    theirs = ", ".join(each for each in there if each not in here)
    ours = ", ".join(each for each in here if each not in there)
    return (
        f"it has {theirs}, here is {ours}" if theirs else "it says that it has the same versions and the same processor"
    )


def same_bits(one: RunResult, other: RunResult) -> bool:
    """Whether two runs of the same models with the same seed are the same to the last bit."""
    first, second = ((each.outcome, each.failure, each.cut, each.took_part) for each in (one, other))
    return first == second and _equal(_motions(one), _motions(other))


def _motions(run: RunResult) -> Mapping[str, Floats]:
    return {**run.motions, "": run.trajectory}


def _equal(one: Mapping[str, Floats], other: Mapping[str, Floats]) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)
