"""What fresh runs may claim: rarely anything wrong, and the same whatever finishes first."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.evidence.certificate import (
    ERROR,
    MOST_BROKEN,
    MOST_PAIRS,
    Terms,
    error_of,
    falls,
    good_enough,
    keeps,
    settle,
)
from tests.tiers import examples, slow

WHOLE, LEFT = Environment.whole(6), Environment.whole(2)
salts = st.integers(0, 10**6)
chances = st.sampled_from([0.0, 0.4, 0.7, 0.9, 1.0])
terms = st.builds(
    Terms, st.floats(0.3, 0.95), st.floats(0.02, 0.99), st.sampled_from([0.03, 0.002]), st.integers(1, 30)
)
PROCEDURES = {
    "keeps": lambda terms: keeps(LEFT, WHOLE, terms),
    "falls": lambda terms: falls(LEFT, WHOLE, terms),
    "good_enough": lambda terms: good_enough(LEFT, terms.rate, terms.keep_rate, 0.3 * terms.rate),
}
procedures = st.sampled_from(sorted(PROCEDURES)).map(PROCEDURES.get)


def outcomes(left, whole, salt, breaks=0.0):
    """Independent runs, the same whenever they are asked for."""

    def shown(subject, run):
        draw = random.Random(f"{salt} {len(subject)} {run}")
        return "broken" if draw.random() < breaks else draw.random() < (whole if subject == WHOLE else left)

    return shown


def test_the_errors_of_all_certificates_add_up():
    assert sum(error_of(number) for number in range(1, 10_000)) == pytest.approx(ERROR, rel=1e-3)


@given(procedure=procedures, terms=terms, left=chances, whole=chances, salt=salts, ahead=st.integers(1, 6))
@examples(0.4)
def test_a_claim_does_not_depend_on_which_tests_finish_first_nor_on_how_many_run(
    procedure, terms, left, whole, salt, ahead
):
    shown, known, order = outcomes(left, whole, salt, 0.02), {}, random.Random(salt)
    alone = settle(procedure(terms), shown)
    while not (claim := settle(procedure(terms), lambda *test: known.get(test), ahead)).verdict:
        assert claim.wanted
        assert not known.keys() & set(claim.wanted)
        for test in order.sample(claim.wanted, order.randint(1, len(claim.wanted))):
            known[test] = shown(*test)
    assert claim == alone
    assert alone.runs <= 2 * MOST_PAIRS


@given(
    procedure=procedures,
    terms=terms,
    left=chances,
    whole=chances,
    salt=salts,
    broken=st.sets(st.integers(0, 40), max_size=5),
)
def test_a_broken_run_counts_for_nothing(procedure, terms, left, whole, salt, broken):
    """It claims the same as if the runs with these seeds had not been."""
    sound = [run for run in range(3 * MOST_PAIRS) if run not in broken]
    shown = outcomes(left, whole, salt)
    without = settle(procedure(terms), lambda subject, run: shown(subject, sound[run]))
    claim = settle(procedure(terms), lambda subject, run: "broken" if run in broken else shown(subject, run))
    assert claim.verdict == without.verdict
    assert claim.runs == without.runs + sum(run < claim.runs for run in broken)


@given(procedure=procedures, terms=terms)
def test_where_all_runs_break_nothing_is_known(procedure, terms):
    claim = settle(procedure(terms), lambda *_: "broken")
    assert claim.verdict == "unknown"
    assert claim.runs == MOST_BROKEN + 1


@given(terms=terms, left=chances, whole=chances, salt=salts)
def test_what_is_claimed_rests_on_as_many_runs_as_asked_for(terms, left, whole, salt):
    shown = outcomes(left, whole, salt)
    for procedure, good in ((keeps, "kept"), (falls, "needed")):
        claim = settle(procedure(LEFT, WHOLE, terms), shown)
        assert claim.verdict != good or claim.runs >= terms.at_least


@given(terms=terms)
def test_the_whole_world_keeps_its_rate_and_is_run_nevertheless(terms):
    claim = settle(keeps(WHOLE, WHOLE, terms), lambda *_: True)
    assert (claim.verdict, claim.runs) == ("kept", terms.at_least)


@given(rate=st.floats(0.5, 0.98), keep_rate=st.floats(0.3, 0.8))
def test_where_f_always_shows_a_few_runs_are_enough(rate, keep_rate):
    terms = Terms(keep_rate, rate, error_of(1) / 2, 10)
    assert settle(keeps(LEFT, WHOLE, terms), lambda *_: True).verdict == "kept"
    needed = settle(falls(LEFT, WHOLE, terms), lambda subject, _: subject == WHOLE)
    assert needed.verdict == "needed"
    assert needed.runs <= 40
    assert settle(keeps(LEFT, WHOLE, terms), lambda subject, _: subject == WHOLE).verdict == "lost"
    assert settle(falls(LEFT, WHOLE, terms), lambda *_: True).verdict == "not needed"


def test_runs_of_the_sure_ones_are_few():
    """At 10 of 10, what is left runs alone at first."""
    claim = settle(keeps(LEFT, WHOLE, Terms(0.8, 10.5 / 11, error_of(1) / 2, 10)), lambda *_: True)
    assert claim.runs <= 25
    assert {subject for subject, _ in claim.rests_on} == {LEFT}


def share(verdict, procedure, left, whole, error, simulated, together=0.0):
    """How often `verdict` is claimed; `together` is the share of seeds with which both runs have the same luck."""
    claimed = 0
    for number in range(simulated):
        draw = random.Random(number)
        baseline = sum(draw.random() < whole for _ in range(10))
        running = procedure(LEFT, WHOLE, Terms(0.8, (baseline + 0.5) / 11, error))
        subjects = next(running)
        while True:
            mine = draw.random()
            theirs = mine if draw.random() < together else draw.random()
            result = tuple((theirs < whole) if subject == WHOLE else (mine < left) for subject in subjects)
            try:
                subjects = running.send(result)
            except StopIteration as end:
                claimed += end.value == verdict
                break
    return claimed / simulated


NULLS = ["1.0", "0.95", "0.95 paired", "0.8", "0.8 paired", "0.5", "0.5 paired", "0.3"]
NULL_CASES = slow(pytest.mark.rates, NULLS, but=["0.95", "0.5 paired"])


def share_wrong(case, procedure, verdict, ratio):
    """The share of false claims where the true rate is `ratio` of the whole world's, and the most it may be."""
    simulated, error, whole = 400, error_of(1), float(case.split()[0])
    wrong = share(verdict, procedure, ratio * whole, whole, error, simulated, 0.6 * case.endswith("paired"))
    # Three standard deviations of the simulation.
    return wrong, error + 3 * (error / simulated) ** 0.5


@pytest.mark.parametrize("case", NULL_CASES)
def test_a_rate_just_below_what_must_be_kept_is_rarely_called_kept(case):
    wrong, most = share_wrong(case, keeps, "kept", 0.79)
    assert wrong <= most


@pytest.mark.parametrize("case", NULL_CASES)
def test_a_model_without_which_the_rate_is_just_kept_is_rarely_called_needed(case):
    wrong, most = share_wrong(case, falls, "needed", 0.8)
    assert wrong <= most


@pytest.mark.parametrize("whole", slow(pytest.mark.rates, [0.5, 0.65, 0.8, 0.95, 1.0], but=[0.95]))
def test_what_is_true_is_mostly_shown(whole):
    simulated = 40 if whole == 0.95 else 200
    error = error_of(1) / 2
    assert share("kept", keeps, whole, whole, error, simulated) >= 0.75
    assert share("needed", falls, 0.0, whole, error / 4, simulated) >= 0.95
