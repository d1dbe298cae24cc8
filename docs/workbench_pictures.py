"""Makes the pictures of the workbench, docs/screens/NAME.svg: a run of the ditch, guided by hand,
with Drake.

    python docs/workbench_pictures.py

All are made in one go. They show nothing of this machine: folders, user and host have other names.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from subprocess import Popen
from unittest.mock import patch

from textual.pilot import Pilot
from textual.widgets import Select

from ddenv.guiding.key_offers import nearest_other
from ddenv.learn.catalog import bundled, open_lesson
from ddenv.learn.score import Score
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions, FindMargins, Reduce
from ddenv.runs.folder import free_run_path
from ddenv.runs.programs import start_engine
from ddenv.workbench.app import Config, Workbench
from ddenv.workbench.learn.kept_scores import keep_score
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.world.load import SDF, find_scenario, load_scenario

SCREENS = Path(__file__).resolve().parent / "screens"
MIDDLE, SMALL, LARGE, TINY = (120, 36), (80, 24), (200, 60), (40, 10)
# Maximum time for anything, a certificate included, s; after this much of its run the robot is
# worth a picture, simulated s.
PATIENCE, UNDER_WAY = 600.0, 6.0
HOME = Path(tempfile.gettempdir()) / "you"
# Models that are on no machine, by place.
MISSING = "".join(
    f"<include><uri>model://{name}</uri><pose>{place} 0 0 0 0</pose></include>"
    for name, place in {
        "jersey_barrier": "3 -4",
        "old_shelf": "5 4",
        "construction_cone": "6 -3",
    }.items()
)
FLOOR = ("asphalt_near", "asphalt_far")


@dataclass(frozen=True)
class Picture:
    """`screen` is the class of the screen; `words` are the caption, for readers who cannot see the
    picture.
    """

    screen: str
    words: str


PICTURES = {
    "setup": Picture(
        "SetupScreen", "The setup screen: what to choose from, the world, the settings"
    ),
    "setup-small": Picture("SetupScreen", "The setup screen at 80x24: its settings"),
    "setup-start": Picture("SetupScreen", "Picking the robot's start on the map of a world"),
    "setup-missing": Picture("SetupScreen", "Missing files, each with its remedy"),
    "remedy": Picture("AskRemedy", "Choosing a remedy"),
    "open": Picture("OpenFile", "Opening a file"),
    "save": Picture("SaveScenario", "Saving the settings as a scenario"),
    "baseline": Picture("RunScreen", "The baseline: the whole world is run ten times"),
    "run": Picture("RunScreen", "The run screen in the middle of a round"),
    "run-large": Picture("RunScreen", "The run screen at 200x60"),
    "run-map": Picture("RunScreen", "The run screen at 80x24: the map"),
    "run-table": Picture("RunScreen", "The run screen at 80x24: the table"),
    "run-light": Picture("RunScreen", "The run screen in the light theme"),
    "run-ansi": Picture("RunScreen", "The run screen in sixteen colours"),
    "waiting": Picture("RunScreen", "A reduction waits to be accepted"),
    "reduction-waits": Picture("ReductionWaits", "What becomes of a reduction that waits"),
    "watch": Picture("RunScreen", "Watching a run"),
    "log": Picture("RunScreen", "The log"),
    "trial": Picture("RunScreen", "A selection by hand shows f, and waits to be adopted"),
    "finished": Picture("RunScreen", "The end of a run"),
    "tiny": Picture("RunScreen", "A terminal that is too small"),
    "help": Picture("Help", "The keys"),
    "palette": Picture("CommandPalette", "The list of commands"),
    "method": Picture("Method", "How a run is reduced"),
    "layers": Picture("Layers", "What the map shows"),
    "copy": Picture("Pick", "What can be copied"),
    "scene": Picture("SceneDialog", "Where the 3-D scene is"),
    "quit": Picture("Quit", "Leaving: stop the engine or let it go on"),
    "choose": Picture("ChooseModels", "Choosing models by their names"),
    "other": Picture("Question", "Accepting another failure as f"),
    "failures": Picture("Pick", "Other failures, each with its smallest environment"),
    "change": Picture("Change", "Changing the settings during a run"),
    "history": Picture("History", "The history, with a branch"),
    "compare": Picture("SideBySide", "Two environments side by side"),
    "past": Picture("RunScreen", "An earlier moment of a run"),
    "rounds": Picture("Pick", "The rounds of a run"),
    "facts": Picture("FactsDialog", "The raw facts of a test"),
    "why": Picture("WhyScreen", "Why it fails: what happens without each model"),
    "changed": Picture("WhyScreen", "A number at a value with which the robot reaches its goal"),
    "margins": Picture("MarginsDialog", "How far numbers may change before f goes"),
    "playback": Picture("Playback", "A test played over another one with the same seed"),
    "beside": Picture("Pick", "Which test to play beside another one"),
    "signs": Picture("SignsDialog", "What the signs mean"),
    "export": Picture("ExportScreen", "Writing what is left"),
    "runs": Picture("RunsScreen", "The list of runs"),
    "runs-compared": Picture("SideBySide", "Two runs side by side"),
    "lessons": Picture("LessonsScreen", "The list of lessons"),
    "lesson": Picture("LessonScreen", "A lesson"),
    "lesson-small": Picture("LessonScreen", "A lesson at 80x24"),
    "try": Picture("TryScreen", "A search of one's own, half done"),
    "try-end": Picture("TryScreen", "Its end: the verdict, side by side with the algorithms"),
    "race": Picture("RaceScreen", "A race of four algorithms"),
    "race-small": Picture("RaceScreen", "The end of a race at 80x24"),
}


def main() -> None:
    if HOME.exists():
        sys.exit(f"{HOME} is in the way: remove it first")
    shutil.rmtree(SCREENS, ignore_errors=True)
    SCREENS.mkdir()
    (HOME / "runs").mkdir(parents=True)
    (HOME / "worlds").mkdir()
    depot = (SDF / "worlds/friction.sdf").read_text(encoding="utf-8")
    (HOME / "worlds/depot.sdf").write_text(depot, encoding="utf-8")
    (HOME / "worlds/yard.sdf").write_text(
        depot.replace("</world>", f"{MISSING}</world>"), encoding="utf-8"
    )
    os.chdir(HOME / "worlds")
    os.environ.update(HOME=str(HOME), DDENV_HOME=str(HOME), LOGNAME="you", TZ="UTC")
    for name in ("NO_COLOR", "DDENV_CONFIG"):
        os.environ.pop(name, None)
    time.tzset()
    try:
        with (
            patch("socket.gethostname", lambda: "robot"),
            patch("ddenv.runs.processor.usable_cores", lambda: 2),
        ):
            asyncio.run(make_all())
    finally:
        for run in (HOME / "runs").glob("*.ddenv"):
            stop(run)
        shutil.rmtree(HOME)
    missing = PICTURES.keys() - {path.stem for path in SCREENS.iterdir()}
    if missing:
        sys.exit(f"not made: {', '.join(sorted(missing))}")


async def make_all() -> None:
    # What took part would leave five models, and no round with much to see.
    run = new_run("ditch", slice=False, seed=2)
    engine = start_engine(run, EngineOptions(jobs=1, accept_mode="ask"))
    async with opened(run) as pilot:
        await begin(pilot, run, engine)
        await guide(pilot)
        await look_back(pilot)
        await tell_why(pilot)
        await export(pilot, run)
        await branch(pilot)
    await show_margins()
    await list_runs()
    await set_up()
    await teach()


async def teach() -> None:
    """The list of lessons, and a prediction in the first one."""
    for name, size in (("lesson-small", SMALL), ("lesson", MIDDLE)):
        app = Workbench(config=Config(), first=lambda: LessonsScreen(bundled()[0]))
        async with app.run_test(size=size) as pilot:
            await drawn(pilot)
            screen = pilot.app.screen
            assert isinstance(screen, LessonScreen)
            while screen.course.step < 6 or screen.course.page.chosen is None:
                await press(
                    pilot,
                    "c" if screen.course.step == 6 else "s",
                    *["enter"] * (screen.course.step < 6),
                )
            await take(pilot, name)
            if name == "lesson":
                await press(pilot, "escape")
                await take(pilot, "lessons")
    await search_and_race()


async def search_and_race() -> None:
    """A student's own search in the first lesson, and its race."""
    steps = open_lesson(bundled()[0]).lesson.steps
    alone = next(number for number, step in enumerate(steps) if step.budget)
    race = next(number for number, step in enumerate(steps) if step.race)
    async with in_lesson(alone, MIDDLE) as pilot:
        await press(pilot, "enter")
        await drawn(pilot)
        world = pilot.app.screen.query_one(WorldMap)
        for models in ({"bench", "plant"}, {"sign"}, {"crate"}):
            world.select(models)
            await press(pilot, "w")
        world.go_to("pallet")
        world.select({"pallet", "bin"})
        await take(pilot, "try")
        await press(pilot, "w", "m", "m")
        await take(pilot, "try-end")
    for name, size, keys in (("race", MIDDLE, ["right"] * 5), ("race-small", SMALL, ["end"])):
        async with in_lesson(race, size) as pilot:
            await press(pilot, "d", "enter")
            await drawn(pilot)
            await press(pilot, *keys)
            await take(pilot, name)


