"""Without any colour, brightness included, every screen says the same: what keys change is seen in
signs and text styles.
"""

import fake_moments
import fake_run
import pytest
from test_snapshots import LARGE, MOMENTS, OPENED, SMALL, USUAL, by_name, settled
from textual.widgets import Input

from ddenv.workbench.app import Workbench
from tests.tiers import slow

# What moves the cursor or the focus on any screen.
KEYS = ("down", "tab", "down", "tab", "right", "tab", "shift+tab")


@pytest.fixture(autouse=True)
def no_colours(monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setattr(Workbench, "notify", lambda *_, **__: None)


def frame(app, colours):
    """The cells of the screen: each with its character and its style, with or without colours."""
    for field in app.screen.query(Input):
        field.cursor_blink = False
    rows = []
    for strip in app.screen._compositor.render_strips():
        cells = []
        for text, style, _ in strip:
            seen = ("", "") if style is None else (str(style.color), str(style.bgcolor))
            how = () if style is None else (style.bold, style.dim, style.reverse, style.underline)
            cells += [(char, *how, *(seen if colours else ())) for char in text]
        rows.append(cells)
    return rows


async def what_keys_change_is_seen(app, size, opened=()):
    async with app.run_test(size=size) as pilot:
        await settled(pilot)
        for key in opened:
            await pilot.press(key)
            await pilot.pause()
        where = type(app.screen).__name__
        before = frame(app, True), frame(app, False)
        for key in KEYS:
            await pilot.press(key)
            await pilot.pause()
            now = frame(app, True), frame(app, False)
            assert (now[0] == before[0]) or (now[1] != before[1]), (
                f"{where}: {key} is seen by colour alone"
            )
            before = now


@pytest.mark.parametrize("name", slow(pytest.mark.screens, OPENED, but=["history"]))
async def test_on_every_screen_over_a_run(run, name):
    fake_moments.guided(run).hold()
    await what_keys_change_is_seen(Workbench(run.path), USUAL, OPENED[name])


@pytest.mark.parametrize(
    "size", slow(pytest.mark.screens, [SMALL, USUAL, LARGE], but=[USUAL]), ids=str
)
@pytest.mark.parametrize(
    "moment", slow(pytest.mark.screens, MOMENTS, but=[fake_moments.waiting]), ids=by_name
)
async def test_at_every_moment_of_a_run(run, moment, size):
    moment(run).hold()
    await what_keys_change_is_seen(Workbench(run.path), size)


@pytest.mark.screens
@pytest.mark.parametrize("opened", [(), ("ctrl+o",)], ids=["setup", "open"])
async def test_on_the_screens_before_a_run(scenarios, runs, opened):
    fake_moments.finished(fake_run.FakeRun(runs / "crates-1.ddenv")).close()
    await what_keys_change_is_seen(Workbench(), USUAL, opened)


async def test_selected_text_in_a_field_and_by_the_mouse(run):
    fake_moments.guided(run).hold()
    app = Workbench(run.path)
    async with app.run_test(size=USUAL) as pilot:
        await settled(pilot)
        await pilot.press("slash", *"crate", "shift+left", "shift+left", "shift+left")
        await pilot.pause()
        field = app.screen.query_one(Input)
        assert field.selected_text == "ate"
        x, y, width, _ = field.content_region
        row = frame(app, False)[y][x : x + width]
        assert "".join(char for char, _, _, reverse, _ in row if reverse) == "ate"
        await pilot.press("escape", "F")
        await pilot.pause()
        x, y, *_ = app.screen.query_one("#facts").content_region
        await pilot.mouse_down(offset=(x, y))
        await pilot.hover(offset=(x + 6, y))
        await pilot.mouse_up(offset=(x + 6, y))
        await pilot.pause()
        selected = app.screen.get_selected_text()
        assert selected
        assert selected in "".join(cell[0] for row in frame(app, False) for cell in row if cell[3])
