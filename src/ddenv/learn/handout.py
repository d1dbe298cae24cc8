"""The summary of a lesson as a page to hand out: its aim, the run in figures and pictures, its
texts, questions and answers.
"""

from __future__ import annotations

from ddenv.learn.catalog import Opened
from ddenv.learn.lesson import MISCONCEPTIONS, blocks
from ddenv.page.blocks import (
    Block,
    Name,
    Paragraph,
    Part,
    Picture,
    Report,
    Section,
    Strong,
    Table,
    say,
)
from ddenv.page.step_chart import chart

FIGURES = (
    ("models", "models"),
    ("left", "left"),
    ("search_tests", "tests of candidates"),
    ("rounds", "rounds"),
)
AS: dict[str, type[Strong] | type[Name]] = {"strong": Strong, "code": Name}


def handout(opened: Opened) -> Report:
    lesson = opened.lesson
    state = opened.position.end
    end = state.revision
    about = f"The lesson takes about {lesson.minutes} minutes; its run is {lesson.run.name}."
    lead = (say(Strong("Aim:"), f" {lesson.aim}"), say(about))
    seen = list[Block]()
    asked = list[Block]()
    for step, at in zip(lesson.steps, opened.places, strict=True):
        for block in blocks(opened.text(step.text, at)):
            parts: list[Part] = [
                AS[style](words) if style in AS else words for words, style in block.spans
            ]
            seen.append(Paragraph(("• " * block.listed, *parts)))
        if (question := step.question) is not None:
            rows = tuple(
                (
                    "✓" if answer.right else "✗",
                    opened.text(answer.text, at),
                    opened.text(answer.why, at),
                )
                for answer in question.answers
            )
            asked.append(say(Strong(opened.text(question.text, at))))
            asked.append(Table(("", "answer", "why"), rows, strong=frozenset({question.right})))
    steps = Picture("chart", chart(state), "How many models were left after each test")
    beliefs = tuple((f"One {belief}.", right) for belief, right in MISCONCEPTIONS.values())
    sections = (
        Section("What you saw", tuple(seen)),
        Section(
            "Models left after each test",
            (steps, say("What is left: ", opened.text("{kept}", end), ".")),
        ),
        Section("Questions and answers", tuple(asked)),
        Section("Common misconceptions", (Table(("belief", "what is right"), beliefs),)),
    )
    figures = tuple((opened.text(f"{{{name}}}", end), words) for name, words in FIGURES)
    return Report(
        name="ddenv lesson",
        verdict=lesson.title,
        lead=lead,
        figures=figures,
        sections=sections,
        foot="Made by ddenv learn.",
    )
