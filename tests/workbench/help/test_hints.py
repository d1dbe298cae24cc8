"""Keys that stand in the borders of dialogs and panes: each can be clicked, and does what the key
does.
"""

import fake_moments
import fake_run
import pytest
from test_snapshots import OPENED, SMALL, USUAL

from ddenv.workbench.app import Config, Workbench
from ddenv.workbench.help.hints import Framed, clickable
from ddenv.workbench.runs.runs_table import RunList
from tests.tiers import slow
from tests.waiting import eventually

# What an input or a scrolled text does with them is no binding of the screen.
OF_WIDGETS = {"enter", "up", "down", "tab", "space"}


def hints(screen):
    """Where each key of the screen's borders can be clicked: the last cell of its words, by key."""
    found = {}
    for framed in screen.query(Framed):
        y = framed.region.bottom - 1
        for x in range(framed.region.x, framed.region.right):
            if key := screen.get_style_at(x, y).meta.get("key"):
                found[key] = x, y
    return found


def test_each_key_has_the_words_behind_it():
    said = {
        "enter opens": "enter",
        "← → other tests": "left",
        "tab or click chooses": "tab",
        "^o opens": "ctrl+o",
    }
    found = clickable("   ".join(said))
    assert found.plain == "   ".join(said)
    assert {found.plain[at.start : at.end]: at.style.meta["key"] for at in found.spans} == said


@pytest.mark.parametrize("name", slow(pytest.mark.screens, OPENED, but=["settings"]))
async def test_a_dialog_obeys_each_key_that_it_shows_and_closes_by_a_click(run, name):
    fake_moments.guided(run).hold()
    app = Workbench(run.path)
    async with app.run_test(size=USUAL) as pilot:
        await pilot.pause()
        for key in OPENED[name]:
            await pilot.press(key)
            await pilot.pause()
        screen, shown = app.screen, hints(app.screen)
        assert set(shown) - OF_WIDGETS <= set(screen.active_bindings), name
        if screen.is_modal and screen.query(Framed):
            assert await pilot.click(
                offset=next(shown[key] for key in ("escape", "n", "c") if key in shown)
            )
            await eventually(lambda: app.screen is not screen)


@pytest.mark.screens
async def test_a_click_in_a_pane_without_the_focus_is_for_this_pane(scenarios, runs):
    fake_moments.finished(fake_run.FakeRun(runs / "crates-1.ddenv")).close()
    app = Workbench()
    async with app.run_test(size=USUAL) as pilot:
        await eventually(
            lambda: len(app.screen.query(RunList)) and app.screen.query_one(RunList).option_count
        )
        await pilot.pause()
        assert not app.screen.query_one(RunList).has_focus
        await pilot.click(offset=hints(app.screen)["enter"])
        await eventually(lambda: type(app.screen).__name__ == "RunScreen")


async def test_a_hint_has_the_users_own_key(run):
    fake_moments.guided(run).hold()
    app = Workbench(run.path, config=Config(keys={"run.method": "ctrl+e"}))
    async with app.run_test(size=SMALL) as pilot:
        await pilot.pause()
        await pilot.press("4")
        await pilot.pause()
        pane = app.screen.query_one("#now", Framed)
        assert "ctrl+e explains" in str(pane.border_subtitle)
        at = hints(app.screen)["ctrl+e"]
        await pilot.click(offset=at)
        await eventually(lambda: type(app.screen).__name__ == "Method")
