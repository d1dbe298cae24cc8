"""Simulators that hang, die, take all memory or babble, tests that take too long, engines that die
at one place.
"""

from collections import Counter
from contextlib import suppress
from dataclasses import replace

import pytest

from ddenv.engine.journal import Journal
from ddenv.engine.limits import (
    FACTOR,
    GENEROUS,
    LEAST,
    MOST_DEATHS,
    MOST_LATE,
    check_crash_loop,
    memory_limit,
)
from ddenv.engine.notes import KNOWN_AFTER
from ddenv.engine.pool import Pool
from ddenv.engine.worker import Broken, Run
from ddenv.errors import UserError
from ddenv.report.report import content
from ddenv.report.run_data import read_run
from ddenv.runfile.fold import fold
from ddenv.runfile.store import Live, RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import read_parts
from ddenv.settings import SETTINGS
from ddenv.words.news import news
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.hostile_simulators import DiesWithoutTheBeam, Hostile, dies_at_once
from tests.engine.killing import Killed, kill_after, story
from tests.engine.oracles import needs
from tests.engine.reading import events, models_in, told
from tests.engine.test_pool import EVERYTHING, parts, result
from tests.tiers import slow
from tests.wall import wall


@pytest.fixture
def hostile():
    pool = Pool(*parts(memory_limit=0.4), 1, Hostile)
    yield pool
    pool.close()


HOW = {
    "segfaults": "the simulator's process died (SIGSEGV: first line | last\N{REPLACEMENT CHARACTER} line)",
    "exits": "the simulator's process died (exit code 3)",
    "fills": "used more than 0.4 GB of memory (simulation.memory_limit, or fewer --jobs, allows more)",
    "interrupts": "KeyboardInterrupt",
}


@pytest.mark.parametrize("how", slow(pytest.mark.programs, HOW, but=["segfaults"]))
def test_whatever_a_simulator_does_is_an_error_of_its_test_and_the_next_one_works(hostile, how):
    hostile.submit(1, Run(keep=frozenset({how}), seed=0))
    assert result(hostile) == (1, Broken("error", HOW[how]))
    hostile.submit(9, Run(keep=frozenset({"ends"}), seed=0))
    assert result(hostile)[1].outcome == "pass"


@pytest.mark.programs
def test_garbage_on_stdout_does_no_harm_and_does_not_fill_the_log(hostile, capfd):
    hostile.submit(1, Run(keep=frozenset({"babbles"}), seed=7))
    test, made = result(hostile)
    assert (test, made.outcome, made.seed) == (1, "pass", 7)
    said = capfd.readouterr()
    assert said.out == ""
    assert "the rest of what this test printed is left out" in said.err
    assert len(said.err) < 2 * 100_000


@pytest.mark.programs
def test_workers_that_die_before_they_run_a_test_end_the_engine_with_the_reason():
    pool = Pool(*parts(), 1, dies_at_once)
    try:
        pool.submit(1, Run(keep=EVERYTHING, seed=0))
        with pytest.raises(
            UserError, match=r"die before they run a test: .*SIGKILL, perhaps out of memory"
        ):
            result(pool)
    finally:
        pool.close()


@pytest.mark.programs
def test_a_sub_environment_that_kills_its_worker_twice_is_unknown(tmp_path):
    path = new_run(tmp_path, baseline_runs=2, iterations=1)
    with RunFile(path) as file:
        scenario, world, robot = read_parts(file)
    pool = Pool(scenario, world, robot, 2, DiesWithoutTheBeam)
    pool.jobs = 2
    try:
        state = drive(path, pool)
    finally:
        pool.close()
    broke = [test for test in state.tests if test.outcome == "error"]
    assert {test.failure for test in broke} == {"the simulator's process died (SIGABRT)"}
    # What was made ahead of its round, and then not needed, is not made again.
    times = Counter((models_in(state, test.id), test.run) for test in broke)
    assert set(times.values()) <= {1, 2}
    decisive = {
        test
        for data in told(path, "candidate_judged")
        if data["verdict"] == "unknown"
        for test in data["tests"]
    }
    assert {
        times[models_in(state, test.id), test.run] for test in broke if test.id in decisive
    } == {2}
    assert {"wall", "beam"} <= set(state.environment) and not state.minimal


def test_without_a_number_workers_share_what_the_machine_allows(monkeypatch):
    monkeypatch.setattr("ddenv.runs.processor.usable_memory", lambda: 10e9)
    assert memory_limit(wall(), 3) == pytest.approx(3e9)
    assert memory_limit(wall(simulation={"memory_limit": 0.5}), 3) == 0.5e9


# Of the small world's scenario.
BASELINE, TIMEOUT = 3, 5.0


