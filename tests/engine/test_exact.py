"""Chosen runs reduced exactly: what is left fails with a chosen seed, and with none of them without
any one model.
"""

import tempfile
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.evidence.claims import is_minimal
from ddenv.runfile.fold_decisions import stands_for_all
from ddenv.runfile.state import CERTIFY
from ddenv.schemas import names
from ddenv.words.baseline import baseline
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.guided import guided, until
from tests.engine.killing import killed, resumed, story
from tests.engine.oracles import needs
from tests.engine.participation import MODELS, Participation, sliced_run
from tests.tiers import examples


def chaotic(salt):
    """Some runs of any world show f, with no order among worlds; of the whole one, most do."""

    def oracle(keep, seed):
        draw = crc32(f"{salt} {sorted(keep)} {seed}".encode()) % 10
        return (
            "similar"
            if draw < (6 if len(keep) == len(ELEMENTS) else 4)
            else "other"
            if draw < 6
            else "pass"
        )

    return oracle


def exact_run(folder, **reduction):
    return new_run(Path(folder), accept_rate="exact", **reduction)


def chosen_seeds(state, most):
    baseline = [test for test in state.tests if test.phase == "baseline"]
    return [test.seed for test in baseline if test.outcome == "similar"][:most]


@given(
    salt=st.integers(0, 10**6),
    most=st.integers(1, 5),
    algorithm=st.sampled_from(sorted(names("algorithm"))),
    jobs=st.integers(1, 4),
)
def test_the_end_fails_with_a_chosen_seed_and_with_none_without_any_one_model(
    salt, most, algorithm, jobs
):
    oracle = chaotic(salt)
    with tempfile.TemporaryDirectory() as folder:
        state = drive(
            exact_run(folder, exact_seeds=most, algorithm=algorithm), FakePool(oracle, jobs, salt)
        )
    if state.baseline is None:
        return
    seeds, left = chosen_seeds(state, most), frozenset(state.environment)
    certificate = state.certificate
    assert set(certificate.seeds) <= set(seeds)
    assert certificate.seeds
    assert all(oracle(left, seed) == "similar" for seed in certificate.seeds)
    assert not any(oracle(left - {name}, seed) == "similar" for name in left for seed in seeds)
    assert state.minimal
    assert is_minimal(certificate)
    end, *removals = certificate.claims
    assert [(claim.without, claim.shown, claim.runs) for claim in removals] == [
        (name, 0, len(seeds)) for name in state.environment
    ]
    # Fresh runs say how often it fails with other seeds.
    fresh = [test for test in state.tests if test.phase == CERTIFY]
    assert len(fresh) == end.runs == (1 if stands_for_all(state) else 20)
    assert end.shown == sum(oracle(left, test.seed) == "similar" for test in fresh)
    assert not {test.seed for test in fresh} & {
        test.seed for test in state.tests if test.phase != CERTIFY
    }


@given(
    salt=st.integers(0, 20),
    moments=st.lists(st.integers(1, 60), min_size=1, max_size=4),
    jobs=st.integers(1, 3),
)
@examples(0.2)
def test_killed_at_any_moment_and_with_any_workers_it_comes_to_the_same_end(salt, moments, jobs):
    with tempfile.TemporaryDirectory() as folder:
        undisturbed = drive(exact_run(folder), FakePool(chaotic(salt), 1))
        path = exact_run(folder)
        pool = FakePool(chaotic(salt), jobs, salt)
        killed(path, pool, moments)
        state = resumed(path, pool)
    assert story(state) == story(undisturbed)


NEEDED = st.sets(st.sampled_from(MODELS), min_size=1, max_size=3).map(
    lambda names: tuple(sorted(names))
)


