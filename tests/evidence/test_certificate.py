"""What fresh runs may claim: rarely anything wrong, and the same whatever finishes first."""

import random
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.evidence.certificate import (
    ALONE_FIRST,
    ALONE_SHARE,
    ERROR,
    HELPING,
    HELPS_AFTER,
    MOST_BROKEN,
    MOST_PAIRS,
    REFUTED,
    Pairs,
    Terms,
    error_of,
    falls,
    good_enough,
    keeps,
    settle,
)
from tests.tiers import examples

WHOLE, LEFT, REST = Environment.whole(6), Environment.whole(2), Environment.whole(1)
RATES = {WHOLE: 0, LEFT: 1, REST: 2}
salts = st.integers(0, 10**6)
chances = st.sampled_from([0.0, 0.4, 0.7, 0.9, 1.0])
rates = st.tuples(chances, chances, chances)
terms = st.builds(
    Terms,
    certify_rate=st.floats(0.3, 0.9),
    keep_rate=st.floats(0.3, 0.95),
    error=st.sampled_from([0.03, 0.002]),
    at_least=st.integers(1, 30),
)
PROCEDURES = {
    "keeps": lambda terms: keeps(LEFT, WHOLE, terms),
    "falls": lambda terms: falls(REST, LEFT, terms.error),
    "good_enough": lambda terms: good_enough(LEFT, 0.9, terms.keep_rate, 0.3),
}
procedures = st.sampled_from(sorted(PROCEDURES)).map(PROCEDURES.get)
counts = st.builds(Pairs, st.integers(0, 60), st.integers(0, 20), st.integers(0, 60))
FIRST = error_of(1)


def outcomes(rates, salt, breaks=0.0, together=0.0):
    """Runs of the whole world, of what is left and of that without a model: the same whenever they
    are asked for.

    With a share `together` of all seeds, all of them have the same luck.
    """

    def shown(environment, run):
        own, common = (
            random.Random(f"{salt} {len(environment)} {run}"),
            random.Random(f"{salt} {run}"),
        )
        draw = common if common.random() < together else own
        return "broken" if own.random() < breaks else draw.random() < rates[RATES[environment]]

    return shown


def test_the_errors_of_all_certificates_add_up():
    assert sum(error_of(number) for number in range(1, 10_000)) == pytest.approx(ERROR, rel=1e-3)


@given(procedure=procedures, terms=terms, rates=rates, salt=salts, ahead=st.integers(1, 6))
@examples(0.4)
def test_a_claim_does_not_depend_on_which_tests_finish_first_nor_on_how_many_run(
    procedure, terms, rates, salt, ahead
):
    shown, known, order = outcomes(rates, salt, 0.02), {}, random.Random(salt)
    alone = settle(procedure(terms), shown)
    while not (claim := settle(procedure(terms), lambda *test: known.get(test), ahead)).verdict:
        assert claim.wanted
        open_tests = [*claim.wanted, *claim.later]
        assert not known.keys() & set(open_tests)
        for test in order.sample(open_tests, order.randint(1, len(open_tests))):
            known[test] = shown(*test)
    assert claim == alone
    assert len(alone.rests_on) <= 2 * MOST_PAIRS


@given(terms=terms, rates=rates, salt=salts)
def test_what_is_shown_only_grows_and_may_be_looked_at_at_any_time(terms, rates, salt):
    shown, known = outcomes(rates, salt), {}
    for procedure, better in (
        (keeps(LEFT, WHOLE, terms), max),
        (falls(REST, LEFT, terms.error), min),
    ):
        last = None
        while not (claim := settle(procedure, lambda *test: known.get(test))).verdict:
            assert last is None or claim.bound == better(last, claim.bound)
            last = claim.bound
            known.update({test: shown(*test) for test in claim.wanted})
            procedure = (
                keeps(LEFT, WHOLE, terms) if better is max else falls(REST, LEFT, terms.error)
            )
        assert claim.bound == better(claim.bound, last)


