"""What a result is worth: the rate is kept, fresh runs show it, and nothing that broke counts."""

import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.evidence.claims import current
from ddenv.run_numbers import CERTIFICATES
from ddenv.runfile.store import RunFile
from ddenv.words.claims import missing
from tests.engine.fake import CHEAP, ELEMENTS, FakePool, drive, engine, new_run
from tests.engine.killing import Killed, killed, resumed, story
from tests.engine.oracles import needs
from tests.engine.reading import models_in, state_of, told
from tests.tiers import examples

METHODS = [
    {},
    {"algorithm": "splitting"},
    {"pair": "learner/timestep", "growth": "steady", "skip": "implied"},
]
every_method = pytest.mark.parametrize(
    "method", METHODS, ids=lambda method: "-".join(method.values()) or "own"
)


def at_rates(salt, *rates):
    """Shows f at the rate of the first entry whose models are all there: ({"wall", "beam"}, 1.0),
    ({"wall"}, 0.25).
    """

    def oracle(keep, seed):
        rate = next((rate for needed, rate in rates if needed <= keep), 0.0)
        return (
            "similar" if crc32(f"{salt} {sorted(keep)} {seed}".encode()) / 2**32 < rate else "pass"
        )

    return oracle


def wrong(salt, often):
    """Cuts `often` of ten runs, and shows then whatever it likes."""

    def cut(keep, seed):
        luck = crc32(f"cut {salt} {sorted(keep)} {seed}".encode())
        return ("similar", "other")[luck // 10 % 2] if luck % 10 < often else ""

    return cut


def kept(folder, **more):
    return new_run(Path(folder), **{"accept_rate": "kept", "keep_rate": 0.8} | more)


def claims(state):
    return {claim.without: claim for claim in state.certificates[-1].claims}


def test_a_certificate_has_fresh_runs_of_what_is_left_and_without_each_model(tmp_path):
    state = drive(kept(tmp_path), FakePool(needs("wall", "beam"), 2))
    assert state.minimal
    assert set(state.environment) == {"wall", "beam"}
    found = claims(state)
    assert [(one.verdict, one.shown == one.runs) for one in found.values()] == [
        ("kept", True),
        ("needed", False),
        ("needed", False),
    ]
    assert found[None].runs >= 10
    fresh = [test for test in state.tests if test.phase == "certify"]
    assert all(test.run >= CERTIFICATES.start for test in fresh)
    assert all(test.run < CERTIFICATES.start for test in state.tests if test.phase != "certify")
    assert state.reason == (
        "no single model can be removed: f in 11 of 11 fresh runs (65 % to 100 %), at least 66 % "
        "of the whole world's rate; "
        "without any one of these 2, f in none of 7 fresh runs each (upper bound: 80 % as often)"
    )


@every_method
def test_an_end_where_f_is_rare_is_left_again(tmp_path, method):
    """One board shows f in a quarter of the runs, both in all: a quarter is not what the user
    saw.
    """
    for salt in range(4):
        oracle = at_rates(salt, ({"wall", "beam"}, 1.0), ({"wall"}, 0.25))
        state = drive(kept(tmp_path, **CHEAP, **method), FakePool(oracle, 2))
        assert {"wall", "beam"} <= set(state.environment)
        assert state.status == "finished"


def test_as_printed_the_certificate_says_that_the_rate_is_lost_and_changes_nothing(tmp_path):
    for salt in range(20):
        oracle = at_rates(salt, ({"wall", "beam"}, 1.0), ({"wall"}, 0.25))
        state = drive(new_run(tmp_path), FakePool(oracle, 2))
        if state.environment == ("wall",):
            break
    assert state.environment == ("wall",)
    assert not state.minimal
    assert state.reason.startswith(
        "what is left keeps less than 50 % of the whole world's rate: f in "
    )
    assert len(state.certificates) == 1


@every_method
@given(
    salt=st.integers(0, 200),
    often=st.integers(0, 10),
    jobs=st.integers(1, 3),
    needed=st.sets(st.sampled_from(ELEMENTS)),
)
@examples(0.15)
def test_whatever_cut_runs_show_the_end_is_what_full_runs_show(method, salt, often, jobs, needed):
    with tempfile.TemporaryDirectory() as folder:
        path = new_run(Path(folder), early_stop=True, accept_rate="kept", **method)
        state = drive(path, FakePool(needs(*needed), jobs, salt, wrong(salt, often)))
    assert state.status == "finished"
    assert state.minimal
    assert set(state.environment) == needed
    assert all(not test.cut for test in state.tests if test.phase in ("baseline", "certify"))


def test_a_lost_rate_is_found_by_bisection_and_the_search_goes_on_from_there(tmp_path):
    oracle = at_rates(3, ({"wall", "beam"}, 1.0), ({"wall"}, 0.25))
    for seed in range(0, 200_000, 20_000):
        state = drive(kept(tmp_path, seed=seed, **CHEAP), FakePool(oracle, 1))
        lost = [node for node in state.nodes if node.lost_rate]
        if lost:
            break
    assert lost
    assert all("beam" not in node.environment for node in lost)
    assert set(state.environment) == {"wall", "beam"}
    assert state.minimal
    # What was refuted is not taken again, and new seeds judge the new end.
    assert all(set(node.environment) > {"wall"} for node in state.path)
    runs = [one.first_run for one in state.certificates]
    assert runs == sorted(set(runs))
    assert sum(one.error for one in state.certificates) <= 0.05


def test_a_model_that_certificates_show_as_needless_is_left_out(tmp_path):
    # Without the ball the seeds of the search miss f, fresh ones do not.
    def oracle(keep, seed):
        return (
            "similar"
            if "wall" in keep and ("ball" in keep or seed >= CERTIFICATES.start)
            else "pass"
        )

    state = drive(kept(tmp_path), FakePool(oracle, 2))
    assert state.environment == ("wall",)
    assert state.minimal
    assert [node.how for node in state.path][-1] == "certified"


def breaks_without(*names):
    def oracle(keep, seed):
        return "similar" if set(names) <= keep else "error"

    return oracle


def test_tests_that_break_leave_a_candidate_unknown_and_no_model_is_called_needed(tmp_path):
    path = kept(tmp_path)
    state = drive(path, FakePool(breaks_without("wall"), 2))
    assert state.environment == ("wall",)
    assert not state.minimal
    assert claims(state)["wall"].verdict == "unknown"
    assert "tests broke without wall" in state.reason
    assert state.lower_bound == 0
    assert "unknown" in [data["verdict"] for data in told(path, "candidate_judged")]
    # Each was made again once.
    broken = [test for test in state.tests if test.outcome == "error"]
    keys = [(models_in(state, test.id), test.run) for test in broken]
    assert all(keys.count(key) == 2 for key in keys)


def test_a_test_that_breaks_once_is_made_again_and_counts_then(tmp_path):
    asked = set()

    def oracle(keep, seed):
        first = (keep, seed) not in asked and "wall" not in keep
        asked.add((keep, seed))
        return "error" if first else needs("wall")(keep, seed)

    state = drive(kept(tmp_path), FakePool(oracle, 2))
    assert state.environment == ("wall",)
    assert state.minimal


def test_the_next_engine_makes_broken_tests_again(tmp_path):
    path = kept(tmp_path)
    assert not drive(path, FakePool(breaks_without("wall"), 2)).minimal
    state = drive(path, FakePool(needs("wall"), 2))
    assert state.environment == ("wall",)
    assert state.minimal


def certified_again(path, oracle, at_least):
    """The state after one more certificate."""
    with engine(path, FakePool(oracle, 2)) as one:
        one.driver.certify(at_least)
        return one.journal.state


def test_a_certificate_can_be_made_again_with_more_runs(tmp_path):
    path = kept(tmp_path)
    before = drive(path, FakePool(needs("wall"), 2))
    state = certified_again(path, at_rates(1, (set(ELEMENTS), 1.0), ({"wall"}, 0.5)), 40)
    assert before.minimal
    assert len(state.certificates) == 2
    assert state.certificates[1].first_run > max(test.run for test in before.tests)
    assert claims(state)[None].verdict == "lost"
    assert state.environment == before.environment
    assert not state.minimal


def test_a_few_broken_fresh_runs_leave_a_finished_run_as_it_is(tmp_path):
    def oracle(keep, seed):
        return "error" if seed == CERTIFICATES.start + 3 else needs("wall")(keep, seed)

    path = kept(tmp_path)
    assert drive(path, FakePool(oracle, 2)).minimal
    with RunFile(path) as file:
        assert not Journal(file).has_broken


def test_a_failure_that_no_fresh_run_shows_needs_nothing_and_proves_nothing(tmp_path):
    def oracle(keep, seed):
        return "similar" if seed in (0, 1, 2) and "wall" in keep else "pass"

    state = drive(kept(tmp_path, baseline_runs=10), FakePool(oracle, 2))
    assert state.status == "finished"
    assert not state.minimal
    assert not any(
        claim.verdict in ("kept", "needed", "not needed") for claim in state.certificates[-1].claims
    )


def test_the_budget_counts_the_tests_of_the_certificate(tmp_path):
    path = kept(tmp_path, budget=30)
    with pytest.raises(Stopped, match="the budget of 30 tests is used up"):
        drive(path, FakePool(needs("wall"), 2))
    state = state_of(path)
    assert state.confirming
    assert state.tests_done == 30


DRIFTING = [
    ({"wall", "beam", "ball"}, 1.0),
    ({"wall", "beam"}, 0.9),
    ({"wall"}, 0.4),
    (set(), 0.02),
]


def certificates(state):
    """The certificates, with the models of each claim: environments are numbered as workers come to
    them.
    """
    return [
        (
            replace(certificate, claims=()),
            [
                (replace(claim, environment=0), state.environments[claim.environment])
                for claim in certificate.claims
            ],
        )
        for certificate in state.certificates
    ]


@given(
    salt=st.integers(0, 30),
    moments=st.lists(st.integers(1, 250), min_size=1, max_size=4),
    jobs=st.integers(1, 3),
)
@examples(0.3)
def test_killed_at_any_moment_it_resumes_to_the_same_end(salt, moments, jobs):
    oracle = at_rates(salt, *DRIFTING)
    with tempfile.TemporaryDirectory() as folder:
        undisturbed = drive(kept(folder, **CHEAP), FakePool(oracle, 1))
        path = kept(folder, **CHEAP)
        killed(path, FakePool(oracle, jobs, salt), moments)
        state = resumed(path, FakePool(oracle, jobs, salt))
    assert (*story(state), state.reason) == (*story(undisturbed), undisturbed.reason)
    # Neither workers nor kills change which seeds a certificate has, and what it rests on.
    assert certificates(state) == certificates(undisturbed)
    made = [(models_in(state, test.id), test.run) for test in state.finished_tests]
    assert len(made) == len(set(made))


def test_a_certificate_that_is_broken_off_leaves_the_one_before_as_it_was(tmp_path):
    path = kept(tmp_path)
    drive(path, FakePool(needs("wall"), 2))

    def dies(keep, seed):
        raise Killed

    with suppress(Killed):
        certified_again(path, dies, 40)
    state = state_of(path)
    assert [bool(one.claims) for one in state.certificates] == [True, False]
    assert current(state) == state.certificates[0]
    assert not missing(state)