@given(salt=st.integers(0, 99), needed=NEEDED, tenths=st.sampled_from([4, 7, 10]))
@examples(0.3)
def test_slices_of_the_chosen_runs_save_tests_and_keep_the_promise(salt, needed, tenths):
    simulator = Participation(salt=salt, needed=needed, tenths=tenths)
    with tempfile.TemporaryDirectory() as folder:
        state = drive(sliced_run(Path(folder), accept_rate="exact"), simulator.pool())
    if state.baseline is None:
        return
    seeds, left = chosen_seeds(state, 4), frozenset(state.environment)
    # The failure that is reduced is the most frequent one.
    f = simulator.outcome(frozenset(state.elements), seeds[0])
    assert state.minimal
    assert state.refuted is None
    assert all(simulator.outcome(left, seed) == f for seed in state.certificate.seeds)
    assert not any(simulator.outcome(left - {name}, seed) == f for name in left for seed in seeds)


def test_a_simulator_that_does_not_repeat_is_refused(tmp_path):
    pool = FakePool(lambda keep, seed: "similar", 2)
    # Each run ends a hair to the side of the last one: within epsilon of f, but not the same.
    pool.aside = lambda keep, seed: 1e-9 * len(pool.made)
    with pytest.raises(
        UserError, match=r"accept_rate: exact needs runs that repeat, but run 1 of the whole world"
    ):
        drive(exact_run(tmp_path), pool)


def test_that_runs_repeat_is_asked_once(tmp_path):
    pool = FakePool(lambda keep, seed: "similar" if "wall" in keep else "pass", 1)
    state = drive(exact_run(tmp_path), pool)
    assert pool.made.count((frozenset(ELEMENTS), 0)) == 2
    assert state.reason.startswith(
        "f shows with seeds 0, 1, 2 each time; without wall it shows with none of the 3 chosen "
        "seeds"
    )


@pytest.mark.parametrize("what", ["what is left", "a removal"])
def test_where_a_run_behind_the_result_does_not_repeat_nothing_exact_is_said(tmp_path, what):
    """The wall alone stops the robot; the first run of a certain world ended otherwise, by
    chance.
    """
    odd = frozenset({"wall"}) if what == "what is left" else frozenset()
    pool = FakePool(lambda keep, seed: "similar" if "wall" in keep else "pass", 1)
    pool.aside = lambda keep, seed: 1e-9 * pool.made.count((keep, seed)) if keep == odd else 0.0
    state = drive(exact_run(tmp_path), pool)
    assert (state.status, state.minimal, state.environment) == ("finished", False, ("wall",))
    assert state.reason.startswith("not shown that each model is needed: undecided without wall")
    assert any("differs: runs do not repeat" in words for _, words in state.notes)


def test_each_run_behind_the_result_is_replayed_once(tmp_path):
    pool = FakePool(lambda keep, seed: "similar" if "wall" in keep else "pass", 1)
    drive(exact_run(tmp_path, exact_seeds=3), pool)
    again = {test: number for test in pool.made if (number := pool.made.count(test)) > 1}
    behind = [(frozenset({"wall"}), 0), *((frozenset(), seed) for seed in range(3))]
    assert (
        set(behind)
        <= set(again)
        <= {*behind, (frozenset(ELEMENTS), 0)} | {(frozenset({"wall"}), seed) for seed in (1, 2)}
    )
    assert set(again.values()) == {2}


@pytest.mark.parametrize("jobs", [1, 2])
def test_it_can_be_chosen_during_a_run(tmp_path, monkeypatch, jobs):
    # With two workers one of them still runs a test when the new search begins.
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)

    def guide():
        yield from until(lambda state: state.round is not None and state.round.number == 2)
        yield "change", {"settings": {"accept_rate": "exact", "exact_seeds": 1}}

    state = guided(new_run(tmp_path, accept_rate="kept"), needs("wall", "beam"), guide(), jobs)
    assert state.environment == ("wall", "beam")
    assert state.certificate.seeds == (0,)
    assert [claim.runs for claim in state.certificate.claims] == [1, 1, 1]


def test_it_is_offered_with_both_costs_where_f_is_rare_and_not_elsewhere(tmp_path):
    def notes(tenths):
        oracle = lambda keep, seed: "similar" if "wall" in keep and seed % 10 < tenths else "pass"  # noqa: E731
        return dict(
            drive(
                new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(oracle, 1)
            ).notes
        )

    assert "rare" not in notes(7)
    words = notes(5)["rare"]
    assert words.startswith("f shows in 5 of 10 runs: keeping its rate takes about ")
    assert words.endswith("(accept_rate exact, --exact)")


