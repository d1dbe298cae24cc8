"""What a student can foretell at a moment of any run, the reasons to choose from, and what is wrong with the others."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ddenv.learn.lesson import Answer, Foretold, Question
from ddenv.runfile.events import RoundStarted, TestFinished, TestStarted, deed
from ddenv.runfile.position import Chapter, Moment, Position
from ddenv.runfile.run_settings import Settings, settings
from ddenv.runfile.state import Candidate, Round, RunState, Test
from ddenv.runfile.tested import pointed
from ddenv.text import count

SAID = {
    "similar": "f again: it fails as in the whole world",
    "other": "another failure: elsewhere, or otherwise",
    "pass": "the goal is reached",
}
# Candidates of a round to choose from, and models of a candidate that are named there.
MOST, FEW = 5, 3
# By the setting `growth`, what n does.
_GROWTH = {
    "paper": "After each round n grows by one, but never above the number of models.",
    "steady": "n grows by one after a round without f, but never above the number of models. After a reduction it stays.",
}
_OF_OTHER = (
    Answer(
        "It may have another cause, so it does not count as f.",
        True,
        "Only an end like that of f counts. This one is elsewhere, or came about otherwise.",
    ),
    Answer("Any failure is good enough: this is f.", False, "Only the same failure counts, close to f's end.", "any"),
    Answer(
        "The test is broken: fewer models cannot make the robot fail.",
        False,
        "With fewer models the robot can take another path, and find another trap.",
        "fewer",
    ),
)
_ALWAYS_THROUGH = Answer(
    "With fewer models the robot always gets through.",
    False,
    "Not always: fewer models can open a path into another trap.",
    "fewer",
)
_OF_MISS = (
    Answer(
        "Something that f needs is probably gone.",
        True,
        "Probably: one miss can be bad luck where a failure is flaky. That is why tests are repeated.",
    ),
    Answer(
        "Now it is proved that f needs what was left out.",
        False,
        "It may have been bad luck: one test proves little.",
        "proof",
    ),
    _ALWAYS_THROUGH,
)
# Where each candidate has one run.
_OF_ONLY_MISS = (
    Answer(
        "Something that f needs is gone.",
        True,
        "This search runs each candidate once, so a single miss decides.",
    ),
    Answer(
        "It was bad luck: another run would show f.",
        False,
        "That can happen where a failure is flaky. This search runs each candidate once, and takes the miss as its answer.",
    ),
    _ALWAYS_THROUGH,
)


@dataclass(frozen=True, slots=True)
class Foretelling:
    """`question` comes before, `reason` once the event `until` is shown; `reason` may be None.

    Foretellings of one `kind` ask for the same reason.
    """

    question: Question
    until: int
    reason: Question | None = None
    kind: str = ""

    @property
    def told(self) -> Foretelling:
        """The same, with the reason told at the right answer in place of asked."""
        if self.reason is None:
            return self
        seen = self.question.answers[self.question.right].why
        because = f"{seen} {self.reason.answers[self.reason.right].why}"
        answers = tuple(replace(each, why=because) if each.why == seen else each for each in self.question.answers)
        return replace(self, question=replace(self.question, answers=answers), reason=None)


def foretelling(position: Position, at: int, what: Foretold) -> Foretelling | None:
    """What can be foretold at the event `at`; None if nothing comes of it there."""
    moment = position.moment(at)
    if moment is None:
        return None
    return {"outcome": _outcome, "winner": _winner, "parts": _parts}[what](position, moment)


def at_hand(moment: Moment) -> Foretold | None:
    """What a student can foretell where a run is stepped through freely."""
    event = moment.recorded.event
    if isinstance(event, TestStarted) and pointed(moment) is not None:
        return "outcome"
    return "winner" if isinstance(event, RoundStarted) else None


# How a test ends.


def _outcome(position: Position, moment: Moment) -> Foretelling | None:
    number = len(moment.after.tests)
    if not isinstance(moment.recorded.event, TestStarted) or not 0 < number <= len(position.end.tests):
        return None
    test, candidate = position.end.tests[number - 1], pointed(moment)
    until = next((id for id in position.ids if id > moment.recorded.id and _ends(position, id, number)), None)
    if test.outcome not in SAID or candidate is None or until is None:
        return None
    answers = tuple(Answer(words, outcome == test.outcome, _seen(test)) for outcome, words in SAID.items())
    what = f"Test {number} runs {_what(candidate)}. How does it end?"
    reason = why_ended(test, candidate, settings(moment.after))
    return Foretelling(Question(what, answers, _hint(candidate)), until, reason, test.outcome)


def _ends(position: Position, id: int, test: int) -> bool:
    moment = position.moment(id)
    event = None if moment is None else moment.recorded.event
    return isinstance(event, TestFinished) and event.test == test


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
    if found is None or not isinstance(moment.recorded.event, RoundStarted):
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
    why = "No candidate showed f." if round.winner is None else f"{_name(round.candidates[round.winner])} showed f."
    answers.append(Answer("none of them", none, why, "" if none else "stuck"))
    question = Question(
        f"Round {round.number}: {count(len(listed), 'candidate')}, tested in this order. Which is the first to show f?",
        tuple(answers),
        "The first candidate that has everything f needs wins. 'part A' is A alone, 'without A' is all the rest.",
    )
    kind = "won" if round.winner is not None else "last" if is_last(round) else "none"
    return Foretelling(question, chapter.last, why_won(round), kind)


def _candidate_answer(one: Candidate, round: Round) -> Answer:
    words = f"{one.label}: {_named(one.models)}" if one.size <= FEW else f"{one.label}: {count(one.size, 'model')}"
    if round.winner == one.index:
        return Answer(words, True, f"{_name(one)} showed f, so it becomes E.")
    if round.winner is not None and one.index > round.winner:
        return Answer(words, False, "It was not tried any more: the first candidate that shows f wins.")
    belief = "alone" if one.kind == "partition" else "part"
    return Answer(words, False, f"{_name(one)} did not show f: something that f needs is missing in it.", belief)


def _name(one: Candidate) -> str:
    """Its label at the beginning of a sentence."""
    return one.label[:1].upper() + one.label[1:]


# How E is split next.


def _parts(position: Position, moment: Moment) -> Foretelling | None:
    found = _chapter(position, moment)
    if found is None or settings(moment.after).algorithm != "ddenv":
        return None
    _, round, _ = found
    following = next(
        (each for each in position.chapters if each.kind == "round" and each.number == round.number + 1), None
    )
    after = None if following is None else position.state(following.first).round
    if following is None or after is None or not _is_regular(round, after):
        return None
    size, n, before = len(after.environment), after.n_partitions, len(round.environment)
    reduced, grew = size < before, after.n_partitions > round.n_partitions
    kept = f"{round.candidates[round.winner].label} became E" if round.winner is not None else "E stays as it is"
    right = f"Right: {kept}, and n {f'grows by {n - round.n_partitions}' if grew else f'stays {n}'}."
    options = {
        (max(1, before // 2), n): ("E loses only what f was shown not to need.", ""),
        (size, 2): ("n does not go back to two.", "stuck"),
        (size, n + 1): (f"n {'grows by one, not by two' if grew else 'stays as it is after this round'}.", ""),
        (before, n): ("E is what showed f, and the rest is gone." if reduced else right, "part"),
        (size, n): (right, ""),
    }
    answers = tuple(
        Answer(f"{count(models, 'model')} in {count(parts, 'part')}", (models, parts) == (size, n), why, belief)
        for (models, parts), (why, belief) in sorted(options.items())
        if parts <= models
    )
    if len(answers) < 2:
        return None
    asked = "no candidate showed f" if round.winner is None else f"{round.candidates[round.winner].label} showed f"
    question = Question(
        f"Round {round.number} split {count(before, 'model')} into {count(len(round.partitions), 'part')}, and {asked}. "
        "How does the next round split E?",
        answers,
        _GROWTH[settings(moment.after).growth],
    )
    return Foretelling(question, following.first)


def _is_regular(round: Round, after: Round) -> bool:
    """Whether a round follows from the one before it, and both have as many parts as n says."""
    left = round.environment if round.winner is None else round.candidates[round.winner].models
    as_many = all(len(each.partitions) == each.n_partitions for each in (round, after))
    return as_many and set(after.environment) == set(left)


def why_ended(test: Test, candidate: Candidate, options: Settings) -> Question:
    """What the outcome of a candidate's test means."""
    gone = "the models of the part" if candidate.kind == "complement" else "all models outside the part"
    if test.outcome == "similar":
        # Of a single model nobody would be wrong to call it the smallest world.
        return Question(
            "f showed. What does that mean?", _turned(_of_f(gone, options)[: 3 if candidate.size > 1 else 2], test.id)
        )
    if test.outcome == "other":
        return Question("It failed, but not as in f. What does that mean?", _turned(_OF_OTHER, test.id))
    once = options.iterations == 0 and options.accept_rate == "first"
    return Question("The goal was reached. What does that mean?", _turned(_OF_ONLY_MISS if once else _OF_MISS, test.id))


