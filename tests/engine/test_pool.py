"""Workers on the real robot: they may die at any time."""

import math
import os
import signal
from pathlib import Path

import pytest

from ddenv.engine.pool import Broken, Pool
from ddenv.errors import UserError
from ddenv.runs.scenarios import load_parts
from ddenv.world.load import load_scenario
from tests.conftest import DATA
from tests.waiting import wait_until

EVERYTHING = frozenset({"deck", "wall"})


def parts(**simulation):
    scenario = load_scenario(DATA / "wall.yaml")
    changed = scenario.simulation.model_copy(update=simulation)
    scenario = scenario.model_copy(update={"simulation": changed})
    return scenario, *load_parts(scenario)


@pytest.fixture
def pool():
    pool = Pool(*parts(), 2)
    yield pool
    pool.close()


def result(pool):
    ended = []
    wait_until(lambda: ended.extend(pool.finished(0.2)) or ended, lambda: "no test ended")
    return ended[0]


def workers(pool):
    return [int(pid) for pid in pool._pool._pool_manager.worker_manager.workers]


@pytest.mark.programs
def test_an_idle_worker_that_dies_is_replaced_and_all_have_what_makes_drake_fast(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    before, pool = dict(os.environ), Pool(*parts(), 2)
    try:
        _test_a_dying_worker(pool)
    finally:
        pool.close()
    assert dict(os.environ) == before


def _test_a_dying_worker(pool):
    pool.submit(1, EVERYTHING, 0)
    assert result(pool)[1].outcome == "failed"
    first = workers(pool)
    for pid in workers(pool):
        os.kill(pid, signal.SIGKILL)
    # One that dies while it holds pebble's lock takes the whole pool along: then a new pool is made for the next test.
    wait_until(lambda: not set(first) & set(workers(pool)) or not pool._pool.active)
    pool.submit(2, EVERYTHING, 0)
    assert result(pool)[1].outcome == "failed"
    assert not set(first) & set(workers(pool))
    for pid in workers(pool):
        given = Path(f"/proc/{pid}/environ").read_text().split("\0")
        assert given.count("GLIBC_TUNABLES=glibc.malloc.tcache_count=127") == 1
        assert "OPENBLAS_NUM_THREADS=1" in given
        # What the user has set stays.
        assert "OMP_NUM_THREADS=3" in given


def test_a_worker_that_dies_in_a_test_makes_it_an_error_and_the_next_one_works(pool):
    pool.submit(1, EVERYTHING, 0)
    wait_until(pool.live)
    for pid in workers(pool):
        os.kill(pid, signal.SIGKILL)
    test, broken = result(pool)
    if isinstance(broken, Broken):
        assert (test, broken.outcome) == (1, "error")
        assert "process died" in broken.failure
    pool.submit(2, EVERYTHING, 0)
    test, after = result(pool)
    assert (test, after.outcome) == (2, "failed")


def test_an_exception_in_a_worker_is_an_error_of_its_test_and_another_worker_goes_on(pool):
    for test in (1, 2):
        pool.submit(test, EVERYTHING, 0)
    wait_until(lambda: not pool.busy or pool.finished(0.2))
    before = workers(pool)
    pool.submit(3, frozenset({"deck", "g\nhost"}), 0)
    ended = []
    wait_until(lambda: not pool.busy or ended.extend(pool.finished(0.2)))
    broken = dict(ended)[3]
    assert broken == Broken("error", "ValueError: no such model: g host")
    # What it has left behind in the simulator is gone.
    wait_until(lambda: len(set(workers(pool)) - set(before)) == 1)
    for test in (4, 5):
        pool.submit(test, EVERYTHING, 0)
    after = []
    wait_until(lambda: not pool.busy or after.extend(pool.finished(0.2)))
    assert sorted((test, each.outcome) for test, each in after) == [(4, "failed"), (5, "failed")]


@pytest.mark.programs
def test_a_test_that_takes_too_long_is_killed_and_the_next_one_works():
    pool = Pool(*parts(wall_timeout=0.001), 1)
    try:
        pool.submit(1, EVERYTHING, 0)
        test, late = result(pool)
        assert (test, late.outcome) == (1, "timeout")
        assert "wall clock" in late.failure
        pool.submit(2, EVERYTHING, 0)
        assert result(pool)[0] == 2
        assert pool.idle == 1
    finally:
        pool.close()


def test_progress_is_seen_while_a_test_runs(pool):
    pool.submit(7, EVERYTHING, 0)
    seen = []
    while not (ended := pool.finished(0.005)):
        seen += pool.live()
    assert ended[0][0] == 7
    assert all(live.test == 7 and math.isfinite(live.time) for live in seen)
    assert pool.live() == []


def test_a_world_that_cannot_be_simulated_is_told():
    scenario, world, robot = parts()
    legless = robot.__class__(robot.name, robot.pose, robot.static, robot.links, (), robot.spans, robot.line)
    pool = Pool(scenario, world, legless, 1)
    try:
        pool.submit(1, EVERYTHING, 0)
        with pytest.raises(UserError, match="wheels on both sides"):
            result(pool)
    finally:
        pool.close()
