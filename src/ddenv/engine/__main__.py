"""The engine as a program. Exit codes: 0 it ended by itself, 1 it was stopped, 2 it could not go on
(one line on stderr).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import threading
from contextlib import closing
from pathlib import Path

from ddenv import __version__
from ddenv.engine.control import Control, DiskSpace, Stopped
from ddenv.engine.driver import Driver
from ddenv.engine.isolate import isolate
from ddenv.engine.journal import Journal
from ddenv.engine.limits import check_crash_loop
from ddenv.engine.margins import find_margins
from ddenv.engine.notes import note_start
from ddenv.engine.pool import Pool, Workers
from ddenv.engine.scheduler import TestScheduler
from ddenv.engine.shared import machine, simulator, tests_of_others
from ddenv.errors import UserError
from ddenv.runfile import events
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import RunFile
from ddenv.runs import processor
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
    parser.add_argument("--jobs", type=int, default=processor.usable_cores())
    parser.add_argument(
        "--cluster", help="where the tests are made, in place of what the scenario says"
    )
    parser.add_argument("--accept-mode", choices=("automatic", "ask"))
    parser.add_argument(
        "--attended", choices=("yes", "no"), default="no", help="pause where there is an offer"
    )
    parser.add_argument(
        "--bits", choices=("same", "mixed"), default="same", help="whether other bits may follow"
    )
    parser.add_argument(
        "--anyway", choices=("yes", "no"), default="no", help="start after engines died at once"
    )
    parser.add_argument("--share", type=Path, help="folder of other runs; their tests are reused")
    parser.add_argument(
        "--certify",
        type=int,
        help="one more certificate, with at least so many runs of what is left",
    )
    parser.add_argument(
        "--certify-rate",
        type=float,
        help="the last one goes on until it shows this part of the rate",
    )
    parser.add_argument(
        "--isolate", type=int, help="find the nearest world that passes; fresh runs, 0: as usual"
    )
    parser.add_argument(
        "--margins", help="find margins of the numbers of these globs, a JSON list; []: of all"
    )
    parser.add_argument("--most-runs", type=int, default=300, help="runs that margins may take")
    parser.add_argument(
        "--give-up", choices=("yes", "no"), default="no", help="end the isolation that is open"
    )
    parser.add_argument("--after", type=int, help="the last command before it was asked to start")
    options = parser.parse_args()
    _say(ENGINE_STARTED)
    terminated = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: terminated.set())
    try:
        with RunFile(options.run) as file, engine_lock(options.run):
            if options.give_up == "yes":
                return _give_up(file)
            return _work(file, options, terminated)
    except UserError as error:
        _say(str(error))
        return 2


def _say(words: str) -> None:
    print(ENGINE_SAYS, words, file=sys.stderr, flush=True)


def _work(file: RunFile, options: argparse.Namespace, terminated: threading.Event) -> int:
    jobs = max(1, options.jobs)
    scenario, world, robot = read_parts(file)
    cluster = options.cluster or scenario.reduction.cluster
    check_trusted(made_here(scenario) if options.cluster else scenario, file.path)
    check_cluster(cluster)
    after = file.last_command() if options.after is None else options.after
    disk = DiskSpace(file, terminated)
    file.own(disk.wait)
    journal = Journal(file)
    new = (
        options.certify
        or options.isolate is not None
        or options.margins is not None
        or journal.state.margining is not None
        or journal.has_broken
        or file.commands(journal.state.last_command)
    )
    if journal.state.status == "finished" and not new:
        return 0
    if options.anyway == "no":
        check_crash_loop(journal)
    stood = journal.state.status
    before = journal.state.reason
    try:
        _begin(journal, jobs if cluster == HERE else 0, options.accept_mode)
        control = Control(journal, terminated, after, disk, attended=options.attended == "yes")
        others = None if options.share is None else tests_of_others(file, scenario, options.share)
        with closing(_workers(scenario, world, robot, jobs, cluster, journal)) as pool:
            scheduler = TestScheduler(journal, pool, control, others)
            if scenario.oracle is None:
                scheduler.check_repeats(options.bits == "mixed")
            note_start(scenario, world, robot, journal)
            if options.certify:
                Driver(scenario, world, journal, scheduler, control).certify(
                    options.certify, options.certify_rate
                )
            elif options.isolate is not None or journal.state.isolating is not None:
                isolate(world, journal, scheduler, options.isolate or None, before)
            elif options.margins is not None or journal.state.margining is not None:
                if options.margins is None:
                    asked = None
                else:
                    asked = (json.loads(options.margins), options.most_runs)
                find_margins(
                    (scenario, world, robot), journal, pool, control, asked, (stood, before)
                )
            else:
                Driver(scenario, world, journal, scheduler, control).reduce()
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
