"""What the screens look like. Update with `pytest tests/workbench --snapshot-update` after looking
at them.
"""

import math
from contextlib import suppress

import fake_moments
import fake_run
import pytest
from test_explain_algorithms import leave_out
from textual.widgets import Input
from textual.worker import WorkerCancelled

from ddenv.learn.catalog import bundled, open_lesson
from ddenv.learn.score import Score
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.kept_scores import keep_score
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from tests.tiers import slow

SMALL, USUAL, LARGE = (80, 24), (120, 36), (200, 60)
SIZES = [SMALL, USUAL, LARGE]
THEMES = ["ddenv", "ddenv-light", "ansi-dark"]


@pytest.fixture(autouse=True)
def no_clock(monkeypatch):
    """Notifications go by the clock, and so does what is seen of a run that is read in parts."""
    monkeypatch.setattr(Workbench, "notify", lambda *_, **__: None)
    monkeypatch.setattr("ddenv.workbench.shared.poll.PATIENCE", math.inf)


async def settled(pilot):
    """Waits until nothing changes any more: the map is drawn after the first frame, and looks are
    made ten times a second.
    """
    await pilot.pause()
    shown, same = None, 0
    for _ in range(300):
        if same == 5:
            return
        # Else the picture depends on when it is taken.
        for field in pilot.app.screen.query(Input):
            field.cursor_blink = False
        with suppress(WorkerCancelled):
            await pilot.app.workers.wait_for_complete()
        await pilot.pause(0.1)
        now = pilot.app.screen._compositor.render_strips()
        same = same + 1 if now == shown else 0
        shown = now
    raise AssertionError("the screen never stands still")


def shown(theme="ddenv", *keys):
    """Presses `keys` under a theme once the screen stands still."""

    async def run_before(pilot):
        pilot.app.theme = theme
        await settled(pilot)
        for key in keys:
            await pilot.press(key)
            await pilot.pause()
        if keys:
            await settled(pilot)

    return run_before


def baseline(run):
    run.created()
    run.test(None, "failed", failure="stuck")
    run.test(None, "pass", run=1)
    run.live((run.start(None, 2), 0.7), (run.start(None, 3), 0.3))
    return run


MOMENTS = [
    baseline,
    fake_moments.mid_round,
    fake_moments.sliced,
    fake_moments.waiting,
    fake_moments.rarer,
    fake_moments.certifying,
    fake_moments.finished,
    fake_moments.not_shown,
]
by_name = lambda value: value.__name__ if callable(value) else str(value)  # noqa: E731


@pytest.mark.parametrize("size", slow(pytest.mark.screens, SIZES, but=[USUAL]), ids=str)
@pytest.mark.parametrize("theme", slow(pytest.mark.screens, THEMES, but=["ddenv"]))
def test_run_screen(snap_compare, run, theme, size):
    fake_moments.guided(run).hold()
    assert snap_compare(Workbench(run.path), terminal_size=size, run_before=shown(theme))


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [SMALL, USUAL], but=[SMALL]), ids=str)
@pytest.mark.parametrize(
    "moment", slow(pytest.mark.screens, MOMENTS, but=[fake_moments.waiting]), ids=by_name
)
def test_moments_of_a_run(snap_compare, run, moment, size):
    moment(run)
    if moment not in (fake_moments.finished, fake_moments.not_shown):
        run.hold()
    assert snap_compare(Workbench(run.path), terminal_size=size, run_before=shown())


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [SMALL, USUAL], but=[SMALL]), ids=str)
def test_what_a_candidate_drops(snap_compare, run, size):
    fake_moments.piled(run).hold()
    assert snap_compare(
        Workbench(run.path), terminal_size=size, run_before=shown("ddenv", "down", "down")
    )


@pytest.mark.screens
def test_run_screen_without_its_engine(snap_compare, run):
    fake_moments.mid_round(run)
    assert snap_compare(Workbench(run.path), terminal_size=USUAL, run_before=settled)


# The dialogs and screens that a key opens over a run; the table's first rows are trials. Not those
# that show folders, which are others in each run of the tests.
OPENED = {
    "help": ["question_mark"],
    "palette": ["ctrl+p"],
    "method": ["e"],
    "pin": ["p"],
    "try": ["w"],
    "find": ["slash"],
    "layers": ["l"],
    "settings": ["c"],
    "accept-other": ["up", "up", "up", "a"],
    "history": ["h"],
    "failures": ["f"],
    "branch": ["f", "enter"],
    "compare": ["h", "m", "up", "c"],
    "log": ["L"],
    "quit": ["q"],
    "runs": ["R"],
    "past": ["less_than_sign"],
    "rounds": ["b"],
    "facts": ["F"],
    "signs": ["k"],
    "why-empty": ["W"],
    "playback": ["P", "right", "right"],
    "beside": ["P", "o"],
}


