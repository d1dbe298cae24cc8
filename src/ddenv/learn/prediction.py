"""What a student can foretell at a moment of any run, the reasons to choose from, and what is wrong
with the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

from ddenv.learn.lesson import Answer, Foretold, Question
from ddenv.runfile.events import RoundStarted, TestFinished, TestStarted
from ddenv.runfile.failure_words import deed
from ddenv.runfile.position import Chapter, Moment, Position
from ddenv.runfile.run_settings import Settings, settings
from ddenv.runfile.state import Candidate, Round, Test
from ddenv.runfile.tested import pointed
from ddenv.text import Data, Names, count

SAID = {
    "similar": "f again: it fails as in the whole world",
    "other": "another failure: elsewhere, or of another kind",
    "pass": "the goal is reached",
}
# Candidates of a round to choose from, and models of a candidate that are named there.
MOST = 6
FEW = 3
# Why something came about, as questions and answers.
REASONS: dict[str, Data] = yaml.safe_load(Path(__file__).with_name("reasons.yaml").read_text())
# By the setting `growth`, what n does.
_GROWTH = {
    "paper": "After each round n grows by one, but never above the number of models.",
    "steady": (
        "n grows by one after a round without f, but never above the number of models. After a "
        "reduction it stays."
    ),
}


@dataclass(frozen=True, slots=True)
class Foretelling:
    """`question` comes before, `reason` once the event `until` is shown; `reason` may be None.

    Foretellings of one `kind` ask for the same reason.
    """

    question: Question
    until: int
    reason: Question | None = None
    kind: str = ""


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
    if isinstance(event, RoundStarted):
        return "winner"
    return None


# How a test ends.


def _outcome(position: Position, moment: Moment) -> Foretelling | None:
    number = len(moment.after.tests)
    if not isinstance(moment.recorded.event, TestStarted) or not 0 < number <= len(
        position.end.tests
    ):
        return None
    test = position.end.test(number)
    candidate = pointed(moment)
    later = (position.moment(id) for id in position.ids if id > moment.recorded.id)
    ended = (
        each.recorded
        for each in later
        if each is not None and isinstance(each.recorded.event, TestFinished)
    )
    until = next((each.id for each in ended if each.data["test"] == number), None)
    if test.outcome not in SAID or candidate is None or until is None:
        return None
    seen = "The robot reached the goal."
    if test.outcome != "pass":
        away = "" if test.distance is None else f" {test.distance:.1f} m from f's end"
        seen = (
            f"The robot {deed(test.failure)}{away}: "
            f"{'that is f' if test.shows_f else 'that is not f'}."
        )
    answers = tuple(Answer(words, outcome == test.outcome, seen) for outcome, words in SAID.items())
    label = f"{candidate.label} alone" if candidate.kind == "partition" else f"E {candidate.label}"
    what = f"Test {number} runs {label}: {_named(candidate.models)}. How does it end?"
    runs = [position.end.test(id) for id in {*candidate.tests, number} if id <= number]
    missed = len(runs) if all(each.outcome in ("pass", "other") for each in runs) else 1
    reason = _why_ended(test, candidate, settings(moment.after), missed)
    return Foretelling(Question(what, answers, _hint(candidate)), until, reason, test.outcome)


def _named(models: Names) -> str:
    if len(models) > 6:
        return count(len(models), "model")
    return ", ".join(models) or "no model"


def _hint(candidate: Candidate) -> str:
    part = candidate.split.partitions[candidate.partition]
    if candidate.kind == "partition":
        others = tuple(name for name in candidate.split.environment if name not in part)
        return f"Only the models of the part are there. Everything else is gone: {_named(others)}."
    return f"Everything of E is there except {_named(part)}."


# Who wins a round.


def _round(position: Position, number: int) -> Chapter | None:
    return next(
        (each for each in position.chapters if (each.kind, each.number) == ("round", number)), None
    )


def _begun(position: Position, moment: Moment) -> tuple[Chapter, Round] | None:
    """The round that begins at a moment, as it was at its end."""
    started = moment.after.round
    found = None if started is None else _round(position, started.number)
    ended = None if found is None else position.state(found.last).round
    if found is None or ended is None or ended.number != found.number:
        return None
    return found, ended


def _winner(position: Position, moment: Moment) -> Foretelling | None:
    found = _begun(position, moment)
    if found is None or not isinstance(moment.recorded.event, RoundStarted):
        return None
    chapter, round = found
    listed = list(round.candidates)
    shown = listed[:MOST]
    if round.winner is not None and round.winner >= MOST:
        shown = [*listed[: MOST - 1], listed[round.winner]]
    if len(shown) < 2:
        return None
    answers = [_candidate_answer(one, round) for one in shown]
    none = round.winner is None
    if round.winner is None:
        why = "No candidate showed f."
    else:
        why = f"{_name(round.candidates[round.winner])} showed f."
    answers.append(Answer("none of them", none, why, "" if none else "stuck"))
    if shown == listed:
        order = "tested in this order"
    else:
        order = f"of which {len(shown)} are listed, in the order of their tests"
    question = Question(
        (
            f"Round {round.number}: {count(len(listed), 'candidate')}, {order}. Which is the first "
            "to show f?"
        ),
        tuple(answers),
        (
            "The first candidate that has everything f needs wins. 'part A' is A alone, 'without "
            "A' is all the rest."
        ),
    )
    if round.winner is None:
        # The round that leaves out each model alone is the last one without f.
        alone = {one.partition for one in round.candidates if one.kind == "complement"}
        kind = "last" if len(alone) == len(round.partitions) == len(round.environment) else "none"
        return Foretelling(question, chapter.last, _reason(kind, round.number), kind)
    if round.winner:
        before = "Those before it probably lack something."
    else:
        before = "It was the first one to be tried."
    reason = _reason(
        "won", round.number, candidate=_name(round.candidates[round.winner]), before=before
    )
    return Foretelling(question, chapter.last, reason, "won")


def _candidate_answer(one: Candidate, round: Round) -> Answer:
    if one.size <= FEW:
        words = f"{one.label}: {_named(one.models)}"
    else:
        words = f"{one.label}: {count(one.size, 'model')}"
    if round.winner == one.index:
        return Answer(words, True, f"{_name(one)} showed f, so it becomes E.")
    if round.winner is not None and one.index > round.winner:
        return Answer(
            words, False, "It was no longer tried: the first candidate that shows f wins."
        )
    belief = "alone" if one.kind == "partition" else "part"
    return Answer(
        words,
        False,
        f"{_name(one)} did not show f: something that f needs is missing in it.",
        belief,
    )


def _name(one: Candidate) -> str:
    return one.label[:1].upper() + one.label[1:]


# How E is split next.


def _parts(position: Position, moment: Moment) -> Foretelling | None:
    found = _begun(position, moment)
    if found is None or settings(moment.after).algorithm != "ddenv":
        return None
    _, round = found
    following = _round(position, round.number + 1)
    after = None if following is None else position.state(following.first).round
    if following is None or after is None or not _is_regular(round, after):
        return None
    size = len(after.environment)
    n = after.n_partitions
    before = len(round.environment)
    reduced = size < before
    grew = after.n_partitions > round.n_partitions
    if round.winner is not None:
        kept = f"{round.candidates[round.winner].label} became E"
    else:
        kept = "E stays as it is"
    right = (
        f"Right: {kept}, and n {f'grows by {n - round.n_partitions}' if grew else f'stays {n}'}."
    )
    options = {
        (max(1, before // 2), n): ("E loses only what f was shown not to need.", ""),
        (size, 2): ("n does not go back to two.", "stuck"),
        (size, n + 1): (
            f"n {'grows by one, not by two' if grew else 'stays as it is after this round'}.",
            "",
        ),
        (before, n): ("E is what showed f, and the rest is gone." if reduced else right, "part"),
        (size, n): (right, ""),
    }
    answers = tuple(
        Answer(
            f"{count(models, 'model')} in {count(parts, 'part')}",
            (models, parts) == (size, n),
            why,
            belief,
        )
        for (models, parts), (why, belief) in sorted(options.items())
        if parts <= models
    )
    if len(answers) < 2:
        return None
    if round.winner is None:
        asked = "no candidate showed f"
    else:
        asked = f"{round.candidates[round.winner].label} showed f"
    question = Question(
        f"Round {round.number} split {count(before, 'model')} into "
        f"{count(len(round.partitions), 'part')}, and {asked}. "
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


def _why_ended(test: Test, candidate: Candidate, options: Settings, missed: int) -> Question:
    """What the outcome of a candidate's test means, the last one of so many that `missed` f."""
    if test.outcome == "pass" and options.most_runs == 1 and options.accept_rate != "kept":
        return _reason("only pass", test.id)
    if candidate.kind == "complement":
        gone = "the models of the part"
    else:
        gone = "all models outside the part"
    goes = f"f shows without {gone}: they can go."
    if options.accept_rate == "kept":
        goes = f"f can show without {gone}. More runs will tell whether it shows often enough."
    elif options.most_runs > 1:
        goes = f"f showed without {gone}. Here the first run with f decides, so they go."
    # Of a single model nobody would be wrong to call it the smallest world.
    most = 2 if test.shows_f and candidate.size == 1 else None
    often = f"All {missed} runs missed f. That makes it likely, but it proves nothing."
    luck = often if missed > 1 else "It may have been bad luck: one test proves little."
    return _reason(test.outcome, test.id, most, goes=goes, luck=luck)


def _reason(name: str, turn: int, most: int | None = None, **words: str) -> Question:
    """A question of `REASONS` with `words` in it, and `most` of its answers at the most.

    Each `turn` begins with another answer: the right one has no place of its own.
    """
    asked = REASONS[name]
    answers = [
        Answer(
            each["say"],
            each.get("right", False),
            each["why"].format(**words),
            each.get("misconception", ""),
        )
        for each in asked["answers"][:most]
    ]
    first = turn % len(answers)
    return Question(asked["ask"].format(**words), (*answers[first:], *answers[:first]))