def why_won(round: Round) -> Question:
    """Why a candidate of a round showed f, or none did."""
    if round.winner is None:
        return Question("None of them showed f. What does that mean?", _turned(_of_vain_round(round), round.number))
    won = round.candidates[round.winner]
    before = "Those before it probably lack something." if won.index else "It was the first one to be tried."
    answers = (
        Answer("It still has everything that f needs.", True, before),
        Answer(
            "The models that it leaves out caused f.",
            False,
            "They were not there, and f showed all the same. So f does not need them.",
            "part",
        ),
        Answer(
            "It has more models than the others.",
            False,
            "It does not matter how many there are. If a single one that f needs is missing, f is gone.",
            "fewer",
        ),
    )
    return Question(f"{_capital(won.label)} showed f. Why?", _turned(answers, round.number))


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _of_f(gone: str, options: Settings) -> tuple[Answer, ...]:
    goes = f"f shows without {gone}: they can go."
    if options.iterations and options.accept_rate == "first":
        goes = f"f showed without {gone}. Here the first run with f decides, so they go."
    elif options.accept_rate != "first":
        goes = f"f can show without {gone}. Whether it shows often enough, more runs will say."
    return (
        Answer("Everything that f needs is still there.", True, goes),
        Answer(
            "The models that were left out caused f.",
            False,
            "They were not there, and f showed all the same. So f does not need them.",
            "part",
        ),
        Answer(
            "This is the smallest world that shows f.",
            False,
            "Nobody knows: there are smaller ones that were not tried.",
            "smallest",
        ),
    )