@asynccontextmanager
async def in_lesson(step: int, size: tuple[int, int]) -> AsyncIterator[Pilot[int]]:
    """The first lesson at one of its steps."""
    lesson = open_lesson(bundled()[0]).lesson
    keep_score(lesson.name, Score(step=step))
    app = Workbench(config=Config(), first=lambda: LessonsScreen(lesson.file))
    async with app.run_test(size=size) as pilot:
        await drawn(pilot)
        yield pilot


async def drawn(pilot: Pilot[int]) -> None:
    """Waits for the maps, if there is room for them."""
    maps = pilot.app.screen.query(WorldMap)
    await until(pilot, lambda: all(each.picture is not None or not each.display for each in maps))


# The run of the ditch.


@asynccontextmanager
async def slowed(engine: Popen[bytes]) -> AsyncIterator[None]:
    """The engine gets a tenth of the time, so that a robot that moves can be looked at."""

    async def stop_and_go() -> None:
        while engine.poll() is None:
            for what, seconds in ((signal.SIGSTOP, 0.09), (signal.SIGCONT, 0.01)):
                os.killpg(engine.pid, what)
                await asyncio.sleep(seconds)

    task = asyncio.create_task(stop_and_go())
    try:
        yield
    finally:
        task.cancel()
        os.killpg(engine.pid, signal.SIGCONT)


