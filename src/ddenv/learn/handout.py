"""The summary of a lesson as a page to hand out: its aim, the run in figures and pictures, its texts, questions and answers."""

from __future__ import annotations

from collections.abc import Iterator

from ddenv.learn.lesson import MISCONCEPTIONS, Question, Step, blocks
from ddenv.learn.shelf import Opened
from ddenv.page.blocks import Block, Name, Paragraph, Part, Picture, Report, Section, Strong, Table, say
from ddenv.page.step_chart import chart

FIGURES = (("models", "models"), ("left", "left"), ("search_tests", "tests of candidates"), ("rounds", "rounds"))


def handout(opened: Opened) -> Report:
    lesson, state = opened.lesson, opened.position.end
    end = state.revision
    about = f"The lesson takes about {lesson.minutes} minutes; its run is {lesson.run.name}."
    lead = (say(Strong("Aim:"), f" {lesson.aim}"), say(about))
    steps = Picture("chart", chart(state), "How many models were left after each test")
    beliefs = tuple((f"One {belief}.", right) for belief, right in MISCONCEPTIONS.values())
    sections = (
        Section("What you saw", tuple(_texts(opened))),
        Section("Models left after each test", (steps, say("What is left: ", opened.text("{kept}", end), "."))),
        Section("Questions and answers", tuple(_questions(opened))),
        Section("Common misconceptions", (Table(("belief", "what is right"), beliefs),)),
    )
    figures = tuple((opened.text(f"{{{name}}}", end), words) for name, words in FIGURES)
    return Report("ddenv lesson", lesson.title, lead, figures, sections, "Made by ddenv learn.")


def _steps(opened: Opened) -> Iterator[tuple[Step, int]]:
    return zip(opened.lesson.steps, opened.places, strict=True)


def _texts(opened: Opened) -> Iterator[Block]:
    for step, at in _steps(opened):
        for block in blocks(opened.text(step.text, at)):
            parts = tuple(_part(words, style) for words, style in block.spans)
            yield Paragraph(("• ", *parts) if block.listed else parts)


def _part(words: str, style: str) -> Part:
    return Strong(words) if style == "strong" else Name(words) if style == "code" else words


def _questions(opened: Opened) -> Iterator[Block]:
    for step, at in _steps(opened):
        if step.question is not None:
            yield say(Strong(opened.text(step.question.text, at)))
            yield _answers(opened, step.question, at)


def _answers(opened: Opened, question: Question, at: int) -> Table:
    rows = tuple(
        ("✓" if answer.right else "✗", opened.text(answer.text, at), opened.text(answer.why, at))
        for answer in question.answers
    )
    return Table(("", "answer", "why"), rows, strong=frozenset({question.right}))
