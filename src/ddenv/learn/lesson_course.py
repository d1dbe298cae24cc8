"""A student's way through a lesson, or freely through a run: what is shown, asked, answered and
skipped. No screen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from ddenv.learn.attempt import Attempt
from ddenv.learn.catalog import Opened
from ddenv.learn.lesson import Answer, Block, Question, blocks
from ddenv.learn.lesson import Step as LessonStep
from ddenv.learn.prediction import at_hand, foretelling
from ddenv.learn.race import Play, bet, in_one_sentence, result
from ddenv.learn.score import Score, summary
from ddenv.runfile.position import Position, Step

FREE = (
    "Step through the run: forward, back, to the next decision or reduction. The marked line of "
    "the algorithm is at work; "
    "the variables show their values at this moment. Press `p` to predict what comes next."
)
# Without f, which is the failure, and h, the key of the hint.
LETTERS = "abcdegi"
DUE = {
    "try": "Press `enter` to search yourself, or `s` to skip it.",
    "race": "Press `enter` to watch the race, or `s` to skip it.",
}
Activity = Literal["try", "race"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A question. Its `key` is for the score; once it is answered, the event `until` is shown, and
    `then` is asked.

    `chosen` is the place of the given answer, -1 if it was skipped, None while it is open; `hint`
    says whether that is shown.
    """

    key: str
    question: Question
    until: int | None = None
    then: Question | None = None
    chosen: int | None = None
    hint: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """What the student reads. `chosen` is the place of the given answer, -1 if it was skipped, None
    while it is open.

    `after` comes below the question: what there is to do, or what came of it.
    """

    text: tuple[Block, ...]
    question: Question | None = None
    chosen: int | None = None
    hint: bool = False
    after: tuple[Block, ...] = ()

    @property
    def remarks(self) -> tuple[tuple[str, str], ...]:
        """What is right or wrong about the answers, once one is given: (letter and answer, why)."""
        if self.question is None or self.chosen is None:
            return ()
        order = [self.chosen, *range(len(self.question.answers))]
        found: dict[str, str] = {}
        for place in dict.fromkeys(each for each in order if each >= 0):
            answer = self.question.answers[place]
            found.setdefault(answer.why, f"{LETTERS[place]} {'✓' if answer.right else '✗'}")
        return tuple((mark, why) for why, mark in found.items())