class Timed(FakePool):
    """A pool whose tests take `real` s for each simulated one."""

    def __init__(self, real: float) -> None:
        super().__init__(needs("wall"), 1)
        self.real = real

    def finished(self, seconds):
        ended = super().finished(seconds)
        return [
            (test, replace(each, wall_seconds=self.real * each.simulated_seconds))
            for test, each in ended
        ]


@pytest.mark.parametrize(("real", "later"), [(0.1, LEAST), (30.0, FACTOR * 30 * TIMEOUT)])
def test_the_baseline_has_a_long_time_and_later_tests_a_multiple_of_what_it_took(
    tmp_path, real, later
):
    assert f"{GENEROUS:g} in the baseline" in SETTINGS["wall_timeout"].meaning
    path = new_run(tmp_path)
    with suppress(Killed):
        drive(path, first := Timed(real), prepare=lambda file: kill_after(file, 20))
    assert first.limits[:BASELINE] == [GENEROUS] * BASELINE
    # The machine is another one now: the limit stays.
    drive(path, again := Timed(real / 7))
    assert again.made
    assert {*first.limits[BASELINE:], *again.limits} == {later}


def test_how_long_tests_take_changes_no_verdict(tmp_path):
    assert story(drive(new_run(tmp_path), Timed(0.01))) == story(
        drive(new_run(tmp_path), Timed(1000.0))
    )


def test_a_number_of_the_users_holds_for_all_tests(tmp_path):
    create_run(wall(simulation={"wall_timeout": 33.0}), path := tmp_path / "run.ddenv")
    drive(path, pool := Timed(30.0))
    assert set(pool.limits) == {33.0}


def pace(simulated, real, slot=0):
    return Live(slot=slot, test=1, time=simulated, pose=(0.0,) * 7), real


def test_a_slow_world_is_told_once_while_its_first_run_goes_on(tmp_path):
    path, pool = new_run(tmp_path), FakePool(needs("wall"), 2)
    # Its runs differ: of runs that are alike there is another note.
    pool.aside = lambda keep, seed: 1e-9 * seed
    pool.pace = [pace(50.0, 12.0), pace(3.0, 12.0, 1)]
    drive(path, pool)
    written = events(path)
    kinds = [event.kind for event in written]
    assert kinds.count("noted") == 1
    assert kinds.index("noted") < kinds.index("baseline_finished")
    before, after = (fold(written[: kinds.index("noted") + more]) for more in (0, 1))
    said = news("noted", before, after)
    assert said.startswith(
        "this world is slow: 0.25 s simulated per second; at this rate a 5 s test takes 20 s; "
        "try fewer models that can move"
    )
    # The report keeps it.
    assert said[1:] in str(content(read_run(path)).lead)


@pytest.mark.parametrize(("simulated", "real"), [(11.0, 10.0), (0.5, KNOWN_AFTER - 0.1)])
def test_a_fast_world_is_not_called_slow_and_one_that_has_just_begun_neither(
    tmp_path, simulated, real
):
    path, pool = new_run(tmp_path), FakePool(needs("wall"), 2)
    pool.pace = [pace(simulated, real)]
    assert set(dict(drive(path, pool).notes)) == {"alike"}


def test_a_world_whose_runs_all_take_too_long_is_given_up_soon(tmp_path):
    class Late(FakePool):
        def finished(self, seconds):
            return [
                (test, Broken("timeout", "took longer than 1800 s of wall clock"))
                for test, _ in super().finished(seconds)
            ]

    path, pool = new_run(tmp_path, baseline_runs=10), Late(needs("wall"), 1)
    with pytest.raises(
        UserError,
        match=r"3 runs of the whole world took longer than 1800 s .*, and none has ended; try fewer",
    ):
        drive(path, pool)
    assert len(pool.made) == MOST_LATE


def dies(path, after):
    with pytest.raises(Killed):
        drive(path, FakePool(needs("wall"), 2), prepare=lambda file: kill_after(file, after))


def check(path):
    with RunFile(path) as file:
        check_crash_loop(Journal(file))


def test_engines_that_die_before_a_test_ends_are_told_with_the_way_on(tmp_path):
    path = new_run(tmp_path)
    # One more event each time, two tests begin: nothing of it is a step forward.
    for after in range(1, MOST_DEATHS):
        dies(path, after)
    check(path)
    dies(path, 1)
    with pytest.raises(
        UserError, match=rf"the last {MOST_DEATHS} engines died after event 1, .* --anyway"
    ) as told:
        check(path)
    assert "\n" not in str(told.value)
    # Nothing was written: it stays so.
    with pytest.raises(UserError):
        check(path)


def test_engines_that_get_on_may_die_as_often_as_they_like(tmp_path):
    path = new_run(tmp_path)
    for _ in range(2 * MOST_DEATHS):
        dies(path, 5)
        check(path)
