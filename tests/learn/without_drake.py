"""Opens a lesson, a run step by step, the run screen with its map, and a report; the caller has blocked what Windows lacks."""

from __future__ import annotations

from pathlib import Path
from tempfile import mkdtemp

from ddenv.learn.shelf import LESSONS, bundled
from ddenv.report.report import write_report
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.messages import ShowLesson, ShowLessons

RUN = LESSONS / "delivery.ddenv"


async def main() -> None:
    async with Workbench(first=ShowLessons(bundled()[0])).run_test(size=(80, 24)) as pilot:
        await shown(pilot)
        await pilot.press("enter", "enter", "s", "right")
        assert isinstance(pilot.app.screen, LessonScreen) and pilot.app.screen.course.step == 2
    async with Workbench(first=ShowLesson(RUN)).run_test(size=(120, 36)) as pilot:
        await shown(pilot)
        await pilot.press("right_curly_bracket")
        assert len(pilot.app.screen.course.position.now.environment) == 6
    async with Workbench(RUN, watch=True).run_test(size=(120, 36)) as pilot:
        await shown(pilot)
    write_report(RUN, Path(mkdtemp()) / "report.html", False)
    print("all shown")


async def shown(pilot) -> None:
    """Waits for the world to be drawn."""
    for _ in range(400):
        await pilot.pause(0.05)
        maps = pilot.app.screen.query(WorldMap)
        if maps and maps.first().picture is not None:
            return
    raise AssertionError("no world was drawn")
