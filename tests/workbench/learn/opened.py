"""A lesson on the screen of a test."""

from contextlib import asynccontextmanager

from ddenv.learn.catalog import bundled
from ddenv.learn.score import Score
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.kept_scores import keep_score
from ddenv.workbench.learn.lessons_screen import LessonsScreen

# The first lesson.
NAME = "what-delta-debugging-is"


@asynccontextmanager
async def opened(size=(120, 36), step=None, lesson=0, first=None):
    """The first lesson at a `step`, or another one, or what `first` makes."""
    if step is not None:
        keep_score(NAME, Score(step=step))
    app = Workbench(first=first or (lambda: LessonsScreen(bundled()[lesson])))
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        yield pilot
