"""What a name stands for, and what stands behind it."""

import os
import shutil
from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import open_experiment, robot_file, scenario_named
from ddenv.runs.folder import BUNDLED_RUN, find_run, named, runs_folder
from ddenv.world.load import SCENARIOS, SDF, load_scenario
from tests.conftest import DATA

NOTHING = dict.fromkeys(("spawn", "goal", "world")) | {
    "model_path": (),
    "stand_in": (),
    "ignore": (),
}


@pytest.fixture
def here(home, tmp_path, monkeypatch):
    """A folder to work in, and the folder of runs."""
    monkeypatch.chdir(tmp_path)
    runs_folder().mkdir(parents=True)
    return tmp_path


def test_a_run_comes_before_a_bundled_scenario_and_a_file_before_both(here):
    assert named("ditch") == ("scenario", SCENARIOS / "ditch.yaml")
    run = runs_folder() / "ditch.ddenv"
    run.touch()
    assert named("ditch") == named(str(run)) == ("run", run)
    for name, kind in (
        ("ditch.yaml", "scenario"),
        ("ditch.YML", "scenario"),
        ("ditch.sdf", "world"),
        ("a.world", "world"),
    ):
        assert named(name)[0] == kind
        (here / name).touch()
        assert named(name)[0] == kind
    run.unlink()
    (here / "ditch").mkdir()
    assert named("ditch") is named("no such thing") is None
    assert named("missing.ddenv")[0] == "run"


def test_a_bundle_is_its_run_but_a_stored_run_of_its_name_comes_first(here):
    run, stored = here / "ditch-1" / BUNDLED_RUN, runs_folder() / "ditch-1.ddenv"
    run.parent.mkdir()
    assert find_run("ditch-1") == stored
    run.touch()
    assert find_run("ditch-1").samefile(run)
    stored.touch()
    assert find_run("ditch-1") == stored
    assert find_run(str(run.parent)) == run


def test_a_run_is_opened_with_its_own_scenario_world_and_robot(here):
    scenario = load_scenario(DATA / "wall.yaml")
    create_run(scenario, runs_folder() / "wall-1.ddenv")
    file, run = (
        open_experiment(str(DATA / "wall.yaml"), NOTHING),
        open_experiment("wall-1", NOTHING),
    )
    assert file.scenario == run.scenario == scenario
    assert file.elements == run.elements == run.state.elements
    assert file.run is file.state is None
    with pytest.raises(UserError, match="a run keeps its own"):
        open_experiment("wall-1", NOTHING | {"goal": (1.0, 2.0)})


def test_the_robot_of_a_run_needs_no_file_of_its_own(here):
    scenario = load_scenario(DATA / "wall.yaml")
    own = here / "robot.sdf"
    shutil.copy(scenario.robot.model, own)
    create_run(
        scenario.model_copy(update={"robot": scenario.robot.model_copy(update={"model": own})}),
        here / "a.ddenv",
    )
    subject, text = open_experiment("a.ddenv", NOTHING), own.read_bytes()
    with robot_file(subject) as file:
        assert file == own
    own.unlink()
    with robot_file(subject) as file:
        assert file != own and file.read_bytes() == text
    assert not file.exists()


@pytest.mark.parametrize("name", ["world.sdf", "scenario.yaml"])
def test_a_path_that_is_not_utf_8_is_refused_in_one_line(tmp_path, name):
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9"))
    folder.mkdir()
    for file in (SDF / "worlds" / "friction.sdf", SCENARIOS / "friction.yaml"):
        (folder / f"{'world' if file.suffix == '.sdf' else 'scenario'}{file.suffix}").write_bytes(
            file.read_bytes()
        )
    with pytest.raises(UserError, match="this path is not UTF-8 text"):
        scenario_named(str(folder / name), NOTHING | {"spawn": (0.0, 0.0, 0.2), "goal": (9.0, 0.0)})