@given(pairs=counts, shares=st.lists(st.floats(0.01, 0.999), min_size=2, max_size=2).map(sorted))
def test_a_bet_on_a_higher_share_is_never_richer_so_that_one_bound_holds_for_all(pairs, shares):
    lower, higher = shares
    assert pairs.above(lower) >= pairs.above(higher) * (1 - 1e-9)
    assert pairs.below(lower) <= pairs.below(higher) * (1 + 1e-9)


@given(pairs=counts)
def test_a_run_that_was_not_made_counts_against_what_is_claimed(pairs):
    for better in (
        Pairs(pairs.both, pairs.first + 1, pairs.second),
        Pairs(pairs.both + 1, pairs.first, max(0, pairs.second - 1)),
    ):
        assert (
            better.keeps_at_least(FIRST)
            >= Pairs(pairs.both + 1, pairs.first, pairs.second).keeps_at_least(FIRST) - 0.002
        )


@given(
    procedure=st.sampled_from([PROCEDURES["keeps"], PROCEDURES["falls"]]),
    terms=terms,
    rates=rates,
    salt=salts,
)
def test_a_broken_run_never_helps_a_claim(procedure, terms, rates, salt):
    """Of what is left it counts as a miss, and as f of the whole world and of that without a
    model.
    """
    against = {WHOLE: True, LEFT: False, REST: True}
    shown, breaking = outcomes(rates, salt), random.Random(salt)
    broken = {(one, run) for one in RATES for run in range(MOST_PAIRS) if breaking.random() < 0.02}
    if procedure is PROCEDURES["falls"]:
        against[LEFT] = False
    claim = settle(procedure(terms), lambda *test: "broken" if test in broken else shown(*test))
    worst = settle(
        procedure(terms), lambda *test: against[test[0]] if test in broken else shown(*test)
    )
    if claim.verdict in ("kept", "needed"):
        assert (claim.verdict, claim.bound) == (worst.verdict, worst.bound)
        assert claim.broken == len(broken & set(claim.rests_on))


@given(procedure=procedures, terms=terms)
def test_where_all_runs_break_nothing_is_known(procedure, terms):
    claim = settle(procedure(terms), lambda *_: "broken")
    assert claim.verdict == "unknown"
    assert claim.broken > MOST_BROKEN


@given(terms=terms, rates=rates, salt=salts)
def test_that_the_rate_is_kept_rests_on_as_many_runs_as_asked_for(terms, rates, salt):
    claim = settle(keeps(LEFT, WHOLE, terms), outcomes(rates, salt))
    assert (
        claim.verdict != "kept" or sum(one == LEFT for one, _ in claim.rests_on) >= terms.at_least
    )


@given(terms=terms)
def test_the_whole_world_keeps_its_rate_and_is_run_nevertheless(terms):
    claim = settle(keeps(WHOLE, WHOLE, terms), lambda *_: True)
    assert (claim.verdict, claim.bound, len(claim.rests_on)) == ("kept", 1.0, terms.at_least)


def test_where_f_always_shows_a_few_runs_are_enough():
    terms = Terms(certify_rate=2 / 3, keep_rate=0.8, error=FIRST, at_least=10)
    kept = settle(keeps(LEFT, WHOLE, terms), lambda *_: True)
    assert kept.verdict == "kept"
    # The whole world need not run: it cannot show f more often.
    assert {environment for environment, _ in kept.rests_on} == {LEFT}
    # docs/statistics.md names these numbers.
    assert len(kept.rests_on) == 11
    assert (
        len(settle(keeps(LEFT, WHOLE, replace(terms, certify_rate=0.8)), lambda *_: True).rests_on)
        == 19
    )
    needed = settle(falls(REST, LEFT, terms.error), lambda environment, _: environment == LEFT)
    assert needed.verdict == "needed"
    assert len(needed.rests_on) == 2 * 7
    assert (
        settle(keeps(LEFT, WHOLE, terms), lambda environment, _: environment == WHOLE).verdict
        == "lost"
    )
    assert settle(falls(REST, LEFT, terms.error), lambda *_: True).verdict == "not needed"