async def begin(pilot: Pilot[int], run: Path, engine: Popen[bytes]) -> None:
    """From the baseline to the middle of a round."""
    async with slowed(engine):
        await until(pilot, lambda: is_under_way(pilot, tests=4))
        await take(pilot, "baseline")
    await until(pilot, lambda: state(pilot).status == "waiting")
    await take(pilot, "waiting")
    await take_dialogs(pilot)
    async with opened(run, TINY) as other:
        await take(other, "tiny")
    await press(pilot, "p", "enter")
    await take(pilot, "reduction-waits")
    await press(pilot, "escape", "a")
    async with slowed(engine):
        await take_live(pilot, "run", pilot)
    # The next screens take a moment to open.
    await pause(pilot, True)
    await other_failures(pilot)
    await from_elsewhere(pilot, run, engine)


async def from_elsewhere(pilot: Pilot[int], run: Path, engine: Popen[bytes]) -> None:
    """The same round on other screens. All are opened first: the rounds of this run are soon
    over.
    """
    async with AsyncExitStack() as stack:

        async def other(
            size: tuple[int, int], theme: str = "", *, watch: bool = False
        ) -> Pilot[int]:
            return await stack.enter_async_context(opened(run, size, theme, watch=watch))

        views = {
            "run-map": await other(SMALL),
            "run-table": await other(SMALL),
            "run-large": await other(LARGE),
        }
        views |= {
            "run-light": await other(MIDDLE, "ddenv-light"),
            "run-ansi": await other(MIDDLE, "ansi-dark"),
        }
        views["watch"] = await other(MIDDLE, watch=True)
        await press(views["run-map"], "1")
        await press(views["run-table"], "2")
        async with slowed(engine):
            for name, view in views.items():
                await take_live(view, name, pilot)
    await pause(pilot, True)


