"""Opens lessons, a real run with its map, scene and report, and a race; the caller has blocked what
Windows lacks.
"""

from __future__ import annotations

from pathlib import Path
from shutil import copy
from tempfile import mkdtemp

from ddenv.learn.catalog import LESSONS, bundled, open_lesson
from ddenv.learn.handout import handout
from ddenv.page.html import html
from ddenv.report.report import write_report
from ddenv.runfile.store import RunFile
from ddenv.scene.player import Player
from ddenv.scene.stage import Stage
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from ddenv.workbench.learn.race_screen import race_of_runs
from ddenv.workbench.learn.try_screen import TryScreen
from ddenv.workbench.map.world_map import WorldMap

TOY, REAL = LESSONS / "delivery.ddenv", LESSONS / "ditch.ddenv"


async def main() -> None:
    async with Workbench(first=lambda: LessonsScreen(bundled()[0])).run_test(
        size=(120, 36)
    ) as pilot:
        await shown(pilot)
        await pilot.press("enter", "enter", "s", "right")
        assert isinstance(pilot.app.screen, LessonScreen) and pilot.app.screen.course.step == 2
        await pilot.press("s", "enter", "enter")
        await shown(pilot)
        assert isinstance(pilot.app.screen, TryScreen)
    async with Workbench(first=lambda: LessonScreen(REAL)).run_test(size=(120, 36)) as pilot:
        await shown(pilot)
        await pilot.press("right_curly_bracket")
        assert len(pilot.app.screen.course.position.now.environment) == 31
    copy(TOY, other := Path(mkdtemp()) / "other.ddenv")
    async with Workbench(first=lambda: race_of_runs((TOY, other))).run_test(
        size=(120, 36)
    ) as pilot:
        await shown(pilot)
        await pilot.press("end")
        assert pilot.app.screen.race.over
    async with Workbench(REAL, watch=True).run_test(size=(120, 36)) as pilot:
        await shown(pilot)
    sent = []
    with RunFile(REAL) as run:
        Player(run, Stage(lambda message, _: sent.append(message)), lambda **_: None).tick(0.0)
    assert sent
    write_report(REAL, Path(mkdtemp()) / "report.html", False)
    for file in bundled():
        assert html(handout(open_lesson(file)))
    print("all shown")


async def shown(pilot) -> None:
    """Waits for the world to be drawn."""
    for _ in range(400):
        await pilot.pause(0.05)
        maps = pilot.app.screen.query(WorldMap)
        if maps and maps.first().picture is not None:
            return
    raise AssertionError("no world was drawn")
