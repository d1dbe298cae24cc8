"""Simulators that hang, die, take all memory or babble: each is one broken test, and says how it ended."""

from collections import Counter
from dataclasses import asdict

import pytest

from ddenv.engine.journal import Journal
from ddenv.engine.limits import memory_limit
from ddenv.engine.pool import Pool
from ddenv.engine.worker import Broken
from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.runs.subject import read_parts
from tests.engine.fake import drive, new_run
from tests.engine.hostile_simulators import DiesWithoutTheBeam, Hostile, dies_at_once
from tests.engine.killing import models_in
from tests.engine.test_pool import EVERYTHING, parts, result
from tests.tiers import slow


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
    hostile.submit(1, frozenset({how}), 0)
    assert result(hostile) == (1, Broken("error", HOW[how]))
    hostile.submit(9, frozenset({"ends"}), 0)
    assert result(hostile)[1].outcome == "pass"


@pytest.mark.programs
def test_garbage_on_stdout_does_no_harm_and_does_not_fill_the_log(hostile, capfd):
    hostile.submit(1, frozenset({"babbles"}), 7)
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
        pool.submit(1, EVERYTHING, 0)
        with pytest.raises(UserError, match=r"die before they run a test: .*SIGKILL, perhaps for lack of memory"):
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
    with RunFile(path) as file:
        judged = [asdict(event.event) for event in file.events() if event.kind == "candidate_judged"]
        journal = Journal(file)
    # What was made ahead of its round, and then not needed, is not made again.
    times = Counter((models_in(journal.state, test.id), test.run) for test in broke)
    assert set(times.values()) <= {1, 2}
    decisive = {test for data in judged if data["verdict"] == "unknown" for test in data["tests"]}
    assert {times[models_in(journal.state, test.id), test.run] for test in broke if test.id in decisive} == {2}
    assert {"wall", "beam"} <= set(state.environment) and not state.minimal


def test_without_a_number_workers_share_what_the_machine_allows(monkeypatch):
    monkeypatch.setattr("ddenv.runs.processor.usable_memory", lambda: 10e9)
    scenario = parts()[0]
    assert memory_limit(scenario, 3) == pytest.approx(3e9)
    asked = scenario.simulation.model_copy(update={"memory_limit": 0.5})
    assert memory_limit(scenario.model_copy(update={"simulation": asked}), 3) == 0.5e9