async def take_dialogs(pilot: Pilot[int]) -> None:
    """The dialogs that can be opened at any time."""
    for name, key in (
        ("help", "question_mark"),
        ("method", "e"),
        ("layers", "l"),
        ("copy", "y"),
        ("quit", "q"),
    ):
        await press(pilot, key)
        await take(pilot, name)
        await press(pilot, "escape")
    await press(pilot, "ctrl+p", *"undo")
    await take(pilot, "palette")
    await press(pilot, "escape")
    await press(pilot, "m")
    await until(pilot, lambda: bool(run_screen(pilot).scene.url))
    await take(pilot, "scene")
    await press(pilot, "x")


async def other_failures(pilot: Pilot[int]) -> None:
    """A candidate that fell is not similar. Early, since later rounds of this run may meet no other
    failure.
    """
    while not (rows := others(state(pilot))):
        if state(pilot).certificate is not None:
            raise RuntimeError("the rounds are over, and none met another failure")
        before = state(pilot)
        # One test at a time: several end a round before anybody looks.
        await press(pilot, "a" if before.status == "waiting" else "s")
        while (len(state(pilot).tests), len(state(pilot).nodes)) == (
            len(before.tests),
            len(before.nodes),
        ):
            await pilot.pause(0.05)
        await until(
            pilot,
            lambda: (
                state(pilot).status in ("paused", "waiting") and not run_screen(pilot).snapshot.live
            ),
        )
    await press(pilot, "2", "home", *["down"] * rows[0], "a")
    await take(pilot, "other")
    await press(pilot, "n", "f")
    await take(pilot, "failures")
    await press(pilot, "escape")


async def guide(pilot: Pilot[int]) -> None:
    """A platform is pinned, and the platforms are tried alone: they are enough."""
    await pause(pilot, True)
    # A test that still runs may end in a reduction that waits.
    await until(pilot, lambda: not state(pilot).running_tests)
    if state(pilot).status == "waiting":
        # A pin would ask what becomes of the reduction that waits.
        await press(pilot, "a")
        await until(pilot, lambda: state(pilot).status == "paused")
    await press(pilot, "p", *"near", "tab", "enter")
    await until(pilot, lambda: bool(state(pilot).pinned))
    await press(pilot, "o", *"asphalt", "tab", "down", "tab")
    await take(pilot, "choose")
    await press(pilot, "enter")
    await until(pilot, lambda: bool(state(pilot).trials) and bool(state(pilot).trials[0].verdict))
    await press(pilot, "home")
    await take(pilot, "trial")
    await press(pilot, "a")
    await until(pilot, lambda: state(pilot).nodes[state(pilot).node].how == "adopted")
    await press(pilot, "space")
    await until(pilot, lambda: state(pilot).status == "finished")
    await take(pilot, "finished")


async def look_back(pilot: Pilot[int]) -> None:
    """An earlier round, the list of rounds, a test of that round, and the signs."""
    await press(pilot, "less_than_sign", "less_than_sign", "comma", "comma")
    await take(pilot, "past")
    for name, key in (("rounds", "b"), ("facts", "F"), ("signs", "k")):
        await press(pilot, key)
        await take(pilot, name)
        await press(pilot, "escape")
    await press(pilot, "escape")


async def tell_why(pilot: Pilot[int]) -> None:
    """What happens without a platform, and both of its runs played, a while after they part."""
    await press(pilot, "W")
    await drawn(pilot)
    await pilot.app.workers.wait_for_complete()
    await take(pilot, "why")
    await press(pilot, "enter", "p", *["right"] * 15)
    await take(pilot, "playback")
    await press(pilot, "o")
    await take(pilot, "beside")
    await press(pilot, "escape", "escape", "escape")


