"""What `ddenv.reduce` costs and finds with its defaults, beside Shrink Ray where that is installed.

    python benchmarks/library.py [--worlds N] [--only TEXT] [--jobs N]

Worlds of 43, 100 and 200 models of which 2 or 5 are needed, without a robot (see tests_needed.py).
A row is a kind of failure, a column an algorithm: the calls of the test until it ended, mean
(worst); in how many % of the worlds all needed models are left, and nothing needless; the share of
the failure rate that is really kept, and in how many % the result says that it is not shown.

Shrink Ray needs Python 3.12. It reduces a file with a model in each line, in this process, with its
handling of flaky tests, and by its deletion of lines alone: all else has no use for a list of
names. Candidates that are no such list count as no calls. It needs neither Drake nor a language
model here:

    pip install --no-deps shrinkray
    pip install attrs chardet click humanize libcst numpy tree-sitter tree-sitter-language-pack trio
"""

from __future__ import annotations

import argparse
import random
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from multiprocessing import get_context
from statistics import fmean

import numpy as np
from tests_needed import World, make_world

import ddenv

SIZES = tuple((n, k) for n in (43, 100, 200) for k in (2, 5))
SHRINK_RAY = "Shrink Ray"
COLUMNS = (
    "splitting",
    "ddenv",
    "probdd",
    "ddmin",
    *((SHRINK_RAY,) if find_spec("shrinkray") else ()),
)
Test = Callable[[frozenset[str]], bool]


@dataclass(frozen=True)
class Failure:
    """The failure shows at `rate` where all needed models are there, `less` times as often without
    each of five more, and at the rate `second` elsewhere. Without two boards together it shows
    `drifts` times as often.
    """

    rate: float
    less: float = 1.0
    second: float = 0.0
    drifts: float = 1.0

    def in_kept(self, kept: frozenset[str], world: World, more: list[str]) -> float:
        """The true rate with these models."""
        if not world.needed <= kept:
            return self.second
        useful = set(more[:5]) - kept
        drifted = self.drifts if set(more[:2]) - kept else 1.0
        return self.second + (1.0 - self.second) * self.rate * self.less ** len(useful) * drifted


FAILURES = {
    "p = 1": Failure(1.0),
    "p = 0.8": Failure(0.8),
    "p = 0.5": Failure(0.5),
    "p = 0.3": Failure(0.3),
    "graded: five more models x 0.9": Failure(0.95, less=0.9),
    "a second failure in 3 %": Failure(0.95, second=0.03),
    "a second failure in 10 %": Failure(0.95, second=0.1),
    "drift to 25 %": Failure(1.0, drifts=0.25),
}


@dataclass(frozen=True)
class Task:
    failure: str
    column: str
    size: tuple[int, int]
    seed: int


@dataclass(frozen=True)
class Ending:
    """`verdict` is what the result says of the rate that is kept; "" where it says nothing."""

    calls: int
    left: frozenset[str]
    verdict: str


