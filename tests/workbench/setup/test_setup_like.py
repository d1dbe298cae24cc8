"""A run can be made again with other settings, also where the files it came from are gone."""

import shutil
from pathlib import Path

import fake_run
import pytest
from textual.widgets import Input

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_like, create_run
from ddenv.runs.experiment import read_parts
from ddenv.workbench.setup.files import SaveScenario, recent_files, save_scenario, scenario_path
from ddenv.workbench.setup.setup_screen import SetupScreen
from ddenv.world.load import load_scenario
from tests.workbench.setup.setup_session import Opened


@pytest.fixture
def made(scenarios, runs):
    """A run whose scenario's files are gone."""
    path = runs / "crates-1.ddenv"
    create_run(load_scenario(scenarios / "crates.yaml"), path)
    shutil.rmtree(scenarios)
    return path


def scenario_of(path):
    with RunFile(path) as run:
        return read_parts(run)[0]


async def test_it_starts_from_the_run_file_alone(made, runs, started):
    async with Opened(screen=lambda: SetupScreen(like=made)) as session:
        assert session.told("about").startswith("11 models. As in the run crates-1.")
        assert session.value("run_name") == "crates-2"
        assert "save it as a file" in session.told("command")
        session.fill(iterations="9", spawn_y="1")
        await session.press("ctrl+s")
        assert session.wrong_or_run() == "crates-2"
        scenario = scenario_of(runs / "crates-2.ddenv")
        assert (scenario.reduction.iterations, scenario.robot.spawn.y) == (9, 1.0)
        assert started[0][0] == "crates-2.ddenv"


@pytest.mark.screens
async def test_what_is_gone_cannot_be_saved_and_what_is_damaged_not_be_shown(
    made, runs, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    async with Opened(screen=lambda: SetupScreen(like=made)) as session:
        await session.press("f7")
        await session.press("enter")
        assert "no longer exists" in session.refused()
    (runs / "bad.ddenv").write_text("no run")
    async with Opened(screen=lambda: SetupScreen(like=runs / "bad.ddenv")) as session:
        assert "is not a ddenv run file" in session.notice()


@pytest.mark.screens
async def test_what_is_still_there_has_a_command_once_it_is_saved(
    scenarios, runs, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    path = runs / "crates-1.ddenv"
    create_run(load_scenario(scenarios / "crates.yaml"), path)
    async with Opened(screen=lambda: SetupScreen(like=path)) as session:
        await session.press("f7", "enter")
        await session.settle()
        assert session.told("command") == f"$ ddenv run {tmp_path / 'crates.yaml'}"
        await session.filled(iterations="9")
        assert session.told("command").endswith("crates.yaml --iterations 9")


def test_what_does_not_fit_is_refused_before_anything_is_written(made, runs):
    scenario = scenario_of(made)
    spawn = scenario.robot.spawn.model_copy(update={"z": 0.0})
    low = scenario.model_copy(update={"robot": scenario.robot.model_copy(update={"spawn": spawn})})
    with pytest.raises(UserError, match="stands inside"):
        create_like(made, low, runs / "low.ddenv")
    with pytest.raises(UserError, match="no model 'who'"):
        create_like(made, scenario.model_copy(update={"protected": ("who",)}), runs / "low.ddenv")
    assert [path.name for path in runs.glob("*.ddenv")] == ["crates-1.ddenv"]


def test_files_beside_the_world_come_along(runs):
    run = fake_run.FakeRun(runs / "old.ddenv")
    run.file._db.execute("INSERT INTO document VALUES ('resource model://x', ?)", (b"<x/>",))
    run.close()
    create_like(run.path, scenario_of(run.path), runs / "new.ddenv")
    with RunFile(runs / "new.ddenv") as new:
        assert new.documents("resource ") == {"model://x": b"<x/>"}


def same(one, other):
    """Whether two scenarios are the same, however their files are named."""

    def told(scenario):
        data = scenario.model_dump()
        data["world"], data["robot"]["model"] = (
            scenario.world.resolve(),
            scenario.robot.model.resolve(),
        )
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
    for text, words in (
        (" ", "give the name"),
        ("no/such/x", "there is no folder"),
        ("\0", "give the name"),
    ):
        with pytest.raises(UserError, match=words):
            scenario_path(text)


async def test_the_key_asks_for_a_name_and_never_overwrites_unasked(
    scenarios, tmp_path, monkeypatch
):
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
        assert "exists already" in session.refused()
        assert taken.read_text() == "mine\n"
        await session.press("enter")
        await session.pilot.pause()
        assert session.app.screen is session.screen
        await session.settle()
        saved = load_scenario(taken)
        assert (saved.reduction.iterations, saved.goal.y) == (8, 1.5)
        assert same(saved, session.screen._asked()[1])
    assert recent_files() == [taken]