async def show_margins() -> None:
    """Margins of what is left in the friction world."""
    run = new_run("friction")
    for job in (Reduce(), FindMargins(globs=("*.friction", "*_0?.y"))):
        await asyncio.to_thread(start_engine(run, EngineOptions(jobs=2), job).wait)
    async with opened(run) as pilot:
        await press(pilot, "W")
        await drawn(pilot)
        # After three models and the friction of the patch: how far it may be moved.
        await press(pilot, *["down"] * 4)
        await take(pilot, "changed")
        await press(pilot, "m")
        await take(pilot, "margins")


async def export(pilot: Pilot[int], run: Path) -> None:
    await press(pilot, "L")
    await take(pilot, "log")
    await press(pilot, "2", "E", "ctrl+s")
    await until(pilot, lambda: (HOME / "worlds" / f"{run.stem}.html").exists())
    await take(pilot, "export")
    await press(pilot, "escape")


async def branch(pilot: Pilot[int]) -> None:
    """Back to the first reduction, on by another method, and both ends side by side."""
    await press(pilot, "h", "home", "down", "enter", "y")
    await until(pilot, lambda: state(pilot).node == 1 and state(pilot).paused)
    await press(pilot, "c")
    await take(pilot, "change")
    pilot.app.screen.query_one("#partitioning", Select).value = "timeseg"
    await press(pilot, "ctrl+s")
    await until(pilot, lambda: state(pilot).scenario["reduction"]["pair"].startswith("timeseg"))
    nodes = len(state(pilot).nodes)
    await press(pilot, "space")
    while len(state(pilot).nodes) < nodes + 3:
        await accept_if_waiting(pilot)
        await pilot.pause(0.05)
    await press(pilot, "space")
    await until(pilot, lambda: state(pilot).paused)
    await press(pilot, "u")
    if state(pilot).status == "waiting":
        # The next reduction may wait already, which undo drops.
        await press(pilot, "d")
    await until(pilot, lambda: state(pilot).nodes[-1].rejected)
    await press(pilot, "h")
    await take(pilot, "history")
    await press(pilot, "m", "up", "up", "c")
    await take(pilot, "compare")
    await press(pilot, "escape", "escape")


# Before a run, and beside it.


async def list_runs() -> None:
    """One run whose engine was killed, and one at work."""
    lost = new_run("friction")
    engine = start_engine(lost, EngineOptions(jobs=1))
    await asyncio.to_thread(wait_for_tests, lost, 12)
    os.killpg(engine.pid, signal.SIGKILL)
    engine.wait()
    works = new_run("rubble")
    start_engine(works, EngineOptions(jobs=1))
    await asyncio.to_thread(wait_for_tests, works, 1)
    async with opened(None) as pilot:
        await press(pilot, "R")
        await pilot.pause(1.5)
        await take(pilot, "runs")
        await press(pilot, "m", "down", "c")
        await take(pilot, "runs-compared")
    await asyncio.to_thread(stop, works)


async def set_up() -> None:
    async with opened(None) as pilot:
        await pilot.pause(1.0)
        await take(pilot, "setup")
        await press(pilot, "f7")
        await take(pilot, "save")
        await press(pilot, "escape", "ctrl+o")
        await take(pilot, "open")
        await press(pilot, *"depot.sdf", "enter")
        await pilot.pause(1.0)
        await press(pilot, "f3", *["left"] * 15)
        await take(pilot, "setup-start")
    async with opened(None, SMALL) as pilot:
        await pilot.pause(1.0)
        await press(pilot, "f4")
        await take(pilot, "setup-small")
        await press(pilot, "f2", "ctrl+o", *"yard.sdf", "enter")
        await pilot.pause(1.0)
        await press(pilot, "escape", "m", "down", "w")
        await pilot.pause(1.0)
        await take(pilot, "setup-missing")
        await press(pilot, "up", "enter")
        await take(pilot, "remedy")


# What all of them need.


@asynccontextmanager
async def opened(
    run: Path | None, size: tuple[int, int] = MIDDLE, theme: str = "", *, watch: bool = False
) -> AsyncIterator[Pilot[int]]:
    app = Workbench(run, watch=watch, config=Config(theme=theme))
    async with app.run_test(size=size, notifications=True) as pilot:
        await until(pilot, lambda: not pilot.app.screen.query_one(WorldMap).notice)
        yield pilot


