"""The nearest world that passes: as few models removed as can be, whoever works on it, and with
fresh runs of the end.
"""

import tempfile
from contextlib import suppress
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.engine.__main__ import _give_up
from ddenv.engine.control import Stopped
from ddenv.engine.isolate import FEWEST_RUNS, isolate
from ddenv.evidence.claims import is_nearest
from ddenv.run_numbers import ISOLATIONS
from ddenv.runfile.fold import fold
from ddenv.runfile.state import ISOLATE
from ddenv.runfile.store import RunFile
from tests.engine.fake import ELEMENTS, FakePool, drive, engine, new_run
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import needs
from tests.engine.reading import send, state_of
from tests.tiers import examples


def reduced(folder, oracle, **more):
    path = new_run(Path(folder), **more)
    drive(path, FakePool(oracle, 2))
    return path


def work(path, pool, prepare=lambda _: None, at_least=None):
    """Isolates as the engine program does, in this process."""
    before = state_of(path).reason
    with engine(path, pool, prepare=prepare) as one:
        isolate(one.world, one.journal, one.scheduler, at_least, before)
        return one.journal.state


def any_of(*groups):
    """f shows wherever all models of any of `groups` are there: that is how a world fails for
    several reasons.
    """
    return lambda keep, seed: "similar" if any(group <= keep for group in groups) else "pass"


def under_way(path):
    state = state_of(path)
    return state.isolating is not None or state.status == "finished"


def removed(state):
    return set(state.removals[state.isolated.found - 1].models)


def fresh(state, gone):
    """The fresh runs without the models `gone`, counted from 0, and how they ended; by the last
    check.
    """
    first = state.isolated.asked.run + (len(state.isolated.checks) - 1) * state.isolated.asked.block
    for test in state.tests:
        if (
            test.removal is not None
            and test.run >= first
            and set(state.removals[test.removal - 1].models) == gone
        ):
            yield test.run - first, test.outcome


def tried(state):
    return {frozenset(one.models): one.verdict for one in state.removals}


def test_one_model_of_each_reason_goes_and_fresh_runs_show_what_that_is_worth(tmp_path):
    oracle = needs("wall", "beam")
    path = reduced(tmp_path, oracle)
    before = state_of(path)
    state = work(path, FakePool(oracle, 2))
    assert len(removed(state)) == 1
    assert removed(state) < {"wall", "beam"}
    first, back = state.isolated.checks[-1].claims
    assert (first.verdict, first.reached, first.runs) == ("passes", FEWEST_RUNS, FEWEST_RUNS)
    assert (back.verdict, back.reached) == ("needed", 0)
    assert back.high < first.low
    # The reduction is as it was.
    same = (
        "status",
        "reason",
        "minimal",
        "environment",
        "certificates",
        "nodes",
        "evidence_test",
        "rounds_done",
    )
    assert [getattr(state, name) for name in same] == [getattr(before, name) for name in same]


@given(
    groups=st.lists(
        st.sets(st.sampled_from(ELEMENTS), min_size=1, max_size=3), min_size=1, max_size=3
    ),
    jobs=st.integers(1, 3),
    salt=st.integers(0, 99),
)
@examples(0.3)
def test_putting_back_any_one_model_makes_the_robot_fail_again(groups, jobs, salt):
    oracle = any_of(*map(frozenset, groups))
    with tempfile.TemporaryDirectory() as folder:
        state = work(reduced(folder, oracle), FakePool(oracle, jobs, salt))
    whole, gone = frozenset(ELEMENTS), removed(state)
    assert oracle(whole - gone, 0) == "pass"
    claims = state.isolated.checks[-1].claims
    assert [claim.verdict for claim in claims] == ["passes", *["needed"] * len(gone)]
    assert {claim.back for claim in claims[1:]} == gone
    assert all(oracle((whole - gone) | {name}, 0) != "pass" for name in gone)
    # The numbers are those of its runs, whose seeds the search did not use.
    for claim in claims:
        made = [outcome for run, outcome in fresh(state, gone - {claim.back}) if run < claim.runs]
        assert (claim.reached, claim.runs) == (made.count("pass"), len(made))
    assert state.isolated.asked.error <= 0.05