def is_last(round: Round) -> bool:
    """Whether the round leaves out each model alone: without f it is the last one."""
    alone = {one.partition for one in round.candidates if one.kind == "complement"}
    return len(alone) == len(round.partitions) == len(round.environment)


def _of_vain_round(round: Round) -> tuple[Answer, ...]:
    lacks = "Each of them lacks something that f needs."
    if is_last(round):
        return (
            Answer(lacks, True, "Each model was left out alone, and each time f was gone. None of them can go."),
            Answer(
                "What is left is the smallest world that shows f.",
                False,
                "Nobody tried all smaller worlds: only that no single model can go is known.",
                "smallest",
            ),
            Answer(
                "The search has failed.", False, "It has ended: it found models of which no single one can go.", "stuck"
            ),
        )
    return (
        Answer(lacks, True, "Smaller parts come next: leaving one out takes away less."),
        Answer("f needs all models of E.", False, "It needs something in each of them, but perhaps not much.", "fewer"),
        Answer("The search has failed.", False, "It goes on: the next round has smaller parts.", "stuck"),
    )


def _turned(answers: tuple[Answer, ...], by: int) -> tuple[Answer, ...]:
    """In another order each time: the right answer has no place of its own."""
    by %= len(answers)
    return answers[by:] + answers[:by]