async def press(pilot: Pilot[int], *keys: str) -> None:
    await pilot.press(*keys)
    await pilot.pause(0.2)


async def until(pilot: Pilot[int], is_so: Callable[[], bool]) -> None:
    """Raises TimeoutError."""
    deadline = time.monotonic() + PATIENCE
    while not is_so():
        if time.monotonic() > deadline:
            raise TimeoutError
        await pilot.pause(0.02)
    pilot.app.clear_notifications()
    await pilot.pause(0.2)


async def take(pilot: Pilot[int], name: str, *, settled_after: float = 0.6) -> None:
    # Words that fade after a while would hide what is below them.
    pilot.app.clear_notifications()
    await pilot.pause(settled_after)
    shown = type(pilot.app.screen).__name__
    if shown != PICTURES[name].screen:
        raise RuntimeError(f"{name}: {shown} is shown in place of {PICTURES[name].screen}")
    (SCREENS / f"{name}.svg").write_text(
        pilot.app.export_screenshot(simplify=True), encoding="utf-8"
    )
    print(f"wrote {name}", file=sys.stderr)


async def take_live(pilot: Pilot[int], name: str, guiding: Pilot[int]) -> None:
    """A picture while a robot moves, also at its end; `guiding` lets the run go on, and accepts
    what waits meanwhile.
    """
    await pause(guiding, False)
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        if state(guiding).status == "finished":
            raise RuntimeError(f"{name}: the run ended before a robot that moves could be shown")
        await accept_if_waiting(guiding)
        await pilot.pause(0.02)
        if is_under_way(pilot):
            # The panes of a screen follow its state one after the other.
            await take(pilot, name, settled_after=0.2)
            if is_under_way(pilot):
                return
    raise TimeoutError(name)


async def pause(pilot: Pilot[int], wanted: bool) -> None:
    """Pauses the run, or lets it go on."""
    if state(pilot).paused is not wanted:
        await press(pilot, "space")
        await until(pilot, lambda: state(pilot).paused is wanted)


async def accept_if_waiting(pilot: Pilot[int]) -> None:
    if state(pilot).status == "waiting":
        await press(pilot, "a")


def is_under_way(pilot: Pilot[int], tests: int = 0) -> bool:
    snapshot = run_screen(pilot).snapshot
    judged = snapshot.state.round is None or any(
        one.verdict for one in snapshot.state.round.candidates
    )
    return (
        judged
        and snapshot.state.tests_done >= tests
        and any(row.time > UNDER_WAY for row in snapshot.live)
    )


def others(now: RunState) -> list[int]:
    """The rows of candidates that are dissimilar, and showed another failure."""
    if now.round is None or now.round.done or now.status == "waiting":
        return []
    judged = (one for one in now.round.candidates if one.verdict == "dissimilar")
    return [one.index for one in judged if nearest_other(now, one) is not None]


def run_screen(pilot: Pilot[int]) -> RunScreen:
    return next(screen for screen in pilot.app.screen_stack if isinstance(screen, RunScreen))


def state(pilot: Pilot[int]) -> RunState:
    return run_screen(pilot).snapshot.state


def new_run(name: str, **reduction: int) -> Path:
    run = free_run_path(name)
    scenario = load_scenario(find_scenario(name))
    create_run(
        scenario.model_copy(update={"reduction": scenario.reduction.model_copy(update=reduction)}),
        run,
    )
    return run


def wait_for_tests(run: Path, tests: int) -> None:
    while True:
        with RunFile(run) as file:
            if fold(file.events()).tests_done >= tests:
                return
        time.sleep(0.2)


def stop(run: Path) -> None:
    """Ends the engine of a run, if one works."""
    if not engine_is_alive(run):
        return
    with RunFile(run) as file:
        file.send("stop")
    deadline = time.monotonic() + PATIENCE
    while engine_is_alive(run) and time.monotonic() < deadline:
        time.sleep(0.1)


if __name__ == "__main__":
    main()