@given(after=st.integers(0, 90), jobs=st.integers(1, 3))
@examples(0.3)
def test_killed_and_resumed_it_comes_to_the_same_end(after, jobs):
    oracle = any_of(frozenset({"wall", "beam"}), frozenset({"ball"}))
    with tempfile.TemporaryDirectory() as folder:
        once = work(reduced(folder, oracle), FakePool(oracle, 1))
        path = reduced(folder, oracle)
        with suppress(Killed):
            work(path, FakePool(oracle, jobs, after), lambda file: kill_after(file, after))
        if not under_way(path):
            # Nothing of it is in the file yet: the reduction is resumed.
            drive(path, FakePool(oracle, jobs))
        state = work(path, FakePool(oracle, jobs))
    assert removed(state) == removed(once)
    assert state.isolated.checks[-1].claims == once.isolated.checks[-1].claims
    assert (state.reason, state.minimal) == (once.reason, once.minimal)


def test_what_only_the_seeds_of_the_search_let_pass_is_refuted_by_fresh_runs(tmp_path):
    def oracle(keep, seed):
        if "wall" not in keep:
            return "similar" if seed >= ISOLATIONS.start and "beam" in keep else "pass"
        return "similar" if "beam" in keep else "pass"

    path = reduced(tmp_path, needs("wall", "beam"))
    state = work(path, FakePool(oracle, 2))
    assert removed(state) == {"beam"}
    assert {claim.verdict for check in state.isolated.checks for claim in check.claims[:1]} <= {
        "passes",
        "fails",
    }


def test_where_nothing_lets_the_robot_pass_it_says_so(tmp_path):
    oracle = needs()
    state = work(reduced(tmp_path, oracle), FakePool(oracle, 2))
    assert state.isolated.found is None
    assert state.isolated.checks == ()
    assert all(verdict == "fails" for verdict in tried(state).values())
    # All that may go was among them.
    assert frozenset(ELEMENTS) in tried(state)


def test_a_world_whose_tests_break_is_unknown_and_not_taken(tmp_path):
    def oracle(keep, seed):
        if keep == frozenset(ELEMENTS) - {"wall"}:
            return "error"
        return "similar" if {"wall", "beam"} <= keep else "pass"

    path = reduced(tmp_path, needs("wall", "beam"))
    state = work(path, FakePool(oracle, 2))
    assert removed(state) == {"beam"}
    assert tried(state)[frozenset({"wall"})] == "unknown"


def test_pinned_models_stay_and_a_new_pin_ends_it(tmp_path):
    oracle = needs("wall", "beam")
    path = reduced(tmp_path, oracle)
    send(path, "pin", models=[ELEMENTS.index("wall")])
    drive(path, FakePool(oracle, 2))
    state = work(path, FakePool(oracle, 2))
    assert removed(state) == {"beam"}

    def pins(keep, seed):
        send(path, "pin", models=[ELEMENTS.index("beam")])
        return oracle(keep, seed)

    with pytest.raises(Stopped):
        work(path, FakePool(pins, 2))
    state = state_of(path)
    assert state.isolating is None
    assert state.isolated.found is not None


def test_a_finished_run_implies_tests_here_too(tmp_path):
    """What took no part in the runs of the whole world makes no difference when it alone goes."""
    oracle = any_of({"wall"}, {"beam"})
    path = new_run(tmp_path, accept_rate="kept", slice=True)

    def pool():
        made = FakePool(oracle, 1)
        made.ties, made.took_part = [], lambda keep, seed: frozenset({"wall", "beam"}) & keep
        return made

    drive(path, pool())
    state = work(path, pool())
    assert removed(state) == {"wall", "beam"}
    implied = [
        test for test in state.tests if test.phase == ISOLATE and test.implied_by is not None
    ]
    assert implied
    for test in implied:
        keep = frozenset(ELEMENTS).difference(state.removals[test.removal - 1].models)
        assert test.outcome == oracle(keep, test.seed)
    assert state.refuted is None


def test_the_budget_of_the_reduction_does_not_end_it(tmp_path):
    oracle = needs("wall", "beam")
    path = reduced(tmp_path, oracle, budget=500)
    with RunFile(path) as file:
        budget = fold(file.events()).made
        file.send("change", settings={"budget": budget + 1})
    drive(path, FakePool(oracle, 1))
    state = work(path, FakePool(oracle, 2))
    assert (state.budget, state.status) == (budget + 1, "finished")
    assert state.made > state.budget
    assert removed(state) < {"wall", "beam"}


