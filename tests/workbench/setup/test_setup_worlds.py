"""The setup screen opens worlds without a scenario."""

import fake_run
import pytest
from textual.widgets import Input, OptionList, Static

from ddenv.runs.engine_job import Reduce
from ddenv.runs.preferences import state_file
from ddenv.runs.remedies import REMEDIES, remembered
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup.files import KEPT, RECENT, FileList, OpenFile, recent_files, remember
from ddenv.world.files import cutting
from tests.waiting import eventually
from tests.workbench.setup.setup_session import Opened, write_scenario
from tests.world.files.cutters import PYRAMID, Cutters, write_world


@pytest.mark.screens
async def test_a_bare_world_asks_for_spawn_and_goal(scenarios, runs, started):
    (scenarios / "notes.txt").write_text("x")
    async with Opened() as session:
        await session.press("ctrl+o")
        assert isinstance(session.app.screen, OpenFile)
        shown = session.app.screen.query_one("#tree").filter_paths(scenarios.iterdir())
        assert {path.name for path in shown} == {"crates.yaml", "crates.sdf", "robot.sdf"}
        await session.pilot.press("escape")
        assert session.app.screen is session.screen
        await session.press("ctrl+o")
        await session.pilot.press(*"nowhere.sdf", "enter")
        assert "no such file" in session.refused()
        session.app.screen.query_one("#path", Input).value = str(scenarios / "crates.sdf")
        await session.pilot.press("enter")
        await session.pilot.pause()
        await session.settle()
        assert session.value("spawn_x") == ""
        assert "12 models" in session.screen.query_one("#about", Static).render().plain
        await session.press("ctrl+s")
        assert "spawn x m, spawn y m, spawn z m, yaw rad: missing" in session.wrong()
        await session.place()
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
        assert started == [("crates-1.ddenv", fake_run.attended(4), Reduce())]


@pytest.mark.screens
async def test_a_bare_world_starts_with_the_defaults_of_a_scenario(scenarios, started):
    own = {
        "failure": {"timeout": 12, "epsilon": 0.25},
        "reduction": {
            "iterations": 9,
            "baseline_runs": 5,
            "seed": 4,
            "pair": "timeseg/random",
            "algorithm": "ddmin",
        },
    }
    write_scenario(scenarios, **own)
    fields = ("timeout", "epsilon", "iterations", "baseline_runs", "seed")
    async with Opened() as session:
        assert [session.value(id) for id in fields] == ["12", "0.25", "9", "5", "4"]
        assert session.method() == ["ddmin", "timeseg", "random"]
        session.fill(timeout="soon", jobs="many", seed="6")
        await session.press("ctrl+s")
        assert session.screen.query_one("#timeout", Input).has_class("-wrong")
        await session.open(scenarios / "crates.sdf")
        assert [session.value(id) for id in (*fields, "jobs")] == [
            "45",
            "0.33",
            "3",
            "10",
            "0",
            "4",
        ]
        assert session.method() == ["ddenv", "model2model", "avg-trajectory-proximal"]
        assert not session.screen.query(".-wrong")
        assert session.wrong() == ""
        session.fill(epsilon="near", jobs="2")
        session.screen.query_one("#scenario-list", OptionList).highlighted = 0
        await session.pilot.pause()
        await session.settle()
        assert [session.value(id) for id in (*fields, "jobs")] == ["12", "0.25", "9", "5", "4", "2"]


@pytest.mark.screens
async def test_meshes_that_are_cut_are_counted_and_another_choice_stops_that(
    scenarios, tmp_path, home, monkeypatch
):
    processes = Cutters(tmp_path, "hangs")
    monkeypatch.setattr(cutting, "COMMAND", processes.command)
    monkeypatch.setattr(cutting, "SLOW", 0.0)
    world = write_world(tmp_path, ("roof", PYRAMID))
    async with Opened() as session:
        session.screen.preview.read(world, opened=False)
        await eventually(
            lambda: (
                "cutting meshes into convex pieces: 0 of 1"
                in str(session.screen.preview.border_subtitle)
            )
        )
        await eventually(processes.started)
        await session.open(scenarios / "crates.sdf")
        await eventually(lambda: not processes.left())
        assert "12 models" in session.screen.query_one("#about", Static).render().plain
        session.screen.preview.read(world, opened=False)
        await eventually(lambda: processes.started() == 2)
    # Nor does it go on once the workbench is left.
    await eventually(lambda: not processes.left())


@pytest.mark.screens
async def test_without_scenarios_the_map_names_the_key_that_opens_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr("ddenv.world.load.SCENARIOS", tmp_path / "none")
    async with Opened() as session:
        assert "ctrl+o" in session.screen.query_one(WorldMap).notice


@pytest.fixture
def files(tmp_path):
    made = [tmp_path / f"world-{number}.sdf" for number in range(KEPT + 3)]
    for path in made:
        path.touch()
    return made


def test_the_newest_come_first_once_and_not_without_end(files):
    for path in (*files, files[0]):
        remember(path)
    found = recent_files()
    assert found[:2] == [files[0], files[-1]]
    assert len(found) == len(set(found)) == KEPT
    files[-1].unlink()
    assert recent_files() == [files[0], *found[2:]]


DAMAGED = [
    "",
    "no list",
    "{",
    '{"a": 1, "b": "tube:1", "c": "/no/where"}',
    "[1, null, {}]",
    "[" * 50_000,
    '["\\u0000"]',
]


@pytest.mark.parametrize("content", DAMAGED)
def test_what_is_damaged_is_passed_over(content, files):
    for name, read, empty in (
        (RECENT, recent_files, []),
        (REMEDIES, remembered, {}),
    ):
        state_file(name).write_text(content)
        assert read() == empty
    remember(files[0])
    assert recent_files() == [files[0]]


def test_where_nothing_can_be_written_nothing_is_remembered(files, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "file" / "below"))
    remember(files[0])
    assert recent_files() == []


def labels(session):
    files = session.screen.query_one(FileList)
    return [str(files.get_option_at_index(index).prompt) for index in range(files.option_count)]


@pytest.mark.screens
async def test_an_opened_world_is_offered_the_next_time(scenarios, tmp_path):
    folder = tmp_path / "fields"
    folder.mkdir()
    path = folder / "[red]wild[.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened() as session:
        assert labels(session) == ["crates"]
        await session.open(path)
        assert labels(session) == ["crates", "[red]wild[.sdf  fields"]
    async with Opened() as session:
        assert labels(session) == ["crates", "[red]wild[.sdf  fields"]
        await session.press("end")
        assert session.screen.preview.choice.path == path


@pytest.mark.screens
async def test_what_cannot_be_read_and_what_is_bundled_is_not_remembered(scenarios, tmp_path):
    broken = tmp_path / "broken.sdf"
    broken.write_text("<sdf")
    async with Opened() as session:
        await session.open(broken)
        await session.open(scenarios / "crates.yaml")
        assert session.screen.preview.choice.name == "crates"
    assert not state_file(RECENT).exists()