def test_the_whole_world_runs_only_where_what_is_left_missed_f_while_that_shows_f_often():
    claim = settle(
        keeps(LEFT, WHOLE, Terms(certify_rate=2 / 3, keep_rate=0.3, error=FIRST)),
        shown := outcomes((0.9, 0.8, 0.0), 5),
    )
    left, whole = (
        {run for one, run in claim.rests_on if one == environment} for environment in (LEFT, WHOLE)
    )
    assert sum(shown(LEFT, run) for run in left) > ALONE_SHARE * len(left) > 2 * ALONE_FIRST
    assert whole == {run for run in left if not shown(LEFT, run)}


def test_the_whole_world_runs_with_all_seeds_where_what_is_left_shows_f_less_often():
    claim = settle(
        keeps(LEFT, WHOLE, Terms(certify_rate=2 / 3, keep_rate=0.3, error=FIRST)),
        shown := outcomes((0.5, 0.5, 0.0), 3),
    )
    left, whole = (
        [run for one, run in claim.rests_on if one == environment] for environment in (LEFT, WHOLE)
    )
    assert sum(shown(LEFT, run) for run in left) < ALONE_SHARE * len(left)
    assert sorted(left) == sorted(whole)


def test_without_a_model_that_helps_f_is_shown_to_be_rarer():
    """As in the paper's friction world: 204 of 240 without one wall, 240 of 240 with it."""
    terms = Terms(certify_rate=2 / 3, keep_rate=0.8, error=FIRST, at_least=10)
    claims = [
        settle(falls(REST, LEFT, terms.error), outcomes((1.0, 1.0, 0.85), salt))
        for salt in range(60)
    ]
    helps = [claim for claim in claims if claim.verdict in HELPING]
    assert len(helps) >= 45
    assert sum(len(claim.rests_on) <= 2 * HELPS_AFTER for claim in helps) >= 0.9 * len(helps)


@pytest.mark.parametrize(("rate", "without"), [(0.05, 0.0), (0.1, 0.3), (0.3, 0.7)])
def test_a_model_is_said_to_help_only_a_little_where_f_is_shown_to_stay_frequent(rate, without):
    """Too rare for a verdict, f is shown to be rarer without a needed model, and by how much is not
    shown.
    """
    rates = (rate, rate, without * rate)
    verdicts = Counter(
        settle(falls(REST, LEFT, FIRST), outcomes(rates, salt)).verdict for salt in range(60)
    )
    assert verdicts["helps"] <= 60 / REFUTED
    assert verdicts["rarer"] + verdicts["needed"] + verdicts["not shown"] >= 45


def share_claimed(verdict, procedure, rates, simulated, together=0.0, breaks=0.0):
    settled = [
        settle(procedure(), outcomes(rates, salt, breaks, together)).verdict
        for salt in range(simulated)
    ]
    return settled.count(verdict) / simulated


@pytest.mark.parametrize("together", [0.0, 0.6])
@pytest.mark.parametrize("whole", [0.5, 0.95])
def test_what_is_true_is_mostly_shown(whole, together):
    terms = Terms(certify_rate=2 / 3, keep_rate=0.8, error=FIRST, at_least=10)
    assert (
        share_claimed("kept", lambda: keeps(LEFT, WHOLE, terms), (whole, whole, 0.0), 40, together)
        >= 0.85
    )
    assert (
        share_claimed(
            "needed", lambda: falls(REST, LEFT, terms.error), (whole, whole, 0.0), 40, together
        )
        >= 0.95
    )


@pytest.mark.parametrize("together", [0.0, 0.6])
@pytest.mark.parametrize("whole", [0.5, 0.9])
def test_what_kept_less_than_the_search_aims_at_is_lost(whole, together):
    terms = Terms(certify_rate=2 / 3, keep_rate=0.8, error=FIRST, at_least=10)
    assert (
        share_claimed(
            "lost", lambda: keeps(LEFT, WHOLE, terms), (whole, 0.3 * whole, 0.0), 40, together
        )
        >= 0.9
    )
