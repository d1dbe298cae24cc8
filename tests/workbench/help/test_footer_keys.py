"""Each key that a footer offers does something that can be seen."""

import fake_moments
import pytest
from test_snapshots import SMALL, USUAL, settled

from ddenv.learn.catalog import bundled, open_lesson
from ddenv.workbench.app import Workbench
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from tests.tiers import slow
from tests.waiting import eventually

# What the run is like, and the keys to a screen.
OF_A_RUN = {
    "run": (fake_moments.guided, []),
    "map": (fake_moments.guided, ["1"]),
    "past": (fake_moments.guided, ["less_than_sign", "less_than_sign"]),
    "waiting": (fake_moments.waiting, []),
    "ended": (fake_moments.finished, []),
    "helped": (fake_moments.helped, []),
    "history": (fake_moments.guided, ["h", "up"]),
    "why": (fake_moments.finished, ["W"]),
    "playback": (fake_moments.guided, ["P", "right", "right"]),
    "runs": (fake_moments.guided, ["R"]),
}
# Keys to the other screens, from the setup screen or from a lesson.
OTHERS = {"setup": [], "setup-map": ["f3"], "lessons": ["L"], "lesson": []}
ENDED = (fake_moments.finished, fake_moments.helped)


def seen(app):
    """All that a user can notice."""
    cells = [
        [(part.text, part.style) for part in strip]
        for strip in app.screen._compositor.render_strips()
    ]
    return (
        app.screen,
        app.screen.focused,
        cells,
        [each.message for each in app._notifications],
        app.clipboard,
    )


def offered(app):
    return [entry.key for entry in app.screen.query_one(KeyFooter).entries if entry.enabled]


def opened(run, name):
    """The app, and the keys to the screen."""
    if name in OF_A_RUN:
        return Workbench(run.path), OF_A_RUN[name][1]
    lesson = open_lesson(bundled()[0]).lesson.file
    return Workbench(first=(lambda: LessonsScreen(lesson)) if name == "lesson" else None), OTHERS[
        name
    ]


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [SMALL, USUAL], but=[SMALL]), ids=str)
@pytest.mark.parametrize("name", slow(pytest.mark.screens, [*OF_A_RUN, *OTHERS], but=["history"]))
async def test_each_key_of_the_footer_does_something(run, scenarios, started, name, size):
    moment, _ = OF_A_RUN.get(name, (fake_moments.finished, []))
    moment(run)
    if moment not in ENDED:
        run.hold()
    pressed, left = set(), True
    while left:
        app, way = opened(run, name)
        async with app.run_test(size=size) as pilot:
            await settled(pilot)
            for key in way:
                await pilot.press(key)
                await settled(pilot)
            left = await press_all(
                app, pilot, pressed, lambda: (len(run.file.commands()), len(started))
            )
    assert len(pressed) > 2


async def press_all(app, pilot, pressed, asked):
    """Presses the keys of the footer that were not yet; returns whether one of them left the
    screen.
    """
    screen = app.screen
    for key in offered(app):
        if key in pressed or key not in offered(app):
            continue
        pressed.add(key)
        if key == "0":
            # A map that shows all already would not change.
            await pilot.press("plus")
            await settled(pilot)
        before = seen(app), asked()
        await pilot.press(key)
        await eventually(
            lambda before=before: not app.is_running or (seen(app), asked()) != before,
            lambda key=key: f"{key}: nothing",
        )
        while app.is_running and screen in app.screen_stack and app.screen is not screen:
            await pilot.press("escape")
            await pilot.pause()
        if not app.is_running or app.screen is not screen:
            return True
    return False
