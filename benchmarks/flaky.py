"""What a reduction is worth when the failure does not show in every run: does its end keep the
rate, and is that what it says?

    python benchmarks/flaky.py [--reductions N] [--jobs N] [--only TEXT] [--algorithm NAME]

Models on a line, without a robot; those near the place of the failure are likelier to be needed.
Each oracle knows the true rate of the failure in every selection of models, and draws each run
independently. `first` takes what shows the failure once in four runs, as the paper does, and has no
certificate; `kept` is the default of `ddenv.reduce`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from multiprocessing import get_context
from statistics import fmean

import numpy as np

import ddenv
from ddenv.evidence.certificate import NEEDED_SHARE

KEEP_RATE, CERTIFY_RATE, ITERATIONS, BASELINE_RUNS = 0.8, 2 / 3, 3, 10
# Rates that are products must not fall below a limit by rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Oracle:
    """The true rate of the failure in each selection. Without one of `needed` it (nearly) never
    shows; those `useful` raise it.
    """

    rate: Callable[[frozenset[str]], float]
    needed: frozenset[str]
    useful: frozenset[str] = frozenset()


def steady(rate: float, needed: int, spurious: float = 0.0) -> Callable[[list[str]], Oracle]:
    """The same rate with all needed models, and another failure in the same place in a share
    `spurious` of all runs.
    """

    def make(drawn: list[str]) -> Oracle:
        all_needed = frozenset(drawn[:needed])
        return Oracle(
            lambda kept: spurious + (1 - spurious) * rate if kept >= all_needed else spurious,
            all_needed,
        )

    return make


def drifting(low: float) -> Callable[[list[str]], Oracle]:
    """Needs one model; one of two boards is enough to show the failure at a low rate, both show it
    always.
    """

    def make(drawn: list[str]) -> Oracle:
        needed, boards = frozenset(drawn[:1]), frozenset(drawn[1:3])
        return Oracle(
            lambda kept: (0.0, low, 1.0)[len(boards & kept)] if kept >= needed else 0.0,
            needed,
            boards,
        )

    return make


def like_rubble(drawn: list[str]) -> Oracle:
    """Needs one model; each of two others raises the rate."""
    needed, (one, other) = frozenset(drawn[:1]), drawn[1:3]
    rates = {(True, True): 0.97, (False, True): 0.6, (True, False): 0.25, (False, False): 0.15}
    return Oracle(
        lambda kept: rates[one in kept, other in kept] if kept >= needed else 0.0,
        needed,
        frozenset({one, other}),
    )


def graded(factor: float) -> Callable[[list[str]], Oracle]:
    """Needs one model; without each of five others the rate falls by a factor."""

    def make(drawn: list[str]) -> Oracle:
        needed, useful = frozenset(drawn[:1]), frozenset(drawn[1:6])
        return Oracle(
            lambda kept: 0.95 * factor ** len(useful - kept) if kept >= needed else 0.0,
            needed,
            useful,
        )

    return make


ORACLES: dict[str, tuple[int, Callable[[list[str]], Oracle]]] = {
    "p = 1": (36, steady(1.0, 4)),
    "p = 0.95": (36, steady(0.95, 4)),
    "p = 0.8": (36, steady(0.8, 4)),
    "p = 0.65": (36, steady(0.65, 4)),
    "p = 0.5": (36, steady(0.5, 4)),
    "drift to 25 %": (30, drifting(0.25)),
    "drift to 15 %": (30, drifting(0.15)),
    "like rubble": (40, like_rubble),
    "graded, 0.8 each": (25, graded(0.8)),
    "graded, 0.9 each": (25, graded(0.9)),
    "a rare second failure": (30, steady(0.95, 3, 0.03)),
}
COLUMNS = (
    "keeps 0.8, %",
    "needed lost, %",
    "needless",
    "minimal, %",
    "baseline",
    "search",
    "certificate",
    "wrong: kept, %",
    "wrong: needed, %",
    "intervals cover, %",
)


@dataclass(frozen=True)
class Task:
    oracle: str
    rule: str
    algorithm: str
    seed: int


def reduction(task: Task) -> list[float]:
    """One value for each of `COLUMNS`; where no claim says anything of the kind, the value is
    nan.
    """
    n, make = ORACLES[task.oracle]
    rng = np.random.default_rng([task.seed, *task.oracle.encode()])
    names = [f"m{index}" for index in range(n)]
    weights = 0.1 + np.linspace(1 / n, 1, n) ** 2
    oracle = make(rng.choice(names, 6, replace=False, p=weights / weights.sum()).tolist())
    whole = frozenset(names)

    def test(kept: frozenset[str]) -> bool:
        return bool(rng.random() < oracle.rate(kept))

    found = ddenv.reduce(
        names,
        test,
        algorithm=task.algorithm,
        positions={name: (float(index), 0.0, 0.0) for index, name in enumerate(names)},
        trajectory=np.array([[0.0, 0.0, 0.0, 0.0, 0.0], [30.0, n, 0.0, 0.0, 0.0]]),
        iterations=ITERATIONS,
        accept_rate=task.rule,
        keep_rate=KEEP_RATE,
        certify_rate=CERTIFY_RATE,
        baseline_runs=BASELINE_RUNS,
        check=False,
        seed=task.seed,
    )
    claims = found.claims
    left = frozenset(found.kept)
    most = NEEDED_SHARE * oracle.rate(left) + ROUNDING

    def true_rate(without: str | None) -> float:
        return oracle.rate(left - {without})

    said = {claim.verdict: claim for claim in claims}
    needed = [claim for claim in claims if claim.verdict == "needed"]
    return [
        100.0 * (oracle.rate(left) >= KEEP_RATE * oracle.rate(whole) - ROUNDING),
        100.0 * (not left >= oracle.needed),
        len(left - oracle.needed - oracle.useful),
        100.0 * all(claim.verdict in ("kept", "needed") for claim in claims) if claims else nan,
        found.baseline_tests,
        found.search_tests,
        found.certificate_tests,
        100.0 * (true_rate(None) < CERTIFY_RATE * oracle.rate(whole) - ROUNDING)
        if "kept" in said
        else nan,
        100.0 * any(true_rate(claim.without) > most for claim in needed) if needed else nan,
        100.0 * fmean(claim.low <= true_rate(claim.without) <= claim.high for claim in claims)
        if claims
        else nan,
    ]


def cells(results: Sequence[Sequence[float]]) -> list[str]:
    """The mean of each column, over the reductions that have a value."""
    means = [
        float(np.nanmean(column)) if not np.isnan(column).all() else None
        for column in np.transpose(results)
    ]
    return [
        ""
        if mean is None
        else f"{mean:.2f}"
        if name == "needless"
        else f"{mean:.0f}"
        if name in COLUMNS[4:7]
        else f"{mean:.1f}"
        for name, mean in zip(COLUMNS, means, strict=True)
    ]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--reductions", type=int, default=400, help="of each oracle with each rule")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="only oracles with this in their name")
    parser.add_argument("--rule", choices=("first", "kept"))
    parser.add_argument("--algorithm", default="splitting")
    options = parser.parse_args()
    print("| oracle | rule | " + " | ".join(COLUMNS) + " |")
    print("|---|---|" + "---|" * len(COLUMNS), flush=True)
    with get_context("spawn").Pool(options.jobs) as pool:
        for name in (one for one in ORACLES if options.only in one):
            for rule in ("first", "kept"):
                if options.rule not in (None, rule):
                    continue
                tasks = [
                    Task(name, rule, options.algorithm, seed) for seed in range(options.reductions)
                ]
                results = pool.map(reduction, tasks, chunksize=4)
                print(f"| {name} | {rule} | " + " | ".join(cells(results)) + " |", flush=True)


if __name__ == "__main__":
    main()
