"""Settings are saved as a scenario file that loads to the same scenario."""

from pathlib import Path

import pytest
from textual.widgets import Input, Static

from ddenv.errors import UserError
from ddenv.workbench.setup.files import recent_files
from ddenv.workbench.setup.save_scenario import SaveScenario, save_scenario, scenario_path
from ddenv.world.load import load_scenario
from tests.workbench.setup.setup_session import Opened


def same(one, other):
    """Whether two scenarios are the same, however their files are named."""

    def told(scenario):
        data = scenario.model_dump()
        data["world"], data["robot"]["model"] = scenario.world.resolve(), scenario.robot.model.resolve()
        return data | {"folder": None}

    return told(one) == told(other)


def test_it_loads_to_the_same_and_moves_with_its_folder(scenarios, tmp_path):
    own = load_scenario(scenarios / "crates.yaml")
    beside = scenarios / "mine.yaml"
    save_scenario(own, beside)
    assert same(load_scenario(beside), own)
    assert "world: crates.sdf" in beside.read_text()
    moved = scenarios.rename(tmp_path / "moved")
    assert load_scenario(moved / "mine.yaml").world == moved / "crates.sdf"


def test_a_name_gets_its_ending_and_must_be_possible(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert scenario_path(" mine ") == Path("mine.yaml")
    assert scenario_path("v1.2") == Path("v1.2.yaml")
    assert scenario_path("a.yml") == Path("a.yml")
    for text, words in ((" ", "give the name"), ("no/such/x", "there is no folder"), ("\0", "give the name")):
        with pytest.raises(UserError, match=words):
            scenario_path(text)


def test_a_world_that_is_gone_is_told(scenarios, tmp_path):
    own = load_scenario(scenarios / "crates.yaml")
    (scenarios / "crates.sdf").unlink()
    with pytest.raises(UserError, match="no longer exists"):
        save_scenario(own, tmp_path / "x.yaml")
    assert not (tmp_path / "x.yaml").exists()


async def test_the_key_asks_for_a_name_and_never_overwrites_unasked(scenarios, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    taken = tmp_path / "taken.yaml"
    taken.write_text("mine\n")
    async with Opened() as session:
        session.fill(iterations="8", goal_y="1.5")
        await session.press("f7")
        dialog = session.app.screen
        assert isinstance(dialog, SaveScenario)
        assert dialog.query_one(Input).value == "crates.yaml"
        dialog.query_one(Input).value = "taken"
        await session.press("enter")
        assert "exists already" in dialog.query_one("#wrong", Static).render().plain
        assert taken.read_text() == "mine\n"
        await session.press("enter")
        await session.pilot.pause()
        assert session.app.screen is session.screen
        await session.settle()
        saved = load_scenario(taken)
        assert (saved.reduction.iterations, saved.goal.y) == (8, 1.5)
        assert same(saved, session.screen._scenario())
    assert recent_files() == [taken]


@pytest.mark.screens
async def test_a_folder_that_cannot_be_written_is_told(scenarios, tmp_path):
    async with Opened() as session:
        await session.press("f7")
        dialog = session.app.screen
        dialog.query_one(Input).value = str(tmp_path / ("x" * 300))
        await session.press("enter")
        assert "cannot be written" in dialog.query_one("#wrong", Static).render().plain
        await session.press("escape")
        assert session.app.screen is session.screen