def test_the_price_of_a_certificate_of_a_rare_failure_is_said_before_it_begins(tmp_path):
    def notes(tenths):
        oracle = lambda keep, seed: "similar" if "wall" in keep and seed % 10 < tenths else "pass"  # noqa: E731
        return dict(
            drive(
                new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(oracle, 1)
            ).notes
        )

    words = notes(2)["price"]
    assert words.startswith("f shows in 3 of ")
    assert ": the certificate takes about " in words
    assert words.endswith("(--exact)")
    assert "price" not in notes(5)


def test_where_all_runs_are_alike_one_run_of_them_is_reduced_with_the_search_alone(tmp_path):
    pool = FakePool(needs("wall", "beam"), 1)
    state = drive(exact_run(tmp_path, exact_seeds=1, baseline_runs=10), pool)
    assert pool.made.count((frozenset(ELEMENTS), 0)) == 1
    assert sum(test.phase == "baseline" for test in state.tests) == 2
    # One fresh run, and what is left and each removal once more.
    searched = [test for test in state.tests if test.phase == "round"]
    assert len(pool.made) == 2 + len(searched) + 1 + 3
    assert state.minimal
    assert state.reason.startswith(
        "f shows with seed 0 each time; without any one of these 2 models it does not"
    )
    assert "; with other seeds f in 1 of 1 fresh run" in state.reason
    assert "alike to the last bit, so no more were made" in baseline(state)


@pytest.mark.parametrize("what", ["the way", "what else moves", "the outcome"])
def test_where_the_first_two_runs_differ_in_a_bit_all_runs_of_the_baseline_are_made(tmp_path, what):
    shows = needs("wall")
    pool = FakePool(
        lambda keep, seed: "pass" if what == "the outcome" and seed == 1 else shows(keep, seed), 2
    )
    if what == "the way":
        pool.aside = lambda keep, seed: 1e-12 * (seed == 1)
    if what == "what else moves":
        pool.moves = frozenset({"beam"})
        pool.aside_of_others = lambda keep, seed: 1e-12 * (seed == 1)
    state = drive(exact_run(tmp_path, exact_seeds=1, baseline_runs=10), pool)
    assert sum(test.phase == "baseline" for test in state.tests) == 10
    assert not state.baseline.alike
    assert state.certificate.claims[0].runs == 20


def test_alike_runs_that_do_not_fail_end_no_baseline(tmp_path):
    pool = FakePool(lambda keep, seed: "similar" if "wall" in keep and seed > 1 else "pass", 2)
    state = drive(exact_run(tmp_path, exact_seeds=1, baseline_runs=10), pool)
    assert (state.baseline.runs, state.baseline.failures) == (10, 8)


def test_a_run_that_other_seeds_only_seemed_to_repeat_is_refused_at_the_end(tmp_path):
    """From the third run on, the simulator drifts."""
    pool = FakePool(needs("wall"), 1)
    pool.aside = lambda keep, seed: 1e-9 * max(0, len(pool.made) - 2)
    state = drive(exact_run(tmp_path, exact_seeds=1, baseline_runs=10), pool)
    assert not state.minimal
    assert state.reason.startswith("not shown that each model is needed")


@pytest.mark.parametrize("accept_rate", ["kept", "first"])
def test_to_reduce_one_run_is_offered_with_both_costs_where_all_runs_are_alike_and_not_elsewhere(
    tmp_path, accept_rate
):
    def notes(aside):
        pool = FakePool(needs("wall"), 1)
        pool.aside = lambda keep, seed: aside * seed
        return dict(drive(new_run(tmp_path, accept_rate=accept_rate, baseline_runs=10), pool).notes)

    assert "alike" not in notes(1e-12)
    words = notes(0.0)["alike"]
    assert words.startswith(
        "all 10 runs of the whole world are alike to the last bit: the search and its "
        "certificate take"
    )
    assert words.endswith("(--accept-rate exact --exact-seeds 1)")
