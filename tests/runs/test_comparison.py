"""In what two scenarios, or a scenario and a run, differ."""

import json
import shutil

from ddenv.runs.creation import create_run
from ddenv.runs.folder import runs_folder
from ddenv.world.load import load_scenario
from tests.command import in_process
from tests.conftest import DATA


def test_settings_and_models_that_differ_are_listed_and_nothing_else(
    home, tmp_path, monkeypatch, capsys
):
    runs_folder().mkdir(parents=True)
    create_run(load_scenario(DATA / "wall.yaml"), runs_folder() / "wall-1.ddenv")
    text = (
        (DATA / "wall.yaml")
        .read_text()
        .replace("../../sdf", str(DATA.parents[1] / "sdf"))
        .replace("iterations: 1", "iterations: 4")
    )
    (tmp_path / "moved.yaml").write_text(text)
    world = (DATA / "wall.sdf").read_text()
    (tmp_path / "wall.sdf").write_text(world.replace("<pose>-3 4 ", "<pose>-3 5 "))

    said = in_process(monkeypatch, capsys, "diff", "wall-1", tmp_path / "moved.yaml", "--json")
    rows = {
        row["what"]: (row["first"], row["second"]) for row in json.loads(said.stdout)["differences"]
    }
    assert rows.keys() == {"run", "reduction.iterations", "far_box"}
    assert rows["reduction.iterations"] == ("1", "4")
    one, other = rows["far_box"]
    assert one != other and one.split(",")[-1] == other.split(",")[-1] == " static"

    shutil.copy(tmp_path / "moved.yaml", tmp_path / "same.yaml")
    said = in_process(monkeypatch, capsys, "diff", tmp_path / "moved.yaml", tmp_path / "same.yaml")
    assert [line.split() for line in said.stdout.splitlines()] == [["run", "moved", "|", "same"]]
