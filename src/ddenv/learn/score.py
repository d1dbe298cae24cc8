"""A student's answers in a lesson: what was right, the streak, and the misconceptions seen. Plain
data, kept as JSON.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from ddenv.learn.lesson import MISCONCEPTIONS, Answer
from ddenv.text import Names

# Of one search; what is longer is no search.
MOST_MOVES = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """`step` is where the student is. `answered` has for each question, by a key such as
    "3.reason", whether it was right.

    `moves` are those of the student's own searches, by their steps.
    """

    step: Annotated[int, Field(ge=0)] = 0
    done: bool = False
    answered: Mapping[str, bool] = field(default_factory=dict)
    streak: int = 0
    best: int = 0
    misconceptions: Mapping[str, int] = field(default_factory=dict)
    moves: Mapping[str, Annotated[Names, Field(max_length=MOST_MOVES)]] = field(
        default_factory=dict
    )

    @property
    def right(self) -> int:
        return sum(self.answered.values())

    def with_answer(self, key: str, answer: Answer) -> Score:
        """After an answer. Only the first answer to a question counts."""
        if key in self.answered:
            return self
        streak = self.streak + 1 if answer.right else 0
        beliefs = dict(
            Counter(self.misconceptions)
            + Counter([answer.misconception] if answer.misconception else ())
        )
        answered = {**self.answered, key: answer.right}
        return replace(
            self,
            answered=answered,
            streak=streak,
            best=max(self.best, streak),
            misconceptions=beliefs,
        )

    def at(self, step: int, last: int) -> Score:
        """At a step of a lesson whose last step is `last`."""
        return replace(self, step=step, done=self.done or step >= last)


_SCORE = TypeAdapter(Score)


def score_of(data: Any) -> Score:
    """What was kept; an empty score for anything else."""
    try:
        return _SCORE.validate_python(data)
    except ValidationError:
        return Score()


def summary(asked: int, score: Score) -> list[str]:
    """The end of a lesson with so many questions `asked`, in sentences."""
    skipped = max(0, asked - len(score.answered))
    more = f"; {skipped} skipped" if skipped else ""
    if score.answered:
        right = f"{score.right} of {len(score.answered)} questions right"
    else:
        right = "no question"
    lines = [f"You answered {right}{more}."]
    if score.best > 1:
        lines.append(f"Your longest streak: {score.best} right answers in a row.")
    if not score.misconceptions and score.answered:
        lines.append("No typical misconception was seen.")
    for name, number in sorted(score.misconceptions.items(), key=lambda item: -item[1]):
        belief, instead = MISCONCEPTIONS.get(name, (name, ""))
        which = "One of your answers is" if number == 1 else f"{number} of your answers are"
        lines.append(f"{which} typical of somebody who {belief}. {instead}")
    return lines