@pytest.mark.parametrize("name", slow(pytest.mark.screens, OPENED, but=["help", "history"]))
@pytest.mark.parametrize(
    ("theme", "size"),
    [
        pytest.param("ddenv", SMALL, id="dark"),
        pytest.param("ddenv-light", USUAL, id="light", marks=pytest.mark.screens),
        pytest.param("ansi-dark", SMALL, id="ansi", marks=pytest.mark.screens),
    ],
)
def test_what_a_key_opens(snap_compare, run, name, theme, size):
    fake_moments.guided(run).hold()
    assert snap_compare(
        Workbench(run.path), terminal_size=size, run_before=shown(theme, *OPENED[name])
    )


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [SMALL, USUAL], but=[USUAL]), ids=str)
@pytest.mark.parametrize(
    "keys",
    slow(pytest.mark.screens, [(), ("enter", *["right"] * 20)], but=[()]),
    ids=["why", "both"],
)
def test_why_it_fails(snap_compare, run, keys, size):
    fake_moments.faster_without(run).write("paused")
    assert snap_compare(
        Workbench(run.path), terminal_size=size, run_before=shown("ddenv", "W", *keys)
    )


@pytest.mark.screens
def test_both_runs_in_no_colour(snap_compare, run, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    fake_moments.faster_without(run).write("paused")
    keys = ("W", "enter", *["right"] * 20)
    assert snap_compare(Workbench(run.path), terminal_size=SMALL, run_before=shown("ddenv", *keys))


@pytest.mark.screens
@pytest.mark.parametrize("name", ["history", "compare", "runs"])
def test_what_a_key_opens_where_there_is_room(snap_compare, run, name):
    fake_moments.guided(run).hold()
    assert snap_compare(
        Workbench(run.path), terminal_size=LARGE, run_before=shown("ddenv", *OPENED[name])
    )


@pytest.mark.screens
@pytest.mark.parametrize("pane", ["2", "3", "4", "5"])
def test_panes_where_there_is_little_room(snap_compare, run, pane):
    fake_moments.guided(run).hold()
    assert snap_compare(Workbench(run.path), terminal_size=SMALL, run_before=shown("ddenv", pane))


@pytest.mark.parametrize("size", slow(pytest.mark.screens, SIZES, but=[LARGE]), ids=str)
@pytest.mark.parametrize("theme", slow(pytest.mark.screens, THEMES, but=["ddenv-light"]))
def test_setup_screen(snap_compare, scenarios, runs, theme, size):
    fake_moments.finished(fake_run.FakeRun(runs / "crates-1.ddenv")).close()
    assert snap_compare(Workbench(), terminal_size=size, run_before=shown(theme))


@pytest.mark.screens
@pytest.mark.parametrize("pane", ["f3", "f4"])
def test_panes_of_the_setup_screen(snap_compare, scenarios, pane):
    assert snap_compare(Workbench(), terminal_size=SMALL, run_before=shown("ddenv", pane))


@pytest.mark.screens
@pytest.mark.parametrize("size", [SMALL, USUAL], ids=str)
@pytest.mark.parametrize("keys", [["m", "down", "w"], ["m", "enter"]], ids=["rows", "remedy"])
def test_missing_files(snap_compare, scenarios, size, keys):
    world = scenarios / "crates.sdf"
    names = ("jersey_barrier", "old_shelf", "construction_cone")
    missing = "".join(
        f"<include><uri>model://{name}</uri><pose>3 -4 0 0 0 0</pose></include>" for name in names
    )
    world.write_text(world.read_text().replace("</world>", f"{missing}</world>"))
    assert snap_compare(Workbench(), terminal_size=size, run_before=shown("ddenv", *keys))


@pytest.mark.screens
def test_saving_a_scenario(snap_compare, scenarios, monkeypatch, tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert snap_compare(Workbench(), terminal_size=SMALL, run_before=shown("ddenv", "f7"))


@pytest.mark.screens
@pytest.mark.parametrize("size", [SMALL, USUAL], ids=str)
@pytest.mark.parametrize("does", ["budget", "race"])
def test_what_a_lesson_lets_students_do(snap_compare, runs, does, size):
    lesson = open_lesson(bundled()[0]).lesson
    step = next(number for number, step in enumerate(lesson.steps) if getattr(step, does))
    keep_score(lesson.name, Score(step=step))
    app, next_model = Workbench(first=lambda: LessonsScreen(lesson.file)), "right_square_bracket"
    keys = {"budget": ["enter", next_model, "enter", "w", "m", "m"], "race": ["s", "enter", "end"]}
    assert snap_compare(app, terminal_size=size, run_before=shown("ddenv", *keys[does]))


@pytest.mark.screens
def test_run_screen_of_another_algorithm(snap_compare, runs):
    data = fake_run.scenario()
    data["reduction"] |= {"algorithm": "splitting", "accept_rate": "first"}
    run = fake_run.FakeRun(runs / "crates-1.ddenv", data).created().baseline()
    leave_out(run, [0, 1, 2, 3])
    run.test(0, "pass")
    run.live((run.start(0, 1), 0.4))
    run.hold()
    assert snap_compare(Workbench(run.path), terminal_size=USUAL, run_before=settled)
    run.close()


@pytest.mark.screens
@pytest.mark.parametrize("size", [(20, 5), (60, 20)], ids=str)
def test_too_small_says_what_it_needs(snap_compare, run, size):
    fake_moments.guided(run).hold()
    assert snap_compare(Workbench(run.path), terminal_size=size, run_before=settled)


@pytest.mark.screens
def test_no_color(snap_compare, run, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    fake_moments.guided(run).hold()
    assert snap_compare(Workbench(run.path), terminal_size=USUAL, run_before=settled)
