"""How many tests each algorithm and each pair needs, compared with the bound and with picire's
ddmin.

    python benchmarks/tests_needed.py [--worlds N] [--large-worlds N] [--jobs N]
                                      [--only algorithms|pairs]

Random worlds without a robot: n models on 20 x 20 m; the failure needs k of them. The chance to be
needed falls with the distance to the place of the failure, by a factor of e every 2 m. The oracle
is monotone; the flaky one shows the failure in 80 % of the runs in which all needed models are
there, and a candidate without it is run up to three times more.

The bound is max(k + 1, log2 C(n, k)): the bits needed to find one of equally likely sets of k
models, and the tests needed to leave each needed model out once. Knowing that needed models are
near the failure can beat it. Needs `pip install '.[bench]'`.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

import ddenv
from ddenv.schemas import pairs, split_pair

SIZES = ((43, 2), (36, 4), (25, 6), (200, 5), (5000, 5))
WIDTH, FALLOFF, VIEW = 20.0, 2.0, 3.0  # m
RATE, RERUNS = 0.8, 3
PAPER = {"growth": "paper", "skip": "known"}
ALGORITHMS = {
    "ddenv": {},
    "ddenv, far-first": {"complement_order": "far-first"},
    "ddenv, learner": {"partitioning": "learner"},
    "ddenv as printed": PAPER,
    "ddenv as printed, far-first": PAPER | {"complement_order": "far-first"},
    "ddenv as printed, learner": PAPER | {"partitioning": "learner"},
    "ddmin": {"algorithm": "ddmin"},
    "probdd": {"algorithm": "probdd"},
    "probdd, uniform prior": {"algorithm": "probdd", "prior": "uniform"},
    "splitting": {"algorithm": "splitting"},
    "picire's ddmin": None,
}


@dataclass(frozen=True)
class World:
    """`evidence` are its arguments for `ddenv.reduce`."""

    elements: tuple[str, ...]
    needed: frozenset[str]
    evidence: dict


def make_world(n: int, k: int, seed: int) -> World:
    rng = np.random.default_rng([n, k, seed])
    places = np.column_stack([rng.uniform(0, WIDTH, (n, 2)), np.zeros(n)])
    failure = np.array([*rng.uniform(0.25 * WIDTH, 0.75 * WIDTH, 2), 0.0])
    weights = np.exp(-np.linalg.norm(places - failure, axis=1) / FALLOFF)
    elements = tuple(f"m{index}" for index in range(n))
    needed = rng.choice(n, k, replace=False, p=weights / weights.sum())
    trajectory = _drive(np.array([0.0, rng.uniform(0, WIDTH), 0.0]), failure, rng)
    apart = np.linalg.norm(places[:, None, :2] - trajectory[None, ::5, 1:3], axis=2) < VIEW
    sensed = {
        elements[index]: float(trajectory[::5, 0][apart[index].argmax()])
        for index in np.flatnonzero(apart.any(1))
    }
    evidence = {
        "positions": dict(zip(elements, map(tuple, places.tolist()), strict=True)),
        "trajectory": trajectory,
        "first_sensed": sensed,
    }
    return World(elements, frozenset(elements[index] for index in needed), evidence)


def _drive(start: np.ndarray, failure: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """15 s on a bend to the place of the failure, and as long stuck there; shape (301, 5)."""
    times = np.linspace(0, 30, 301)
    part = np.clip(times / 15, 0, 1)[:, None]
    bend = (start + failure) / 2 + np.array([*rng.normal(0, 3, 2), 0.0])
    path = (1 - part) ** 2 * start + 2 * part * (1 - part) * bend + part**2 * failure
    yaw = np.arctan2(np.gradient(path[:, 1]), np.gradient(path[:, 0]))
    return np.column_stack([times, path, yaw])


def oracle(world: World, flaky: bool, seed: int) -> Callable[[frozenset[str]], bool]:
    rng = np.random.default_rng([seed, 1])
    return lambda kept: world.needed <= kept and (not flaky or bool(rng.random() < RATE))


def tests_of(world: World, options: dict | None, flaky: bool, seed: int) -> tuple[int, bool]:
    """How many tests were made, and whether exactly the needed models are left."""
    test = oracle(world, flaky, seed)
    if options is None:
        return _picire(world, test, RERUNS if flaky else 0)
    iterations = RERUNS if flaky else 0
    rule = {"iterations": iterations, "accept_rate": "first", "check": flaky}
    found = ddenv.reduce(world.elements, test, seed=seed, **rule, **world.evidence, **options)
    return found.search_tests, set(found.kept) == world.needed


def _picire(
    world: World, test: Callable[[frozenset[str]], bool], iterations: int
) -> tuple[int, bool]:
    """picire asks again whether its configuration still fails before each step; what is known is
    not counted twice.
    """
    import picire

    known: dict[frozenset[str], bool] = {frozenset(world.elements): True}
    made = 0

    def run(config: list[str], _: tuple) -> picire.Outcome:
        nonlocal made
        kept = frozenset(config)
        if kept not in known:
            for _run in range(1 + iterations):
                made += 1
                known[kept] = test(kept)
                if known[kept]:
                    break
        return picire.Outcome.FAIL if known[kept] else picire.Outcome.PASS

    left = picire.DD(run, cache=picire.ConfigCache())(list(world.elements))
    return made, set(left) == world.needed


def mean_of(task: tuple[tuple[int, int], dict | None, bool, int]) -> tuple[float, float]:
    """Mean number of tests over some worlds, and in how many % exactly the needed models were
    left.
    """
    size, options, flaky, worlds = task
    results = [tests_of(make_world(*size, seed), options, flaky, seed) for seed in range(worlds)]
    return float(np.mean([tests for tests, _ in results])), 100 * float(
        np.mean([right for _, right in results])
    )


def bound(n: int, k: int) -> float:
    return max(k + 1, math.log2(math.comb(n, k)))


def table(
    what: str, rows: dict[str, dict | None], worlds: int, large_worlds: int, jobs: int
) -> None:
    """One row each, over `worlds` worlds, of 5,000 models `large_worlds`.

    Deterministic / flaky, and for the flaky oracle how often the result was right.
    """
    print(f"| {what} | " + " | ".join(f"{n}, {k}" for n, k in SIZES) + " | flaky: right, % |")
    print("|---|" + "---|" * (len(SIZES) + 1))
    print("| bound | " + " | ".join(f"{bound(*size):.1f}" for size in SIZES) + " | |", flush=True)
    with get_context("spawn").Pool(jobs) as pool:
        for name, options in rows.items():
            counts = [min(worlds, large_worlds) if n > 1000 else worlds for n, _ in SIZES]
            tasks = [
                (size, options, flaky, count)
                for size, count in zip(SIZES, counts, strict=True)
                for flaky in (False, True)
            ]
            # The long ones first, so that no worker waits for the last of them.
            results = pool.map(mean_of, tasks[::-1], chunksize=1)[::-1]
            cells = [
                f"{plain[0]:.1f} / {flaky[0]:.0f}"
                for plain, flaky in zip(results[::2], results[1::2], strict=True)
            ]
            right = np.mean([share for _, share in results[1::2]])
            print(
                f"| {name} | " + " | ".join(cells) + f" | {right:.1f} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--worlds", type=int, default=200)
    parser.add_argument("--large-worlds", type=int, default=200, help="of 5,000 models")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", choices=("algorithms", "pairs"))
    options = parser.parse_args()
    if options.only in (None, "algorithms"):
        table("tests, n and k", ALGORITHMS, options.worlds, options.large_worlds, options.jobs)
    if options.only in (None, "pairs"):
        asked = {
            pair: dict(zip(("partitioning", "prioritization"), split_pair(pair), strict=True))
            for pair in pairs()
        }
        table("tests of ddenv, n and k", asked, options.worlds, options.large_worlds, options.jobs)


if __name__ == "__main__":
    main()
