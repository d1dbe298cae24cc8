"""After its end has lost the rate, a search goes back as far as it must, and no farther."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.evidence.certificate import good_enough, settle
from ddenv.reduction.algorithms import sweep, tried_again
from ddenv.reduction.procedure import groups_again, last_good
from tests.reduction.worlds import carried_through

CHAIN = [Environment.whole(length) for length in range(12, 0, -1)]


def outcomes(rate_of, seed=0):
    """Independent runs, the same whenever they are asked for."""

    def shown(subject, run):
        return random.Random(f"{seed} {list(subject)} {run}").random() < rate_of(subject)

    return shown


def place(shown, rate=0.9, lost_rate=0.3):
    return last_good(
        CHAIN, lambda subject: settle(good_enough(subject, rate, 0.8, lost_rate), shown)
    )


@given(last=st.integers(0, 10), salt=st.integers(0, 10**6))
def test_it_goes_back_to_the_last_environment_that_keeps_the_rate(last, salt):
    shown = outcomes(lambda subject: 1.0 if CHAIN[last] <= subject else 0.0, salt)
    assert place(shown, 0.95, 0.0) == last


@given(rates=st.lists(st.floats(0, 1), min_size=12, max_size=12), salt=st.integers(0, 10**6))
def test_the_next_environment_was_judged_as_well(rates, salt):
    """However the rate goes up and down along the chain."""
    shown, verdicts = (
        outcomes(dict(zip(CHAIN, rates, strict=True)).__getitem__, salt),
        {CHAIN[0]: "kept", CHAIN[-1]: "lost"},
    )

    def judged(subject):
        claim = settle(good_enough(subject, 0.9, 0.8, 0.3), shown)
        verdicts[subject] = claim.verdict
        return claim

    found = last_good(CHAIN, judged)
    assert (verdicts[CHAIN[found]], verdicts[CHAIN[found + 1]]) == ("kept", "lost")


def test_where_runs_break_nothing_shows_that_the_rate_is_kept():
    assert place(lambda *_: "broken") == 0


@given(
    needed=st.sets(st.sampled_from(range(12)), min_size=1).map(Environment.of),
    step=st.integers(0, 10),
)
def test_models_that_went_too_early_are_found_and_all_others_go_again(needed, step):
    """The end lacked a needed model since step + 1."""
    good, bad, end = CHAIN[step], CHAIN[step + 1], CHAIN[-1]
    needed = (needed & good) | (good - bad)
    again = tried_again(tuple(good), groups_again(good, bad, end), sweep)
    assert (
        carried_through(again, lambda models: not models <= bad and needed <= models)[0] == needed
    )


@pytest.mark.parametrize(
    ("good", "bad", "end", "groups"),
    [(6, 4, 1, [(1, 2, 3), (4,), (5,)]), (4, 3, 1, [(1, 2)]), (4, 1, 1, [(1,), (2, 3)])],
)
def test_first_goes_what_went_later_then_halves_of_the_step_that_lost_it(good, bad, end, groups):
    """Environments of the first so many models."""
    assert groups_again(*map(Environment.whole, (good, bad, end))) == groups
