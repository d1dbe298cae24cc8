"""The setup screen opens worlds without a scenario."""

import fake_run
import pytest
import yaml
from textual.widgets import Input, OptionList, Static

from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup.files import OpenFile
from tests.workbench.setup.setup_session import Opened


async def test_a_bare_world_asks_for_spawn_and_goal(scenarios, runs, started):
    async with Opened() as session:
        await session.press("ctrl+o")
        assert isinstance(session.app.screen, OpenFile)
        await session.pilot.press(*"nowhere.sdf", "enter")
        assert "no such file" in session.app.screen.query_one("#wrong", Static).render().plain
        session.app.screen.query_one("#path", Input).value = str(scenarios / "crates.sdf")
        await session.pilot.press("enter")
        await session.pilot.pause()
        await session.settle()
        assert session.value("spawn_x") == ""
        assert "12 models" in session.screen.query_one("#about", Static).render().plain
        await session.press("ctrl+s")
        assert "spawn x m: is missing" in session.wrong()
        session.fill(spawn_x="-6", spawn_y="0", spawn_z="0.16", spawn_yaw="0", goal_x="6", goal_y="0")
        await session.pilot.pause()
        assert session.screen.query_one(WorldMap).place.goal == (6.0, 0.0)
        session.fill(goal_x="inf")
        await session.press("ctrl+s")
        assert "goal x m: expected -1000000 to 1000000, found inf" in session.wrong()
        session.fill(goal_x="6", spawn_z="0.05")
        await session.press("ctrl+s")
        assert "stands inside model" in session.wrong()
        assert list(runs.iterdir()) == []
        session.fill(spawn_z="0.16")
        await session.press("ctrl+s")
        assert started == [("crates-1.ddenv", 4, {"accept_mode": "automatic"})]


@pytest.mark.screens
async def test_a_bare_world_starts_with_the_defaults_of_a_scenario(scenarios, started):
    own = {
        "failure": {"timeout": 12, "epsilon": 0.25},
        "reduction": {"iterations": 9, "baseline_runs": 5, "seed": 4, "pair": "timeseg/random", "algorithm": "ddmin"},
    }
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(fake_run.scenario() | own))
    fields = ("timeout", "epsilon", "iterations", "baseline_runs", "seed")
    async with Opened() as session:
        assert [session.value(id) for id in fields] == ["12", "0.25", "9", "5", "4"]
        assert session.method() == ["ddmin", "timeseg", "random"]
        session.fill(timeout="soon", jobs="many", seed="6")
        await session.press("ctrl+s")
        assert session.screen.query_one("#timeout", Input).has_class("-wrong")
        await session.open(scenarios / "crates.sdf")
        assert [session.value(id) for id in (*fields, "jobs")] == ["45", "0.33", "3", "10", "0", "4"]
        assert session.method() == ["ddenv", "model2model", "avg-trajectory-proximal"]
        assert not session.screen.query(".-wrong")
        assert session.wrong() == ""
        session.fill(epsilon="near", jobs="2")
        session.screen.query_one("#scenario-list", OptionList).highlighted = 0
        await session.pilot.pause()
        await session.settle()
        assert [session.value(id) for id in (*fields, "jobs")] == ["12", "0.25", "9", "5", "4", "2"]


@pytest.mark.screens
async def test_typed_places_are_marked_in_the_next_world_too(scenarios, tmp_path):
    other = tmp_path / "other.sdf"
    other.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened() as session:
        await session.open(scenarios / "crates.sdf")
        session.fill(spawn_x="-6", spawn_y="0", spawn_z="0.16", spawn_yaw="0", goal_x="6", goal_y="0")
        await session.pilot.pause()
        await session.open(other)
        assert session.screen.query_one(WorldMap).place.goal == (6.0, 0.0)


@pytest.mark.screens
async def test_the_file_dialog_can_be_cancelled_and_filters(scenarios, tmp_path, monkeypatch):
    monkeypatch.chdir(scenarios)
    (scenarios / "notes.txt").write_text("x")
    async with Opened() as session:
        await session.press("ctrl+o")
        tree = session.app.screen.query_one("#tree")
        shown = {path.name for path in tree.filter_paths(scenarios.iterdir())}
        assert shown == {"crates.yaml", "crates.sdf", "robot.sdf"}
        await session.pilot.press("escape")
        assert session.app.screen is session.screen


@pytest.mark.screens
async def test_without_scenarios_the_map_names_the_key_that_opens_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr("ddenv.world.load.SCENARIOS", tmp_path / "none")
    async with Opened() as session:
        assert "ctrl+o" in session.screen.query_one(WorldMap).notice
