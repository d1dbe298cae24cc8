"""Margins with workers and a run file: the same table whoever works on it and however often it is
killed, within its budget.
"""

from contextlib import closing, suppress

import numpy as np
import pytest

from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.margins import Stood, find_margins
from ddenv.engine.pool import Pool
from ddenv.engine.worker import Run
from ddenv.errors import UserError
from ddenv.evidence.margins import FIX_RUNS, MOST_FIXES, changes_at, fixes_of, margins_of
from ddenv.runfile.events import EngineFailed, EngineStopped
from ddenv.runfile.position import Position
from ddenv.runfile.store import RunFile
from ddenv.runs.changes import beside, changed_run, changes
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import FindMargins
from ddenv.runs.experiment import load_parts, read_parts
from ddenv.runs.export import export_world
from ddenv.runs.playback import played
from ddenv.words.margins import lines
from ddenv.world.load import load_scenario
from tests.engine.fake import FakePool, drive, engine, new_run
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import needs
from tests.engine.reading import send, state_of
from tests.tiers import slow
from tests.wall import wall

GLOBS = ["wall.y", "controller.speed"]


def margins_like(keep, seed, changes):
    """The wall may stand up to 0.7 m to its left, beyond it the robot passes; half of the speed is
    enough to be lost.
    """
    if changes.get("wall.y", 0.0) > 0.7:
        return "pass"
    return "other" if changes.get("controller.speed", 1.0) < 0.5 else "similar"


def fake(jobs=2, seed=0):
    pool = FakePool(needs("wall", "deck"), jobs, seed)
    pool.changed = margins_like
    return pool


def work(path, pool, globs=GLOBS, budget=300, prepare=lambda _: None, **options):
    """Finds margins as the engine program does, in this process."""
    before = state_of(path)
    with engine(path, pool, prepare=prepare, **options) as one:
        with RunFile(path) as file:
            parts = read_parts(file)
        asked = None if globs is None else FindMargins(globs=tuple(globs), most_runs=budget)
        stood = Stood(status=before.status, reason=before.reason)
        find_margins(parts, one.journal, pool, one.control, asked, stood)
        return one.journal.state


@pytest.fixture
def path(tmp_path):
    found = new_run(tmp_path)
    drive(found, fake())
    return found


def table(state):
    return list(lines(state.margins))


def test_what_is_found_of_a_number_and_the_nearest_fix(path):
    before = state_of(path)
    state = work(path, fake())
    wall, speed = margins_of(state.margins)
    assert (wall.asked.name, speed.asked.name) == ("wall.y", "controller.speed")
    assert wall.up.until.value <= 0.7 < wall.up.goal.value < 0.8
    assert (wall.down.gone, wall.down.until.value) == (None, wall.asked.low)
    assert (speed.down.gone.verdict, speed.up.gone) == ("other", None)
    assert speed.down.gone.value < 0.5 <= speed.down.until.value
    (fix, *_) = fixes_of(state.margins)
    assert (fix.name, fix.reached, fix.runs, fix.confirmed) == ("wall.y", FIX_RUNS, FIX_RUNS, True)
    assert fix.value == wall.up.goal.value
    # The reduction is as it was, and no seed of the fix was seen by the search.
    same = (
        "status",
        "reason",
        "minimal",
        "environment",
        "certificates",
        "nodes",
        "tests",
        "rounds_done",
    )
    assert [getattr(state, name) for name in same] == [getattr(before, name) for name in same]
    searched = {one.seed for one in state.margins.runs if one.run < 1_000}
    assert len({one.seed for one in state.margins.runs} - searched) == FIX_RUNS


