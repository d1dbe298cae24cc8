"""Workers on the real robot: they may die at any time."""

import math
import os
import signal
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from ddenv.engine.pool import PREPARATION, Pool
from ddenv.engine.worker import PERIOD, Broken, Moment, Run, answered
from ddenv.errors import UserError
from ddenv.runs.experiment import load_parts
from ddenv.world.sdf.read import read_world
from tests.conftest import DATA
from tests.waiting import wait_until
from tests.wall import wall

EVERYTHING = frozenset({"deck", "wall"})


def parts(**simulation):
    scenario = wall(simulation=simulation)
    return scenario, *load_parts(scenario)


def test_models_that_moved_are_told_and_a_run_that_starts_again_has_all_of_its_time():
    told = []
    start, later = (1.0, 2.0, 0.1, 1.0, 0.0, 0.0, 0.0), (1.5, 2.0, 0.1, 1.0, 0.0, 0.0, 0.0)

    class Pushing:
        def run(self, keep, seed, progress, full):
            for time_s, ball in ((0.0, start), (1.0, start), (2.0, later), (0.0, start)):
                progress(time_s, start, {"ball": ball, "post": start})
                time.sleep(PERIOD)

    answered(Run(keep=EVERYTHING, seed=1, ends=True, limit=60.0), Pushing(), told.append)
    # It has its models where they started, again.
    assert [moment.models for moment in told] == [{}, {}, {"ball": later}, {}]
    assert [moment.time for moment in told] == [0.0, 1.0, 2.0, 0.0]
    begun = [moment.begun for moment in told]
    assert 0.0 < begun[0] == begun[1] == begun[2] < begun[3]


@pytest.fixture
def pool(request):
    """Of one worker, or of as many as the test says."""
    pool = Pool(*parts(), getattr(request, "param", 1))
    yield pool
    pool.close()


def result(pool):
    ended = []
    wait_until(lambda: ended.extend(pool.finished(0.2)) or ended, lambda: "no test ended")
    return ended[0]


def workers(pool):
    return [slot.worker.pid for slot in pool._slots]


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
    pool.submit(1, Run(keep=EVERYTHING, seed=0))
    assert result(pool)[1].outcome == "failed"
    first = workers(pool)
    for pid in workers(pool):
        os.kill(pid, signal.SIGKILL)
    wait_until(lambda: pool.finished(0.0) or not set(first) & set(workers(pool)))
    pool.submit(2, Run(keep=EVERYTHING, seed=0))
    assert result(pool)[1].outcome == "failed"
    assert not set(first) & set(workers(pool))
    for pid in workers(pool):
        given = Path(f"/proc/{pid}/environ").read_text().split("\0")
        assert given.count("GLIBC_TUNABLES=glibc.malloc.tcache_count=127") == 1
        assert "OPENBLAS_NUM_THREADS=1" in given
        # What the user has set stays.
        assert "OMP_NUM_THREADS=3" in given


def test_a_worker_that_dies_in_a_test_makes_it_an_error_and_the_next_one_works(pool):
    pool.submit(1, Run(keep=EVERYTHING, seed=0))
    wait_until(lambda: pool.finished(0.0) or pool.live())
    os.kill(next(slot.worker.pid for slot in pool._slots if slot.job), signal.SIGKILL)
    died = "the simulator's process died (SIGKILL, perhaps out of memory)"
    assert result(pool) == (1, Broken("error", died))
    pool.submit(2, Run(keep=EVERYTHING, seed=0))
    test, after = result(pool)
    assert (test, after.outcome) == (2, "failed")


@pytest.mark.programs
@pytest.mark.parametrize("pool", [2], indirect=True)
def test_an_exception_in_a_worker_is_an_error_of_its_test_and_another_worker_goes_on(pool):
    for test in (1, 2):
        pool.submit(test, Run(keep=EVERYTHING, seed=0))
    wait_until(lambda: not pool.busy or pool.finished(0.2))
    before = workers(pool)
    pool.submit(3, Run(keep=frozenset({"deck", "g\nhost"}), seed=0))
    ended = []
    wait_until(lambda: not pool.busy or ended.extend(pool.finished(0.2)))
    broken = dict(ended)[3]
    assert broken == Broken("error", "ValueError: no such model: g host")
    # What it has left behind in the simulator is gone.
    wait_until(lambda: len(set(workers(pool)) - set(before)) == 1)
    for test in (4, 5):
        pool.submit(test, Run(keep=EVERYTHING, seed=0))
    after = []
    wait_until(lambda: not pool.busy or after.extend(pool.finished(0.2)))
    assert sorted((test, each.outcome) for test, each in after) == [(4, "failed"), (5, "failed")]


WAITS = """
from pathlib import Path

class Waits:
    def __init__(self, setup):
        pass
    def step(self, reading):
        while not Path("FOLDER/go").exists():
            pass
        return 0.3, 0.0
"""


