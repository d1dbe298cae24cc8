"""Reads and folds the events of long runs and of a large round, without a robot, and compares with parsing their JSON.

    python benchmarks/folding.py

Every candidate of the long runs is run four times (once and three re-runs) and then judged, 100 candidates a round.
The large round has 5,000 partitions of one model each, and all its 10,000 candidates are judged without another test.
"""

import json
import time
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Any

from ddenv.environment import Environment
from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Recorded, recorded

MODELS = 5000
REPEATS = 3
RUNS = 4
Happened = tuple[str, dict[str, Any]]


def main() -> None:
    print("| what | events | fold, s | read, s | JSON, s | fold / JSON |")
    print("|---|---|---|---|---|---|")
    for tests in (10_000, 60_000):
        print(row(f"a run of {tests:,} tests", [created(), *long_run(tests)]), flush=True)
    before = fold(read(texts([created()])))
    started, *judged = large_round()
    print(row(f"a round of {MODELS:,} partitions starts", [started], before), flush=True)
    before = fold(read(texts([started])), before)
    print(row(f"its {2 * MODELS:,} candidates are judged", judged, before), flush=True)


def row(what: str, happened: list[Happened], before: RunState | None = None) -> str:
    """The best of some repeats: other work of the machine only adds time."""
    lines = texts(happened)
    parse = min(seconds(lambda: [json.loads(data) for _, data in lines]) for _ in range(REPEATS))
    reading = min(seconds(lambda: read(lines)) for _ in range(REPEATS))
    events = read(lines)
    folding = min(seconds(lambda: fold(events, before)) for _ in range(REPEATS))
    return f"| {what} | {len(events):,} | {folding:.3f} | {reading:.3f} | {parse:.3f} | {folding / parse:.1f} |"


def seconds(work) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def texts(happened: Iterable[Happened]) -> list[tuple[str, str]]:
    """Kind and data of each event, as in a run file."""
    return [(kind, json.dumps(data, separators=(",", ":"))) for kind, data in happened]


def read(lines: list[tuple[str, str]]) -> list[Recorded]:
    return [recorded(number + 1, float(number), kind, data) for number, (kind, data) in enumerate(lines)]


def created() -> Happened:
    return "created", {"scenario": {}, "elements": [f"model_{number}" for number in range(MODELS)]}


def long_run(tests: int) -> Iterator[Happened]:
    """Rounds of 50 partitions of neighbours, until `tests` are made."""
    partitions = [list(range(first, first + 10)) for first in range(0, 500, 10)]
    whole = Environment.whole(500)
    yield named(1, whole)
    for number, part in enumerate(map(Environment.of, partitions)):
        yield named(2 + 2 * number, part)
        yield named(3 + 2 * number, whole - part)
    for first in range(0, tests, 2 * RUNS * len(partitions)):
        number = first // (2 * RUNS * len(partitions)) + 1
        yield announced(number, 1, partitions)
        candidates = range(min(2 * len(partitions), (tests - first) // RUNS))
        yield from chain.from_iterable(tried(number, each, first + RUNS * each + 1) for each in candidates)
        yield "round_finished", {"round": number}


def tried(round: int, candidate: int, first: int) -> Iterator[Happened]:
    """All tests of a candidate, from number `first` on, and its verdict."""
    ids = list(range(first, first + RUNS))
    for run, test in enumerate(ids):
        place = {"environment": 2 + candidate, "phase": "round", "round": round, "candidate": candidate}
        yield "test_started", {"test": test, **place, "run": run, "seed": run}
        yield "test_finished", finished(test)
    yield "candidate_judged", {"round": round, "candidate": candidate, "verdict": "dissimilar", "tests": ids}


def named(number: int, models: Environment) -> Happened:
    return "environment_named", {"environment": number, "models": f"{models.bits:x}"}


def finished(test: int) -> dict[str, Any]:
    pose = [2.01234567, 0.41234567, 0.13234567, 0.91234567, 0.01234567, 0.02345678, 0.39876543]
    return {
        "test": test,
        "outcome": "pass",
        "failure": "",
        "distance": 2.34567891,
        "end_pose": pose,
        "simulated_seconds": 45.0,
        "wall_seconds": 1.23456789,
        "first_sensed": [[number, 0.25 * number] for number in range(10)],
        "first_touched": [[3, 12.5]],
    }


def large_round() -> Iterator[Happened]:
    yield announced(1, 0, [[number] for number in range(MODELS)])
    for candidate in range(2 * MODELS):
        yield "candidate_judged", {"round": 1, "candidate": candidate, "verdict": "dissimilar", "tests": []}


def announced(number: int, environment: int, partitions: list[list[int]]) -> Happened:
    places = range(len(partitions))
    return "round_started", {
        "round": number,
        "n_partitions": len(partitions),
        "environment": environment,
        "partitions": partitions,
        "candidates": [[kind, place, 1.234] for place in places for kind in ("partition", "complement")],
    }


if __name__ == "__main__":
    main()