@pytest.mark.parametrize(
    "engines", slow(pytest.mark.rates, [(1, [6] * 10), (5, [7, 7, 30])], but=[(5, [7, 7, 30])])
)
def test_whoever_works_on_it_and_however_often_it_is_killed_the_table_is_the_same(
    path, tmp_path, engines
):
    jobs, moments = engines
    (tmp_path / "again").mkdir()
    other = new_run(tmp_path / "again")
    drive(other, fake())
    once = work(path, fake(2))
    for after in moments:
        with suppress(Killed):
            work(
                other, fake(jobs, after), prepare=lambda file, after=after: kill_after(file, after)
            )
    assert state_of(other).margining is not None
    again = work(other, fake(jobs, 3), globs=None)
    assert table(again) == table(once)
    assert sorted(again.margins.runs, key=lambda one: (one.name, one.value, one.run)) == sorted(
        once.margins.runs, key=lambda one: (one.name, one.value, one.run)
    )


@pytest.mark.parametrize("budget", [24, 31, 37])
def test_where_the_runs_run_out_the_table_is_the_same_with_any_number_of_workers(tmp_path, budget):
    def doubtful(keep, seed, changes):
        return "similar" if changes.get("wall.y", 0.0) < 0.3 or seed % 3 else "other"

    found = []
    for jobs in (1, 2, 5):
        (tmp_path / str(jobs)).mkdir()
        path = new_run(tmp_path / str(jobs))
        drive(path, fake())
        pool = fake(jobs, 4)
        pool.changed = doubtful
        found.append(work(path, pool, globs=["wall.y"], budget=budget))
    assert table(found[0]) == table(found[1]) == table(found[2])
    assert all(len(state.margins.runs) <= budget for state in found)


def test_a_stop_keeps_all_and_the_run_is_as_it_was(path):
    before, pool = state_of(path), fake()
    made = []

    def stops(keep, seed, changes):
        made.append(seed)
        if len(made) == 10:
            send(path, "stop")
        return margins_like(keep, seed, changes)

    pool.changed = stops
    with pytest.raises(Stopped, match="stopped by the user"):
        work(path, pool)
    with RunFile(path) as file:
        file.own()
        Journal(file).record(EngineStopped(reason="stopped by the user"))
    state = state_of(path)
    assert (state.status, state.reason, state.minimal) == (
        before.status,
        before.reason,
        before.minimal,
    )
    assert len(state.margining.runs) >= 8
    assert table(work(path, fake(), globs=None)) == table(work(path, fake()))


def test_a_budget_is_kept_and_what_was_found_before_stays(path):
    first = work(path, fake(), budget=30)
    assert len(first.margins.runs) <= 30 + FIX_RUNS
    assert margins_of(first.margins)[0].asked.name == "wall.y"
    second = work(path, fake(), globs=["controller.speed"])
    assert [one.asked.name for one in margins_of(second.margins)] == ["wall.y", "controller.speed"]
    assert second.margins.runs[: len(first.margins.runs)] == first.margins.runs
    assert margins_of(second.margins)[0] == margins_of(first.margins)[0]


def test_a_fix_that_only_the_seeds_of_the_search_show_is_refuted(path):
    pool = fake()
    pool.changed = lambda keep, seed, changes: (
        "similar" if changes.get("wall.y", 0.0) <= 0.7 else "pass" if seed < 1_000 else "other"
    )
    state = work(path, pool, globs=["wall.y"])
    assert {fix.confirmed for fix in fixes_of(state.margins)[:MOST_FIXES]} == {False}
    assert any("no fix is certified" in line.lower() for line in table(state))


def together(keep, seed, changes):
    """Far to the left, or slowly, something else happens; only both together lead to the goal."""
    left, slow_ = changes.get("wall.y", 0.0) > 0.7, changes.get("controller.speed", 1.0) < 0.5
    return "pass" if left and slow_ else "other" if left or slow_ else "similar"