@pytest.fixture
def interrupted(tmp_path):
    """An isolation that was killed after some tests, and how the reduction had ended."""
    oracle = any_of(frozenset({"wall", "beam"}), frozenset({"ball"}))
    path = reduced(tmp_path, oracle)
    before = state_of(path)
    with suppress(Killed):
        work(path, FakePool(oracle, 2), lambda file: kill_after(file, 30))
    with RunFile(path) as file:
        assert fold(file.events()).isolating is not None
    return path, before, oracle


def test_one_that_is_given_up_leaves_the_run_as_it_was(interrupted):
    path, before, oracle = interrupted
    with RunFile(path) as file:
        _give_up(file)
        after = fold(file.events())
    assert (after.isolating, after.isolated) == (None, None)
    same = ("status", "reason", "minimal", "environment", "certificates", "nodes", "started_at")
    assert [getattr(after, name) for name in same] == [getattr(before, name) for name in same]
    # Another one finds its tests again.
    pool = FakePool(oracle, 1)
    state = work(path, pool)
    assert len(removed(state)) == 2
    assert len(pool.made) < sum(test.phase == ISOLATE for test in state.finished_tests)


def test_another_number_of_fresh_runs_is_kept_where_one_was_interrupted(interrupted):
    path, before, oracle = interrupted
    state = work(path, FakePool(oracle, 2), at_least=30)
    assert [one.asked.at_least for one in state.isolations] == [FEWEST_RUNS, 30]
    assert state.isolations[0].broken_off
    assert state.isolated.checks[-1].claims[0].runs == 30
    assert (state.status, state.reason) == (before.status, before.reason)


def test_the_search_can_go_on_after_it(tmp_path):
    """The tests of isolation are no round's."""
    oracle = needs("wall", "beam")
    path = reduced(tmp_path, oracle)
    work(path, FakePool(oracle, 2))
    before = state_of(path)
    send(path, "go_back", node=0)
    with engine(path, FakePool(oracle, 2), prepare=lambda file: file.send("resume")) as one:
        one.driver.reduce()
        after = one.journal.state
    assert after.environment == before.environment
    assert after.isolated == before.isolated


def test_a_model_that_fresh_runs_show_may_stay_is_put_back(tmp_path):
    """With the wall back the seeds of the search miss the goal, fresh ones do not."""

    def oracle(keep, seed):
        missed = "wall" in keep and seed < ISOLATIONS.start
        return "similar" if "beam" in keep or missed else "pass"

    state = work(reduced(tmp_path, needs("beam")), FakePool(oracle, 2))
    assert removed(state) == {"beam"}
    assert [claim.verdict for claim in state.isolated.checks[-1].claims] == ["passes", "needed"]
    assert len(state.isolated.checks) > 1


@given(salt=st.integers(0, 10**6), most=st.integers(1, 4), jobs=st.integers(1, 3))
def test_where_chosen_runs_are_reduced_they_pass_and_one_fails_with_any_one_model_put_back(
    salt, most, jobs
):
    def oracle(keep, seed):
        draw = crc32(f"{salt} {sorted(keep)} {seed}".encode()) % 10
        return "pass" if not keep or draw < 4 else "similar"

    with tempfile.TemporaryDirectory() as folder:
        path = new_run(Path(folder), accept_rate="exact", exact_seeds=most)
        before = drive(path, FakePool(oracle, jobs, salt))
        if before.baseline is None:
            return
        state = work(path, FakePool(oracle, jobs, salt))
    one, gone = state.isolated, removed(state)
    passing, baseline = (
        frozenset(ELEMENTS) - gone,
        [test for test in state.tests if test.phase == "baseline"],
    )
    seeds = [test.seed for test in baseline if test.run in one.asked.chosen]
    assert len(seeds) == len(one.asked.chosen) <= most
    assert all(oracle(frozenset(ELEMENTS), seed) == "similar" for seed in seeds)
    assert all(oracle(passing, seed) == "pass" for seed in seeds)
    assert all(any(oracle(passing | {name}, seed) != "pass" for seed in seeds) for name in gone)
    assert is_nearest(one)
    assert one.checks[-1].claims[0].runs == FEWEST_RUNS