class Course:
    """At a step of the lesson `opened`, or anywhere in a run without one. The event `at` is
    shown.
    """

    def __init__(
        self, position: Position, opened: Opened | None = None, score: Score | None = None
    ) -> None:
        self.position = position
        self._opened = opened
        self._steps = () if opened is None else opened.lesson.steps
        self.score = score or Score()
        self.step = 0
        self._asked: Asked | None = None
        # Whether the step has something to do that was neither done nor skipped.
        self.due = False
        # Of which kinds the student was asked for the reason in predictions of one's own.
        self._explained: frozenset[str] = frozenset()
        # The question of the step, and where the run was, while a prediction stands in its place.
        self._own: tuple[Asked | None, int] | None = None
        position.go(position.ids[0])
        if opened is None:
            position.step("moment", 1)
        else:
            self._come(min(self.score.step, self.last))

    @property
    def at(self) -> int:
        """The event that is shown."""
        if self.position.at is None:
            return self.position.end.revision
        return self.position.at

    @property
    def last(self) -> int:
        """The number of the last step: after all of the lesson's own comes the summary."""
        return len(self._steps)

    @property
    def page(self) -> Page:
        text = blocks(self._text())
        after = blocks(self._after())
        asked = self._asked
        if asked is None:
            return Page(text=text, after=after)
        return Page(
            text=text, question=asked.question, chosen=asked.chosen, hint=asked.hint, after=after
        )

    def _text(self) -> str:
        if self._opened is None:
            return FREE
        if self.step == self.last:
            # A search is no question: it counts only where it succeeds.
            alone = sum(
                bool(step.budget) and str(n) not in self.score.answered
                for n, step in enumerate(self._steps)
            )
            return "\n\n".join(summary(self._opened.asked - alone, self.score))
        return self._said(self._opened.lesson.steps[self.step].text)

    def _after(self) -> str:
        here = self.here
        activity = self.activity
        if activity is None or here is None or self._opened is None or self.is_open:
            return ""
        if self.due:
            return DUE[activity]
        if activity == "race":
            return " ".join(result(self._opened.racers(here)))
        attempt = self.attempt
        if attempt is None or not attempt.ended:
            return "Your search is not finished: `t` continues it."
        return f"**{attempt.verdict}**\n\n{in_one_sentence(attempt.oracle, self.plays, attempt)}"

    @property
    def is_open(self) -> bool:
        return self._asked is not None and self._asked.chosen is None

    def _said(self, words: str) -> str:
        if self._opened is None:
            return words
        return self._opened.text(words, self._opened.places[min(self.step, self.last - 1)])

    # Moves in the lesson.

    def go_on(self) -> bool:
        """To what comes next. False at the end, or while something is open that should be answered,
        done or skipped.
        """
        asked = self._asked
        reason = None if self._asked is None else self._asked.then
        if self.is_open or (self.due and self._own is None):
            return False
        if asked is not None and reason is not None:
            self._asked = Asked(key=f"{asked.key}.reason", question=reason)
        elif self._own is not None:
            self._return()
        elif asked is not None and self._opened is None:
            self._asked = None
        elif self.step >= self.last:
            return False
        else:
            self._come(self.step + 1)
        return True

    def back(self) -> bool:
        """To the step before, or from a prediction to its step; False at the first one."""
        if self._own is not None:
            self._return()
            return True
        if self.step == 0:
            return False
        self._come(self.step - 1)
        return True

    def again(self) -> bool:
        """From the end to the first step, with a new score; False anywhere else."""
        if self._opened is None or self.step < self.last:
            return False
        self.score = Score(done=True)
        self._come(0)
        return True

    def _return(self) -> None:
        assert self._own is not None
        (self._asked, at) = self._own
        self._own = None
        self.position.go(at)

    def answer(self, place: int) -> Answer | None:
        """Gives an answer; None if no question is open or it has no such answer."""
        if (
            self._asked is None
            or not self.is_open
            or not 0 <= place < len(self._asked.question.answers)
        ):
            return None
        answer = self._asked.question.answers[place]
        # A lesson counts its own questions.
        if self._own is None:
            self.score = self.score.with_answer(self._asked.key, answer)
        self._settle(replace(self._asked, chosen=place))
        return answer

    def skip(self) -> bool:
        """Shows the answer of an open question without a score, or passes over what there is to do;
        False if there is nothing.
        """
        if self._asked is None or not self.is_open:
            skipped = self.due
            self.due = False
            return skipped
        # A skipped prediction has no reason to give.
        self._settle(replace(self._asked, chosen=-1, then=None))
        return True

    def hint(self) -> bool:
        """Shows the hint of an open question; False if there is none."""
        if self._asked is None or not self.is_open or not self._asked.question.hint:
            return False
        self._asked = replace(self._asked, hint=True)
        return True

    def _settle(self, asked: Asked) -> None:
        self._asked = asked
        if asked.until is not None:
            self.position.go(asked.until)

    def _come(self, step: int) -> None:
        self.step = step
        self._asked = None
        self.due = False
        self._own = None
        self.score = self.score.at(step, self.last)
        if self._opened is None:
            return
        self.position.go(self._opened.places[min(step, self.last - 1)])
        if step == self.last:
            return
        here = self._steps[step]
        if here.question is not None:
            asked = here.question
            said = self._said
            answers = tuple(
                replace(each, text=said(each.text), why=said(each.why)) for each in asked.answers
            )
            self._asked = Asked(
                key=str(step), question=Question(said(asked.text), answers, said(asked.hint))
            )
        elif (found := self._opened.foretold[step]) is not None:
            self._asked = Asked(
                key=str(step), question=found.question, until=found.until, then=found.reason
            )
        elif here.race:
            self.due = True
            self._asked = Asked(key=str(step), question=bet(self._opened.racers(here)))
        elif (attempt := self.attempt) is not None:
            self.due = not attempt.ended

    # What there is to do.

    @property
    def here(self) -> LessonStep | None:
        """The step of the lesson; None at the end, or in a free walk."""
        if self.step < self.last:
            return self._steps[self.step]
        return None

    @property
    def activity(self) -> Activity | None:
        here = self.here
        if here is None:
            return None
        if here.race:
            return "race"
        if here.budget:
            return "try"
        return None

    @property
    def attempt(self) -> Attempt | None:
        """The student's own search in this step, where it was left."""
        if self.here is None or self._opened is None:
            return None
        return self._opened.attempt(self.here, self.score.moves.get(str(self.step), ()))

    @property
    def plays(self) -> tuple[Play, ...]:
        """The searches that the student's own is compared with: none that races later, before the
        student's bet on that race.
        """
        if self._opened is None:
            return ()
        steps = list(enumerate(self._steps))[self.step :]
        secret = {
            name
            for number, step in steps
            if str(number) not in self.score.answered
            for name in step.race
        }
        return tuple(play for name, play in self._opened.plays.items() if name not in secret)

    def keep(self, attempt: Attempt) -> None:
        """After a move of the student's own search. Only one that succeeds counts: to try is no
        mistake.
        """
        self.score = replace(self.score, moves={**self.score.moves, str(self.step): attempt.moves})
        if attempt.ended:
            if attempt.found and len(attempt.tried) <= attempt.budget:
                self.score = self.score.with_answer(str(self.step), Answer("", True, ""))
            self.due = False

    def watched(self) -> None:
        self.due = False

    # Moves in the run.

    def move(self, what: Step, by: int) -> bool:
        """To another moment of the run; False if there is none. In a free walk it closes an
        answered question.
        """
        if not self.position.step(what, by):
            return False
        if self._opened is None:
            self._asked = None
        return True

    @property
    def must_answer(self) -> bool:
        """Whether the question of the lesson's step waits: no prediction takes its place."""
        return self._opened is not None and self._own is None and self.is_open

    def foretell(self) -> bool:
        """Asks for a prediction of what comes next in the run; False if nothing is left to
        foretell.

        In a lesson it counts for nothing, and going on leads back to the step.
        """
        before = self._asked, self.at
        for id in (id for id in self.position.ids if id >= self.at):
            moment = self.position.moment(id)
            what = None if moment is None else at_hand(moment)
            found = None if what is None else foretelling(self.position, id, what)
            if found is not None:
                self.position.go(id)
                # What was explained a moment ago is not asked again.
                shown = replace(found, reason=None) if found.kind in self._explained else found
                self._explained |= {found.kind}
                self._asked = Asked(
                    key=f"free.{id}", question=shown.question, until=shown.until, then=shown.reason
                )
                if self._opened is not None:
                    self._own = self._own or before
                return True
        return False
