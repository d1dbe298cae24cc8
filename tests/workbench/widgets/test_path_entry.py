"""Tab completes paths as far as there is no choice."""

import pytest
from textual.widgets import Input

from ddenv.workbench.widgets.path_entry import completed
from tests.workbench.setup.setup_session import Opened


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "worlds").mkdir()
    for name in ("depot.world", "depot-2.world", ".hidden"):
        (tmp_path / "worlds" / name).touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def test_what_has_no_choice_is_completed(folder):
    ends = {
        "wo": "worlds/",
        "worlds/": "worlds/depot",
        "worlds/depot.": "worlds/depot.world",
        "~/w": "~/worlds/",
    }
    ends |= {"worlds/.h": "worlds/.hidden", f"{folder}/w": f"{folder}/worlds/"}
    same = ("worlds/depot", "no", "no/where/x", "a\0b/c", "~nobody-of-this-name/x", "x" * 5000)
    assert {text: completed(text) for text in ends} == ends
    assert {text: completed(text) for text in same} == {text: text for text in same}


async def test_tab_completes_and_then_goes_on(scenarios, folder):
    async with Opened((80, 24)) as session:
        await session.press("ctrl+o")
        field = session.app.screen.query_one("#path", Input)
        await session.pilot.press(*"wo", "tab")
        assert field.value == "worlds/"
        await session.pilot.press("tab", "full_stop", "tab")
        assert field.value == "worlds/depot.world" and field.has_focus
        await session.pilot.press("tab")
        assert not field.has_focus
