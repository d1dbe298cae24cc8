"""What a student did in each lesson, as the workbench remembers it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from ddenv.learn.score import Score, score_of
from ddenv.runs.preferences import read_state, write_state
from ddenv.text import count

FILE = "lessons.json"


def all_scores() -> dict[str, Score]:
    kept = read_state(FILE)
    if isinstance(kept, dict):
        return {str(name): score_of(data) for name, data in kept.items()}
    return {}


def keep_score(lesson: str, score: Score) -> None:
    """Remembers it, if it can be written."""
    scores: Mapping[str, Score] = {**all_scores(), lesson: score}
    write_state(FILE, {name: asdict(each) for name, each in scores.items()})


def in_words(score: Score | None) -> str:
    if score is None or not (score.done or score.step or score.answered):
        return "not begun"
    state = "done" if score.done else f"at step {score.step + 1}"
    return f"{state}, {score.right} of {count(len(score.answered), 'answer')} right"
