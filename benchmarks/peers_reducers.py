"""The reducers that `peers.py` compares with ddenv; each begins in a process of its own, as if started from the command line."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path

import picire
from peers_tests import Bench, counts, is_minimal, prepare, shows_in_any

from ddenv.engine.worker import NICENESS
from ddenv.errors import UserError
from ddenv.world.scenario import Scenario

Reduce = Callable[[tuple[str, ...], int], list[str]]


def picire_parallel(elements: tuple[str, ...], jobs: int) -> list[str]:
    return _in_parallel(picire.ParallelDD, elements, jobs)


def picire_combined(elements: tuple[str, ...], jobs: int) -> list[str]:
    return _in_parallel(picire.CombinedParallelDD, elements, jobs)


def _in_parallel(kind: type[picire.AbstractParallelDD], elements: tuple[str, ...], jobs: int) -> list[str]:
    """picire forks a process for each candidate, and kills it when another one has shown f."""
    multiprocessing.set_start_method("fork", force=True)
    cache = picire.shared_cache_decorator(picire.ConfigCache)()
    return kind(_test(shows_in_any), cache=cache, proc_num=jobs)(list(elements))


def picire_sequential(elements: tuple[str, ...], jobs: int) -> list[str]:
    """One candidate at a time, its re-runs at the same time."""
    bench = Bench(jobs)
    test = _test(lambda keep: bench.first_similar([keep]) is not None)
    return picire.DD(test, cache=picire.ConfigCache())(list(elements))


def _test(shown: Callable[[frozenset[str]], bool]) -> Callable[[Sequence[str], tuple], picire.Outcome]:
    def test(config: Sequence[str], config_id: tuple) -> picire.Outcome:
        # picire asks again whether its configuration still fails before each step: that is known.
        fails = "assert" in config_id or shown(frozenset(config))
        return picire.Outcome.FAIL if fails else picire.Outcome.PASS

    return test


def one_by_one(elements: tuple[str, ...], jobs: int) -> list[str]:
    """Leaves out one model after another, round and round, until none can be left out.

    After a success the next models are tested ahead as if they could be left out, too; after a miss, re-runs and the next models
    singly.
    """
    bench, kept, position, hopeful = Bench(jobs), list(elements), 0, True
    while kept:
        order = kept[position:] + kept[:position]
        candidates = [frozenset(kept) - {name} for name in order]
        bets = [frozenset(order[count:]) for count in range(2, min(jobs, len(order)) + 1)] if hopeful else []
        winner = bench.first_similar(candidates, bets)
        if winner is None:
            break
        hopeful = winner == 0
        position = kept.index(order[winner])
        del kept[position]
    return kept


REDUCERS: dict[str, Reduce] = {
    "picire's ddmin, parallel and cached": picire_parallel,
    "picire's ddmin, parallel, loops combined": picire_combined,
    "picire's ddmin, re-runs in parallel": picire_sequential,
    "one by one": one_by_one,
}


def reduce_in_process(
    name: str, scenario: Scenario, record: Path, jobs: int, shuffle: int | None, answer: Connection
) -> None:
    """Sends what is left and the `Counts`, and later whether that is 1-minimal; or only an error in one line.

    With `shuffle`, the seed of a random order, the reducer does not see the models in the order of the file.
    """
    # The waiting process gets Ctrl+c, too, and kills this one with everything that it started.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Like the engine's workers: on a busy machine all get the same share.
    os.nice(NICENESS)
    try:
        elements = prepare(scenario, record, jobs)
    except (UserError, SystemExit) as error:
        answer.send(str(error))
        return
    order = elements if shuffle is None else tuple(random.Random(shuffle).sample(elements, len(elements)))
    kept = REDUCERS[name](order, jobs)
    answer.send((sorted(kept, key=elements.index), counts(record)))
    answer.send(is_minimal(frozenset(kept), jobs))
