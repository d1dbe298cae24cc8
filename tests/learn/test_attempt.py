"""A student's own search: its verdict is that of the oracle, its moves are kept, and a comparison
says what it was worth.
"""

import math
from dataclasses import asdict
from itertools import combinations

import pytest
from docs.lessons import delivery
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.learn.attempt import Attempt
from ddenv.learn.race import bound, comparison, in_one_sentence
from ddenv.learn.score import Score, score_of, summary
from tests.learn.lessons import course, opened

ORACLE, PLAYS = opened(0).oracle, tuple(opened(0).plays.values())
PLACES = st.lists(
    st.lists(st.integers(0, len(ORACLE.models) - 1), unique=True, max_size=8), max_size=25
)


def shows(models):
    return delivery.outcome(models) == "similar"


def tried(moves, budget=20):
    """A search that tries to leave out these models, one group after another, and says that it is
    done.
    """
    attempt = Attempt(ORACLE, budget)
    for out in moves:
        try:
            attempt.test([name for name in attempt.held if ORACLE.models.index(name) not in out])
        except UserError:
            continue
    attempt.end()
    return attempt


def searched(*groups, budget=20):
    return tried(
        [[ORACLE.models.index(name) for name in group.split()] for group in groups], budget
    )


@given(PLACES)
def test_a_verdict_is_what_the_robot_does_in_every_part(moves):
    attempt = tried(moves)
    held = frozenset(attempt.held)
    assert shows(held) and all(
        each.outcome == delivery.outcome(each.kept) for each in attempt.tried
    )
    can_go = [name for name in held if shows(held - {name})]
    smallest = min(size for size in range(9) if any(map(shows, combinations(ORACLE.models, size))))
    assert attempt.found == (not can_go)
    assert attempt.verdict.startswith("More can go" if can_go else "No single one can go")
    assert sum(name in attempt.verdict for name in can_go) == min(3, len(can_go))
    if not can_go:
        assert ("not the smallest" in attempt.verdict) == (len(held) > smallest)
    assert (
        len({frozenset(each.kept) for each in attempt.tried})
        == len(attempt.tried)
        <= attempt.budget
    )


@given(PLACES)
def test_a_search_goes_on_where_it_was_left(moves):
    attempt = tried(moves)
    score = score_of(asdict(Score(moves={"3": attempt.moves})))
    again = Attempt(ORACLE, 20, score.moves["3"])
    assert (again.held, again.tried, again.ended) == (attempt.held, attempt.tried, True)


@given(
    st.lists(
        st.text(max_size=20) | st.sampled_from(["test sign", "back", "end", "test nobody", "test"]),
        max_size=30,
    )
)
def test_kept_moves_that_are_not_possible_do_no_harm(moves):
    attempt = Attempt(ORACLE, 3, moves)
    assert shows(attempt.held) and len(attempt.tried) <= 3


def test_a_test_that_tells_nothing_costs_nothing():
    attempt = Attempt(ORACLE, 2)
    assert attempt.test(["sign", "crate", "barrel", "cone"]) == "similar"
    for kept, why in (
        (attempt.held, "nothing is left out"),
        (["bench"], "gone already"),
    ):
        with pytest.raises(UserError, match=why):
            attempt.test(kept)
    attempt.back()
    assert len(attempt.held) == 8
    with pytest.raises(UserError, match="test 1 was the same"):
        attempt.test(["sign", "crate", "barrel", "cone"])
    assert attempt.test(["pallet"]) == "other" and len(attempt.held) == 8
    with pytest.raises(UserError, match="no tests are left"):
        attempt.test(["sign"])
    with pytest.raises(UserError, match="all models are there"):
        attempt.back()


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        (("bench plant",), "stopped at 6 models, and at least one of them can still go"),
        (("bench plant pallet bin", "barrel cone"), "fewer than 5: luck"),
        (
            ("bench plant pallet bin", "crate", "sign", "barrel", "cone", "sign barrel"),
            "no algorithm needed fewer",
        ),
        (
            ("bench", "plant", "pallet", "bin", "crate", "sign", "barrel", "cone"),
            "splitting needed fewer: splitting 7",
        ),
    ],
)
def test_one_sentence_compares_with_the_algorithms(groups, words):
    assert words in in_one_sentence(ORACLE, PLAYS, searched(*groups))


def test_side_by_side_are_the_student_the_algorithms_and_the_bound():
    attempt = searched("bench plant pallet bin", "crate")
    lines = {line.name: line for line in comparison(ORACLE, PLAYS, attempt)}
    assert (lines["you"].tests, lines["you"].left, lines["you"].can_go) == (
        2,
        ("sign", "barrel", "cone"),
        False,
    )
    assert lines["minimum"].tests == math.ceil(math.log2(56)) == bound(8, 3)
    assert lines.keys() >= {"ddmin", "ddenv", "splitting", "probdd"}
    for play in PLAYS:
        assert lines[play.name].tests == play.tests and shows(lines[play.name].left)


def test_the_first_search_that_ends_counts_and_the_end_says_it():
    walk = course(
        0, Score(step=next(n for n, step in enumerate(opened(0).lesson.steps) if step.budget))
    )
    assert walk.due and not walk.go_on()
    walk.keep(attempt := searched("bench plant pallet bin", "crate"))
    assert walk.attempt.moves == attempt.moves and walk.score.right == 1 and not walk.due
    walk.keep(searched("bench"))
    assert walk.score.right == 1 and len(walk.score.answered) == 1
    assert walk.go_on() and walk.back() and not walk.due, "a finished search is not asked for again"
    assert "questions right" in summary(opened(0).asked, walk.score)[0]