def test_two_numbers_are_changed_together_where_no_single_one_leads_to_the_goal(path, tmp_path):
    pool = fake()
    pool.changed = together
    state = work(path, pool)
    *single, both = margins_of(state.margins)
    assert all(side.goal is None for one in single for side in one.sides)
    assert both.asked.name == "wall.y & controller.speed"
    changes = dict(changes_at(both.asked, both.up.goal.value))
    assert together((), 0, changes) == "pass"
    (fix,) = [one for one in fixes_of(state.margins) if one.confirmed]
    assert (fix.name, fix.value, fix.runs) == (both.asked.name, both.up.goal.value, FIX_RUNS)
    said = table(state)[len(single) + 3]
    for name, value in changes.items():
        assert f"{name} from " in said and f" to {value:.4g}" in said
    assert "of their ranges" in said
    # The world with both is written, and another call finds all of it known.
    given = [f"{name}={value}" for name, value in changes.items()]
    export_world(path, tmp_path / "fixed.sdf", tmp_path / "fixed.yaml", margins=given)
    fixed = load_scenario(tmp_path / "fixed.yaml")
    assert fixed.controller.speed == pytest.approx(changes["controller.speed"])
    assert len(work(path, fake()).margins.runs) == len(state.margins.runs)


def test_the_run_that_shows_f_has_one_beside_it_at_each_value(path):
    state = work(path, fake())
    left = beside(state)
    assert left.outcome == "similar"
    assert set(state.models_of(left)) == set(state.environment)
    with RunFile(path) as file:
        position = Position(file.events)
        position.catch_up()
        found = changes(file, state, None)
        assert [one.name for one in found] == GLOBS
        for one in found:
            run, test = changed_run(state, one.parting.without_test)
            assert one.parting.with_test == left.id
            assert (run.name, run.value, run.seed) == (one.name, one.value, left.seed)
            assert file.motion(test.id) == played(file, position, test.id).rows
    with pytest.raises(UserError, match="there is no run 9999 with a changed number"):
        changed_run(state, -9999)


def test_a_value_that_is_not_possible_is_said_and_makes_no_run(path):
    state = work(path, fake(), globs=["deck.z"])
    (deck,) = margins_of(state.margins)
    refused = [one for side in deck.sides for one in side.tried if one.verdict == "impossible"]
    assert refused
    assert all("inside" in one.why and not one.outcomes for one in refused)


def test_what_is_wrong_is_said_in_one_line(path):
    broken = fake()
    broken.changed = lambda *_: "error"
    before = state_of(path)
    with pytest.raises(UserError, match="25 runs in a row broke; the last one: it broke"):
        work(path, broken)
    with RunFile(path) as file:
        file.own()
        Journal(file).record(EngineFailed(reason="25 runs in a row broke"))
    # The reduction is as it was, and what broke is no claim.
    state = state_of(path)
    assert (state.status, state.reason, state.margining) == (before.status, before.reason, None)
    assert not [
        value
        for one in margins_of(state.margins)
        for side in one.sides
        for value in side.tried
        if value.verdict == "f"
    ]
    with pytest.raises(UserError, match=r"there is no number 'wal\.y' \(did you mean wall\.y\?\)"):
        work(path, fake(), globs=["wal.y"])


@pytest.mark.programs
def test_a_run_with_another_value_has_the_bits_of_the_world_that_is_exported(tmp_path):
    """Also after a run with the present value in the same worker, and before another one."""
    run = tmp_path / "one.ddenv"
    create_run(wall(), run)
    with RunFile(run) as file:
        scenario, world, robot = read_parts(file)
    keep = frozenset(world.elements())
    files = tmp_path / "fixed.sdf", tmp_path / "fixed.yaml"
    export_world(run, *files, margins=("wall.y=0.25",))
    fixed = load_scenario(files[1])
    with (
        closing(Pool(scenario, world, robot, 1)) as pool,
        closing(Pool(fixed, *load_parts(fixed), 1)) as other,
    ):
        own = [
            simulated(pool, keep, changes)
            for changes in ((), (("wall.y", 0.25),), (("wall.y", 2.0),), ())
        ]
        exported = simulated(other, keep, ())
    assert np.array_equal(own[1], exported)
    assert np.array_equal(own[0], own[3])
    assert not np.array_equal(own[0][-1], own[2][-1])


def simulated(pool, keep, changes):
    """The robot's trajectory with seed 1."""
    pool.submit(1, Run(keep=keep, seed=1, changes=changes))
    while not (ended := pool.finished(1.0)):
        pass
    return ended[0][1].trajectory
