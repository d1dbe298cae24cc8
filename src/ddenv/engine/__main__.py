"""The engine as a program. Exit codes: 0 it ended by itself, 1 it was stopped, 2 it could not go on
(one line on stderr).
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from contextlib import closing
from pathlib import Path

from pydantic import TypeAdapter

from ddenv import __version__
from ddenv.engine.control import Control, DiskSpace, Stopped
from ddenv.engine.driver import Driver
from ddenv.engine.isolate import isolate
from ddenv.engine.journal import Journal
from ddenv.engine.limits import check_crash_loop
from ddenv.engine.margins import Stood, find_margins
from ddenv.engine.notes import note_start
from ddenv.engine.pool import Pool, Workers
from ddenv.engine.scheduler import TestScheduler
from ddenv.engine.shared import machine, simulator, tests_of_others
from ddenv.errors import UserError
from ddenv.runfile import events
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import RunFile
from ddenv.runs.engine_job import (
    Certify,
    FindMargins,
    GiveUpIsolation,
    Isolate,
    Job,
    Order,
    Reduce,
)
from ddenv.runs.experiment import read_parts
from ddenv.runs.programs import ENGINE_SAYS, ENGINE_STARTED
from ddenv.runs.trust import HERE, check_cluster, check_trusted, made_here
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m ddenv.engine", description="Works on a run until it ends."
    )
    parser.add_argument("run", type=Path)
    parser.add_argument("order", help="what to do, and how: an `Order` of `ddenv.runs`, as JSON")
    words = parser.parse_args()
    _say(ENGINE_STARTED)
    terminated = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: terminated.set())
    try:
        with RunFile(words.run) as file, engine_lock(words.run):
            return work(file, TypeAdapter(Order).validate_json(words.order), terminated)
    except UserError as error:
        _say(str(error))
        return 2


def _say(words: str) -> None:
    print(ENGINE_SAYS, words, file=sys.stderr, flush=True)


def work(file: RunFile, order: Order, terminated: threading.Event) -> int:
    """Does a job in this process, and returns the exit code. Raises UserError."""
    if isinstance(order.job, GiveUpIsolation):
        return _give_up(file)
    options = order.options
    parts = read_parts(file)
    scenario = parts[0]
    check_trusted(made_here(scenario) if options.cluster else scenario, file.path)
    check_cluster(options.cluster or scenario.reduction.cluster)
    disk = DiskSpace(file, terminated)
    file.own(disk.wait)
    journal = Journal(file)
    if journal.state.status == "finished" and not _has_work(file, journal, order.job):
        return 0
    if not options.ignore_crashes:
        check_crash_loop(journal)
    try:
        _carry_out(file, order, parts, journal, disk, terminated)
    except Stopped as stop:
        journal.lose_running()
        journal.record(events.EngineStopped(reason=str(stop)))
        return 1
    except Exception as error:
        journal.lose_running()
        # Of a bug in ddenv the traceback goes to the log, and views show the reason.
        bug = f"unexpected {type(error).__name__}: {error} (see the log beside the run)"
        journal.record(
            events.EngineFailed(reason=str(error) if isinstance(error, UserError) else bug)
        )
        raise
    finally:
        file.set_live([])
        file.settle()
    return 0


def _carry_out(
    file: RunFile,
    order: Order,
    parts: tuple[Scenario, World, Model],
    journal: Journal,
    disk: DiskSpace,
    terminated: threading.Event,
) -> None:
    """Raises Stopped, and UserError when it cannot go on."""
    options = order.options
    scenario, world, robot = parts
    cluster = options.cluster or scenario.reduction.cluster
    jobs = max(1, options.jobs)
    stood = Stood(status=journal.state.status, reason=journal.state.reason)
    _begin(journal, jobs if cluster == HERE else 0, options.accept_mode)
    control = Control(journal, terminated, order.last_command, disk, attended=options.attended)
    others = None
    if options.shared_folder is not None:
        others = tests_of_others(file, scenario, Path(options.shared_folder))
    with closing(_workers(scenario, world, robot, jobs, cluster, journal)) as pool:
        scheduler = TestScheduler(journal, pool, control, others)
        if scenario.oracle is None:
            scheduler.check_repeats(options.allow_other_machine)
        note_start(scenario, world, robot, journal)
        driver = Driver(scenario, world, journal, scheduler, control)
        match order.job:
            case Certify(at_least=at_least, certify_rate=certify_rate):
                driver.certify(at_least, certify_rate)
            case Isolate(at_least=at_least):
                isolate(world, journal, scheduler, at_least, stood.reason)
            case _ if journal.state.isolating is not None:
                isolate(world, journal, scheduler, None, stood.reason)
            case FindMargins() as asked:
                find_margins(parts, journal, pool, control, asked, stood)
            case _ if journal.state.margining is not None:
                find_margins(parts, journal, pool, control, None, stood)
            case _:
                driver.reduce()


def _has_work(file: RunFile, journal: Journal, job: Job) -> bool:
    """Whether there is something to do in a run that has finished."""
    if not isinstance(job, Reduce) or journal.state.margining is not None or journal.has_broken:
        return True
    return bool(file.commands(journal.state.last_command))


def _begin(journal: Journal, jobs: int, accept_mode: str | None) -> None:
    # This event comes first: all events before it are another engine's.
    journal.record(
        events.EngineStarted(
            pid=os.getpid(),
            jobs=jobs,
            version=__version__,
            simulator=simulator(),
            machine=machine(),
        )
    )
    journal.lose_running()
    if accept_mode not in (None, journal.state.accept_mode):
        journal.record(events.AcceptModeChanged(mode=accept_mode or ""))


def _give_up(file: RunFile) -> int:
    file.own()
    journal = Journal(file)
    if journal.state.isolating is not None:
        journal.record(events.IsolationGivenUp())
    return 0


def _workers(
    scenario: Scenario, world: World, robot: Model, jobs: int, cluster: str, journal: Journal
) -> Workers:
    if cluster == HERE:
        return Pool(scenario, world, robot, jobs)
    # Only who asks for a cluster needs Dask.
    from ddenv.engine.cluster.cluster_pool import ClusterPool

    return ClusterPool(
        scenario,
        world,
        robot,
        cluster,
        lambda tests, words: journal.record(events.Cluster(jobs=tests, words=words)),
    )


if __name__ == "__main__":
    sys.exit(main())
