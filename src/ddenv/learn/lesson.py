"""A lesson: texts and questions, each at its place in a recorded run. Plain frozen data; `ddenv.learn.reading` makes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Foretold = Literal["outcome", "winner", "parts"]


@dataclass(frozen=True, slots=True)
class Answer:
    """A possible answer. `why` says what is right or wrong about it; `misconception` is a name of `MISCONCEPTIONS`, or ""."""

    text: str
    right: bool
    why: str
    misconception: str = ""


@dataclass(frozen=True, slots=True)
class Question:
    """A question with its answers, of which one is right. `hint` is "" if there is none."""

    text: str
    answers: tuple[Answer, ...]
    hint: str = ""

    @property
    def right(self) -> int:
        """The place of the right answer."""
        return next(place for place, answer in enumerate(self.answers) if answer.right)


@dataclass(frozen=True, slots=True)
class Step:
    """A step of a lesson: a Markdown `text`, then maybe a question, something to foretell, or something to do.

    `at` is the event of the run that is shown; None leaves it where it is. `budget` is how many tests a student has to search
    alone, `race` names the algorithms or pairs that race. `line` is the line in the lesson's file.
    """

    text: str
    at: int | None = None
    question: Question | None = None
    foretell: Foretold | None = None
    budget: int | None = None
    race: tuple[str, ...] = ()
    line: int = 0


@dataclass(frozen=True, slots=True)
class Lesson:
    """`name` is its file's, without number and ending; `minutes` is how long it takes. `oracle` is None without one.

    `beside` are other runs by name, for figures to compare with.
    """

    file: Path
    title: str
    aim: str
    minutes: int
    run: Path
    oracle: Path | None
    steps: tuple[Step, ...]
    beside: Mapping[str, Path] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.file.stem.lstrip("0123456789-")


# What students often believe, and what is right instead.
MISCONCEPTIONS = {
    "part": (
        "mixes up a partition with its complement",
        "Part A is only the models of A. Without A is all the others. If f shows without A, it is A that goes.",
    ),
    "proof": (
        "takes one miss for proof",
        "A failure can be flaky. A test that misses f may be bad luck, so it is repeated with other seeds.",
    ),
    "smallest": (
        "thinks minimal means smallest",
        "1-minimal means that no single model can go. A different, smaller set may exist elsewhere.",
    ),
    "any": (
        "takes any failure for f",
        "Only the same failure counts: the robot must end where it ended in f. Another failure may have another cause.",
    ),
    "fewer": (
        "thinks that fewer models always help the robot",
        "Leaving something out can change the robot's path, and lead it into another trap.",
    ),
    "alone": (
        "thinks that one model is the culprit",
        "A failure can need several models at once: without any one of them the robot gets through.",
    ),
    "hit": (
        "takes one run with f for its rate",
        "One run with f shows that f can happen there. How often it does, only many runs show.",
    ),
    "took": (
        "takes what took part for what is needed",
        "What took part changed a bit of a run. Whether f needs it, only a test without it shows.",
    ),
    "never": (
        "takes what was not seen for what cannot happen",
        "Another seed may show what no run has shown so far. How likely that is, the interval says.",
    ),
    "stuck": (
        "thinks that a round without f is wasted, or the end",
        "After such a round E stays as it is, and the parts get smaller. Only with single models is it the end.",
    ),
}