@pytest.mark.programs
def test_a_test_that_takes_too_long_is_killed_and_the_next_one_works(tmp_path):
    (tmp_path / "waits.py").write_text(WAITS.replace("FOLDER", str(tmp_path)))
    scenario, world, robot = parts(wall_timeout=0.5)
    waits = scenario.controller.model_copy(update={"use": "waits:Waits", "answer_within": 1e6})
    pool = Pool(
        scenario.model_copy(update={"controller": waits, "folder": tmp_path}), world, robot, 1
    )
    try:
        pool.submit(1, Run(keep=EVERYTHING, seed=0))
        test, late = result(pool)
        assert (test, late.outcome, late.failure) == (
            1,
            "timeout",
            "took longer than 0.5 s of wall clock",
        )
        (tmp_path / "go").touch()
        pool.submit(2, Run(keep=EVERYTHING, seed=0, limit=1e6))
        assert (result(pool)[1].outcome, pool.idle) == ("failed", 1)
    finally:
        pool.close()


class Silent:
    """A worker that never answers."""

    handles: tuple[int, ...] = ()
    killed = 0

    def __init__(self, *_):
        pass

    def kill(self):
        Silent.killed += 1

    def memory(self):
        return 0


class Clock:
    """The clock that a pool looks at: `looks` for some seconds and returns what has ended by
    then.
    """

    def __init__(self, pool, monkeypatch):
        self.now, self.pool = 1000.0, pool
        # Not the standard library's: it would wait for ever.
        for module in ("ddenv.engine.pool", "ddenv.robot.deadline"):
            monkeypatch.setattr(f"{module}.time", SimpleNamespace(monotonic=lambda: self.now))

    def looks(self, seconds, every=1.0):
        ended = []
        for _ in range(round(seconds / every)):
            self.now += every
            ended += self.pool.finished(0.0)
        return ended


def test_only_the_time_counts_in_which_the_robot_moves(monkeypatch):
    monkeypatch.setattr("ddenv.engine.pool.WorkerProcess", Silent)
    pool = Pool(*parts(wall_timeout=60), 1)
    clock = Clock(pool, monkeypatch)
    pool.submit(1, Run(keep=EVERYTHING, seed=0))
    assert clock.looks(600, every=0.5) == []
    pool._slots[0].go_on(Moment(clock.now, 0.0, (0.0,) * 7, {}))
    assert clock.looks(30, every=0.5) == []
    # The engine is stopped for a day.
    assert clock.looks(86400, every=86400) == []
    assert clock.looks(28, every=0.5) == []
    assert clock.looks(2, every=0.5) == [
        (1, Broken("timeout", "took longer than 60 s of wall clock"))
    ]
    assert Silent.killed == 1
    assert pool.idle == 1
    # Nothing of its time counts for the next one; and what never begins ends, too.
    pool.submit(2, Run(keep=EVERYTHING, seed=0))
    assert clock.looks(PREPARATION - 1) == []
    ended = clock.looks(2)
    assert ended == [(2, Broken("timeout", "took longer than 3600 s of wall clock to prepare"))]


def test_progress_is_seen_while_a_test_runs(pool):
    pool.submit(7, Run(keep=EVERYTHING, seed=0))
    seen = []
    while not (ended := pool.finished(0.005)):
        seen += pool.live()
    assert ended[0][0] == 7
    assert all(
        live.test == 7 and math.isfinite(live.time) and 0.0 <= real < 60.0 for live, real in seen
    )
    assert pool.live() == []


@pytest.mark.programs
def test_a_worker_finds_what_rests_on_what(tmp_path):
    scenario, world, robot = parts()
    text = (DATA / "wall.sdf").read_text()
    # The ball lies on the deck, and can move.
    fixed = text[text.index('<model name="ball">') : text.index('<model name="beam">')]
    inertial = "<inertial><mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>"
    free = fixed.replace("<static>true</static>", "").replace(
        "<collision", f"{inertial}<collision", 1
    )
    path = tmp_path / "world.sdf"
    path.write_text(text.replace(fixed, free.replace("4 4 0.3", "0 0.8 0.6")))
    pool = Pool(scenario, read_world(path), robot, 1)
    try:
        found = pool.settle(frozenset(world.elements()))
        assert pool.idle == 0
        known = []
        wait_until(
            lambda: known.append(found()) or known[-1] is not None, lambda: "it was not found"
        )
        assert known[-1].supports == [("ball", "deck")]
        # The worker is free again.
        pool.submit(1, Run(keep=EVERYTHING, seed=0))
        assert result(pool)[1].outcome == "failed"
    finally:
        pool.close()


@pytest.mark.programs
def test_a_world_that_cannot_be_simulated_is_told():
    scenario, world, robot = parts()
    legless = replace(robot, joints=())
    pool = Pool(scenario, world, legless, 1)
    try:
        pool.submit(1, Run(keep=EVERYTHING, seed=0))
        with pytest.raises(UserError, match="wheels on both sides"):
            result(pool)
    finally:
        pool.close()