def by_ddenv(world: World, test: Test, algorithm: str, seed: int) -> Ending:
    """With the defaults of `ddenv.reduce`: nothing is said of the test beforehand."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = ddenv.reduce(world.elements, test, algorithm=algorithm, seed=seed, **world.evidence)
    return Ending(
        found.tests, frozenset(found.kept), found.claims[0].verdict if found.claims else ""
    )


def by_shrink_ray(world: World, test: Test, seed: int) -> Ending:
    """Raises UserError where it finds no failure to reduce."""
    import trio
    from shrinkray.nondeterminism import NondeterminismPolicy
    from shrinkray.passes.bytes import Split
    from shrinkray.passes.definitions import compose
    from shrinkray.passes.sequences import delete_elements
    from shrinkray.problem import BasicReductionProblem, InvalidInitialExample
    from shrinkray.reducer import ShrinkRay
    from shrinkray.work import WorkContext

    calls = 0

    def names(file: bytes) -> frozenset[str]:
        return frozenset(file.decode(errors="replace").splitlines())

    async def fails(file: bytes) -> bool:
        nonlocal calls
        if not names(file) <= set(world.elements):
            return False
        calls += 1
        return test(names(file))

    async def remember(file: bytes) -> None:
        history.append(file)

    whole = "\n".join(world.elements).encode()
    history = [whole]
    problem = BasicReductionProblem(
        whole,
        fails,
        WorkContext(random=random.Random(seed)),
        policy=NondeterminismPolicy(),
        history=history,
    )
    problem.on_reduce(remember)
    reducer = ShrinkRay(
        target=problem,
        initial_cuts=[],
        # One line after the other, larger blocks as that succeeds. Its blocks of all sizes took
        # twenty times as many calls.
        great_passes=[compose(Split(b"\n"), delete_elements)],
        ok_passes=[],
        last_ditch_passes=[],
        polish_passes=[],
        # A list of names is taken for Python.
        python_reducer=False,
        restart_at_fixpoint=False,
    )
    try:
        trio.run(reducer.run)
    except InvalidInitialExample as error:
        raise ddenv.UserError(str(error)) from None
    return Ending(calls, names(problem.current_test_case), "")


def one(task: Task) -> tuple[float, ...] | None:
    """Calls, whether the needed models are left, whether nothing needless is, the share of the
    rate, whether that is not shown.

    None where the failure did not show.
    """
    world, failure = make_world(*task.size, task.seed), FAILURES[task.failure]
    rng = np.random.default_rng([task.seed, *task.size])
    others = sorted(set(world.elements) - world.needed)
    more = rng.choice(others, 5, replace=False).tolist()
    calls = 0

    def test(kept: frozenset[str]) -> bool:
        nonlocal calls
        calls += 1
        return bool(rng.random() < failure.in_kept(kept, world, more))

    try:
        if task.column == SHRINK_RAY:
            ending = by_shrink_ray(world, test, task.seed)
        else:
            ending = by_ddenv(world, test, task.column, task.seed)
    except ddenv.UserError:
        return None
    useful = (
        set(more[:5]) if failure.less < 1.0 else set(more[:2]) if failure.drifts < 1.0 else set()
    )
    share = failure.in_kept(ending.left, world, more) / failure.in_kept(
        frozenset(world.elements), world, more
    )
    not_shown = ending.verdict not in ("", "kept")
    return (
        calls,
        ending.left >= world.needed,
        ending.left <= world.needed | useful,
        share,
        not_shown,
    )


def cell(results: list[tuple[float, ...] | None]) -> str:
    ended = [result for result in results if result is not None]
    if not ended:
        return "never showed"
    calls, needed, nothing_needless, share, not_shown = (
        list(column) for column in zip(*ended, strict=True)
    )
    words = (
        f"{fmean(calls):,.0f} ({max(calls):,}) "
        f"{100 * fmean(needed):.0f}/{100 * fmean(nothing_needless):.0f}"
    )
    words += f" {fmean(share):.2f}"
    words += f", {100 * fmean(not_shown):.0f} % not shown" if any(not_shown) else ""
    refused = len(results) - len(ended)
    return words + (f", {refused} refused" if refused else "")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--worlds", type=int, default=10, help="of each size")
    parser.add_argument("--only", default="", help="only failures with this in their name")
    parser.add_argument("--column", default="", help="only columns with this in their name")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    columns = [name for name in COLUMNS if options.column in name]
    print("| failure | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 1) + "|", flush=True)
    with get_context("spawn").Pool(options.jobs) as pool:
        for failure in (name for name in FAILURES if options.only in name):
            cells = []
            for column in columns:
                task = partial(Task, failure, column)
                tasks = [task(size, seed) for size in SIZES for seed in range(options.worlds)]
                cells.append(cell(pool.map(one, tasks, chunksize=1)))
            print(f"| {failure} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
