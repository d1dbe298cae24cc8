"""Why what is left makes the robot fail: every sentence says what the certificate's runs show, and
where two of them part.
"""

from array import array
from dataclasses import replace

import pytest

from ddenv.errors import UserError
from ddenv.evidence.certificate import Pairs
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.reasons import (
    APART,
    GOAL,
    Divergence,
    End,
    F,
    parted,
    parting_sentence,
    reasons,
    sentence,
)
from ddenv.text import percent_at_least, percent_at_most
from tests.conftest import ROOT
from tests.workbench import fake_moments

LESSONS = ROOT / "src/ddenv/learn/lessons"


@pytest.fixture
def found(run):
    fake_moments.finished(run)
    return run.state, reasons(run.file, run.state)


@pytest.mark.parametrize("lesson", [None, "ditch", "quay-kept", "ditch-sliced"])
def test_there_is_a_reason_for_each_model_that_was_left_out_with_the_numbers_of_its_runs(
    found, lesson
):
    state, each = found
    if lesson is not None:
        with RunFile(LESSONS / f"{lesson}.ddenv") as file:
            state = fold(file.events())
            each = reasons(file, state)
    assert [one.without for one in each] == list(state.environment)
    for one in each:
        tests = [test for test in state.confirm_tests if test.without == one.without]
        assert one.runs == len(tests) == sum(end.number for end in one.ends)
        counts = {end.kind: end.number for end in one.ends}
        assert counts.get(F, 0) == sum(test.outcome == "similar" for test in tests)
        assert counts.get(GOAL, 0) == sum(test.outcome == "pass" for test in tests)


def test_the_sentence_begins_with_what_happens_most_often(found):
    first, second = map(sentence, found[1])
    assert first.startswith("Without crate_00 the robot reaches its goal after ")
    assert "(9 of 11 fresh runs, 38 % to 99 %); it tips over 2.3 m from f's end, near (" in first
    assert second.endswith("; it still fails as in f in 1.")


def test_runs_that_end_far_from_each_other_are_not_said_to_end_near_one_place(found):
    lost = End(kind="lost", number=3, seconds=30.0, place=(1.0, 2.0), reach=2.61)
    one = replace(found[1][0], runs=3, ends=(lost,))
    assert "is lost elsewhere, at most 2.7 m from (1.00, 2.00) m (3 of 3" in sentence(one)


def test_the_runs_that_are_compared_have_one_seed_and_other_ends(found):
    state, each = found
    for one in each:
        mine, other = (
            state.tests[test - 1] for test in (one.parting.with_test, one.parting.without_test)
        )
        assert mine.seed == other.seed == one.parting.seed
        assert (mine.outcome, mine.without) == ("similar", None)
        assert (other.outcome, other.without) == ("pass", one.without)


def test_runs_are_compared_also_where_f_is_what_happens_most(run):
    fake_moments._rounds(run)
    run.start_certificate()
    run.certify_all(2, None, 6 * "s")
    run.certify_all(2, "crate_00", "sspss")
    run.finish_certificate((None, "kept", 6 * "s"), ("crate_00", "not shown", "sspss"))
    one = reasons(run.file, run.state)[0]
    assert one.ends[0].kind == F
    assert run.state.tests[one.parting.without_test - 1].outcome == "pass"


def test_trajectories_part_where_they_first_differ_by_more_than_a_tenth_of_a_metre():
    def way(*ys):
        return array(
            "d",
            [
                value
                for number, y in enumerate(ys)
                for value in (0.1 * number, number, y, 0, 1, 0, 0, 0)
            ],
        )

    same = way(0, 0, 0, 0)
    assert parted(same, same) == (pytest.approx(0.3), None, None)
    # Equal again later does not count.
    equal, apart, place = parted(same, way(0, 0.01, 0, APART))
    assert (equal, apart, place) == (0.0, pytest.approx(0.3), (3.0, APART))
    assert parted(same, way(0, 0, 0))[1] is None


def test_it_says_when_the_robot_met_the_model_and_nothing_where_no_pair_shows_it(found):
    one = found[1][0]
    met = Divergence(
        with_test=1,
        without_test=2,
        seed=7,
        equal=1.2,
        apart=2.0,
        place=(-0.001, 3.0),
        met=1.1,
        touched=True,
    )
    assert parting_sentence(replace(one, parting=met)) == (
        "With seed 7 the two runs differ after 1.2 s, and are 0.1 m apart after 2.0 s, at (0.00, "
        "3.00) m. "
        "With it there, the robot touches it after 1.1 s."
    )
    assert parting_sentence(replace(one, parting=None)) == ""


def test_without_a_certificate_it_says_how_to_make_one(run):
    fake_moments.uncertified(run)
    with pytest.raises(
        UserError, match="no fresh runs were made; make a certificate first: ddenv certify"
    ):
        reasons(run.file, run.state)


def test_of_an_unfinished_certificate_it_says_what_is_shown_so_far(run):
    fake_moments._rounds(run)
    run.start_certificate()
    run.certify_all(2, None, 12 * "s")
    run.certify_all(2, "crate_00", 8 * "p")
    # Nine tenths of the certificate's error are for claims in turn. The whole world runs only where
    # what is left misses f.
    kept, often = min(2 / 3, Pairs(both=12).keeps_at_least(0.027)), Pairs(second=8).at_most(0.027)
    with pytest.raises(UserError) as refused:
        reasons(run.file, run.state)
    assert str(refused.value) == (
        f"{run.path}: its certificate is not finished; so far at least {percent_at_least(kept)} "
        "of the whole world's rate is kept; "
        f"without crate_00 f shows at most {percent_at_most(often)} as often; make a certificate "
        f"first: ddenv resume {run.path}"
    )
