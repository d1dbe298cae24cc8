"""What can be foretold, and what is said of each answer, is what the run did: at every moment of
every recorded run.
"""

import pytest

from ddenv.learn.lesson_course import LETTERS, Course
from ddenv.learn.prediction import SAID, at_hand, foretelling
from ddenv.runfile.position import position_in
from ddenv.runfile.run_settings import settings
from ddenv.runfile.store import RunFile
from tests.learn.lessons import RUNS, opened

REASONS = {"similar": "still there", "other": "another cause", "pass": "is gone|is probably gone"}


def sound(question):
    """One answer is right and shows no misconception; all answers differ, and each says why."""
    assert [answer.right for answer in question.answers].count(True) == 1, question
    assert not question.answers[question.right].misconception, question
    assert len({answer.text for answer in question.answers}) == len(question.answers) >= 2, question
    assert all(
        answer.why
        and (answer.why[0].isupper() or answer.why[:2] in ("f ", "n "))
        and answer.why[-1] == "."
        for answer in question.answers
    ), question


def of_outcome(position, moment, found):
    number = len(moment.after.tests)
    test = position.end.tests[number - 1]
    until = position.moment(found.until).recorded
    assert (until.kind, until.event.test) == ("test_finished", number)
    right = found.question.answers[found.question.right]
    assert right.text == SAID[test.outcome]
    assert ("The robot reached the goal" in right.why) == (test.outcome == "pass")
    assert ("that is f." in right.why) == (test.outcome == "similar")
    assert ("that is not f." in right.why) == (test.outcome == "other")
    reason = found.reason.answers[found.reason.right]
    assert any(words in reason.text for words in REASONS[test.outcome].split("|"))
    # Nobody calls four misses a single test.
    same = [(each.round, each.candidate) for each in position.end.tests[:number]].count(
        (test.round, test.candidate)
    )
    if test.outcome == "pass" and settings(moment.after).accept_rate == "first" and same > 1:
        said = " ".join(answer.why for answer in found.reason.answers)
        assert "one test" not in said
    # Where more runs decide, one with f does not let anything go.
    if test.outcome == "similar" and settings(moment.after).accept_rate != "first":
        assert "can go" not in reason.why
    # Where each candidate has one run, there is no other to wait for.
    if settings(moment.after).iterations == 0 and settings(moment.after).accept_rate == "first":
        assert "repeated" not in f"{reason.why}" and "probably" not in reason.text


def of_winner(position, moment, found):
    round = moment.after.round
    end = position.state(found.until).round
    right = found.question.answers[found.question.right]
    if end.winner is None:
        assert right.text == "none of them" and "None of them showed f" in found.reason.text
    else:
        one = end.candidates[end.winner]
        assert one.verdict == "similar" and right.text.startswith(f"{one.label}: ")
        assert f"{one.label[1:]} showed f" in found.reason.text
        assert ("before it" in found.reason.answers[found.reason.right].why) == (end.winner > 0)
    all_shown = len(found.question.answers) == len(end.candidates) + 1
    assert ("tested in this order" in found.question.text) == all_shown
    assert len(found.question.answers) <= len(LETTERS)
    labels = {one.label: one for one in end.candidates}
    for answer in found.question.answers[:-1]:
        one = labels[answer.text.partition(":")[0]]
        assert ("did not show f" in answer.why) == (
            one.verdict != "similar" and not untried(end, one)
        ), answer
        assert ("no longer tried" in answer.why) == untried(end, one), answer
    assert len(round.candidates) == len(end.candidates)


def untried(round, one):
    return round.winner is not None and one.index > round.winner


def of_parts(position, moment, found):
    before, after = moment.after.round, position.state(found.until).round
    right = found.question.answers[found.question.right]
    assert after.number == before.number + 1
    size, n = len(after.environment), len(after.partitions)
    assert right.text == f"{size} model{'s' * (size != 1)} in {n} part{'s' * (n != 1)}"
    assert ("E stays as it is" in right.why) == (size == len(before.environment))
    assert ("grows by" in right.why) == (after.n_partitions > before.n_partitions)


CHECKS = {"outcome": of_outcome, "winner": of_winner, "parts": of_parts}


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.stem)
def test_every_answer_fits_what_the_run_did(run):
    with RunFile(run) as file:
        position = position_in(file.events())
    seen = dict.fromkeys(CHECKS, 0)
    for id in position.ids:
        moment = position.moment(id)
        hand = at_hand(moment)
        for what in {hand} - {None} | (
            {"parts"} if moment.recorded.kind == "round_started" else set()
        ):
            found = foretelling(position, id, what)
            if found is None:
                continue
            seen[what] += 1
            sound(found.question)
            if found.reason is not None:
                sound(found.reason)
                assert found.kind
            CHECKS[what](position, moment, found)
    assert seen["outcome"] > 3 and seen["winner"], seen
    assert bool(seen["parts"]) == (settings(position.end).algorithm == "ddenv"), seen


@pytest.mark.parametrize("number", range(7))
def test_a_lesson_asks_for_each_reason_once(number):
    lesson = opened(number)
    asked = [each for each in lesson.foretold if each is not None and each.reason is not None]
    assert len({each.kind for each in asked}) == len(asked)
    assert lesson.asked == len(asked) + sum(
        bool(step.question or step.foretell or step.budget or step.race)
        for step in lesson.lesson.steps
    )


def test_a_free_walk_asks_for_a_reason_once():
    free = Course(opened(0).position)
    reasons = []
    while free.foretell():
        free.answer(0)
        predicted = free.page.question
        if free.go_on() and free.page.question not in (None, predicted):
            reasons.append(frozenset(answer.text for answer in free.page.question.answers))
            free.skip()
        if not free.move("moment", 1):
            break
    assert 2 < len(reasons) == len(set(reasons)) < 8
