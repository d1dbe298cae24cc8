"""What a student can foretell at a moment of any run, the reasons to choose from, and what is wrong with the others."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.amounts import count
from ddenv.learn.lesson import Answer, Foretold, Question
from ddenv.runfile.events import deed
from ddenv.runfile.position import Chapter, Moment, Position
from ddenv.runfile.state import Candidate, Round, RunState, Test
from ddenv.runfile.tested import pointed

SAID = {
    "similar": "f again: it fails as in the whole world",
    "other": "another failure: elsewhere, or otherwise",
    "pass": "the goal is reached",
}
# Candidates of a round to choose from.
MOST = 5


@dataclass(frozen=True, slots=True)
class Foretelling:
    """`question` comes before, `reason` once the event `until` is shown; `reason` may be None."""

    question: Question
    until: int
    reason: Question | None = None


def foretelling(position: Position, at: int, what: Foretold) -> Foretelling | None:
    """What can be foretold at the event `at`; None if nothing comes of it there."""
    moment = position.moment(at)
    if moment is None:
        return None
    return {"outcome": _outcome, "winner": _winner, "parts": _parts}[what](position, moment)


def at_hand(moment: Moment) -> Foretold | None:
    """What a student can foretell where a run is stepped through freely."""
    kind = moment.event.kind
    if kind == "test_started" and pointed(moment) is not None:
        return "outcome"
    return "winner" if kind == "round_started" else None


# How a test ends.


def _outcome(position: Position, moment: Moment) -> Foretelling | None:
    number = len(moment.after.tests)
    if moment.event.kind != "test_started" or not 0 < number <= len(position.end.tests):
        return None
    test, candidate = position.end.tests[number - 1], pointed(moment)
    until = next((id for id in position.ids if id > moment.event.id and _ends(position, id, number)), None)
    if test.outcome not in SAID or candidate is None or until is None:
        return None
    answers = tuple(Answer(words, outcome == test.outcome, _seen(test)) for outcome, words in SAID.items())
    what = f"Test {number} runs {_what(candidate)}. How does it end?"
    return Foretelling(Question(what, answers, _hint(candidate)), until, _reason(test, candidate))


def _ends(position: Position, id: int, test: int) -> bool:
    moment = position.moment(id)
    return moment is not None and moment.event.kind == "test_finished" and moment.event.data["test"] == test


def _what(candidate: Candidate) -> str:
    if candidate.kind == "partition":
        return f"{candidate.label} alone: {_named(candidate.models)}"
    return f"E {candidate.label}: {_named(candidate.models)}"


def _named(models: tuple[str, ...]) -> str:
    if len(models) > 6:
        return count(len(models), "model")
    return ", ".join(models) or "no model"


def _hint(candidate: Candidate) -> str:
    part = candidate.split.partitions[candidate.partition]
    if candidate.kind == "partition":
        return f"Only the models of the part are there. Everything else is gone: {_named(_others(candidate, part))}."
    return f"Everything of E is there except {_named(part)}."


def _others(candidate: Candidate, part: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in candidate.split.environment if name not in part)


def _seen(test: Test) -> str:
    if test.outcome == "pass":
        return "The robot reached the goal."
    away = "" if test.distance is None else f" {test.distance:.1f} m from f's end"
    return f"The robot {deed(test.failure)}{away}: {'that is f' if test.outcome == 'similar' else 'that is not f'}."


def _reason(test: Test, candidate: Candidate) -> Question:
    """Why a test ended so, and what that means."""
    gone = "the models of the part" if candidate.kind == "complement" else "all models outside the part"
    if test.outcome == "similar":
        answers = (
            Answer("Everything that f needs is still there.", True, f"f shows without {gone}: they can go."),
            Answer(
                "The models that were left out caused f.",
                False,
                "They were not there, and f showed all the same. So f does not need them.",
                "part",
            ),
            Answer(
                "This is the smallest world that shows f.",
                False,
                "Nobody knows yet: there are smaller ones that were not tried.",
                "smallest",
            ),
        )
        return Question("f showed. Why?", _turned(answers, test.id))
    if test.outcome == "other":
        answers = (
            Answer(
                "It failed, but not as in f: it ended elsewhere or otherwise.",
                True,
                "It may have another cause, so it does not count: the candidate is one without f.",
            ),
            Answer(
                "Any failure is good enough: this is f.", False, "Only the same failure counts, near f's end.", "any"
            ),
            Answer(
                "It cannot fail with fewer models; the test is broken.",
                False,
                "With fewer models the robot can take another way, and find another trap.",
                "fewer",
            ),
        )
        return Question("It failed, but not as in f. What does that mean?", _turned(answers, test.id))
    answers = (
        Answer(
            "Something that f needs is probably gone.",
            True,
            "Probably: one miss can be bad luck where a failure is flaky. That is why tests are repeated.",
        ),
        Answer("Now it is proved that f needs what was left out.", False, "One test proves little.", "proof"),
        Answer(
            "With fewer models the robot always gets through.",
            False,
            "Not always: fewer models can open a way into another trap.",
            "fewer",
        ),
    )
    return Question("The goal was reached. What does that mean?", _turned(answers, test.id))


def _turned(answers: tuple[Answer, ...], by: int) -> tuple[Answer, ...]:
    """In another order each time: the right answer has no place of its own."""
    by %= len(answers)
    return answers[by:] + answers[:by]


# Who wins a round.


def _chapter(position: Position, moment: Moment) -> tuple[Chapter, Round, RunState] | None:
    """The round that begins at a moment, as it was at its end, and the state then."""
    started = moment.after.round
    if started is None:
        return None
    found = next((each for each in position.chapters if each.kind == "round" and each.number == started.number), None)
    state = None if found is None else position.state(found.last)
    if found is None or state is None or state.round is None or state.round.number != started.number:
        return None
    return found, state.round, state


def _winner(position: Position, moment: Moment) -> Foretelling | None:
    found = _chapter(position, moment)
    if found is None or moment.event.kind != "round_started":
        return None
    chapter, round, _ = found
    listed = list(round.candidates)
    shown = listed[:MOST]
    if round.winner is not None and round.winner >= MOST:
        shown = [*listed[: MOST - 1], listed[round.winner]]
    if len(shown) < 2:
        return None
    answers = [_candidate_answer(one, round) for one in shown]
    none = round.winner is None
    why = "No candidate showed f." if round.winner is None else f"{round.candidates[round.winner].label} showed f."
    answers.append(Answer("none of them", none, why, "" if none else "stuck"))
    question = Question(
        f"Round {round.number}: {count(len(listed), 'candidate')}, tested in this order. Which is the first to show f?",
        tuple(answers),
        "The first candidate that has everything f needs wins. 'part A' is A alone, 'without A' is all the rest.",
    )
    return Foretelling(question, chapter.last)


def _candidate_answer(one: Candidate, round: Round) -> Answer:
    words = f"{one.label} ({count(one.size, 'model')})"
    if round.winner == one.index:
        return Answer(words, True, f"{one.label} showed f, so E becomes it.")
    if round.winner is not None and one.index > round.winner:
        return Answer(words, False, "It was not tried any more: the first candidate that shows f wins.")
    belief = "alone" if one.kind == "partition" else "part"
    return Answer(words, False, f"{one.label} did not show f: something that f needs is missing in it.", belief)


# How E is split next.


def _parts(position: Position, moment: Moment) -> Foretelling | None:
    found = _chapter(position, moment)
    if found is None:
        return None
    _, round, _ = found
    following = next(
        (each for each in position.chapters if each.kind == "round" and each.number == round.number + 1), None
    )
    after = None if following is None else position.state(following.first).round
    if following is None or after is None:
        return None
    size, n, before = len(after.environment), len(after.partitions), len(round.environment)
    reduced = size < before
    right = "the first candidate with f became E, and n grows" if reduced else "E stays as it is, and n grows"
    options = {
        (size, n): (f"Right: {right}.", ""),
        (before, n + 1 if not reduced else n): (
            "E is what showed f, and the rest is gone." if reduced else "n grows by one after a round, not by two.",
            "part" if reduced else "stuck",
        ),
        (size, 2): ("Splitting in the same way again would only give parts that were tried already.", "stuck"),
        (max(1, before // 2), n): ("E gets smaller only by what was shown to be unnecessary.", "proof"),
    }
    answers = tuple(
        Answer(f"{count(models, 'model')} in {count(parts, 'part')}", (models, parts) == (size, n), why, belief)
        for (models, parts), (why, belief) in sorted(options.items())
        if parts <= models
    )
    if len(answers) < 2:
        return None
    ended = "showed f" if reduced else "did not show f"
    first = round.candidates[round.winner].label if round.winner is not None else "no candidate"
    asked = f"{first} {ended}" if reduced else "no candidate showed f"
    question = Question(
        f"Round {round.number} split {count(before, 'model')} in {count(len(round.partitions), 'part')}, and {asked}. "
        "How does the next round split E?",
        answers,
        "After each round n grows by one, but never above the number of models.",
    )
    return Foretelling(question, following.first)
