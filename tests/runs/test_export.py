"""What a run has left, as files: they can be moved, and say what else they need."""

import shutil
import subprocess
import sys

import pytest
import yaml

from ddenv.robot.piles import pile_simulator
from ddenv.robot.simulation.plant_cache import PlantCache
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import (
    load_parts,
    read_parts,
    reading_of,
    scenario_for_world,
    with_options,
)
from ddenv.runs.export import export_world
from ddenv.world.load import load_scenario
from ddenv.world.scenario import PLAIN
from tests.conftest import ROOT
from tests.shorthand import Writing
from tests.tiers import slow
from tests.waiting import PATIENCE

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def box(name, x):
    return (
        f"<model name='{name}'><static>1</static><pose>{x} 5 0 0 0 0</pose><link "
        "name='l'><collision name='c'>"
        f"<geometry><box><size>1 1 1</size></box></geometry></collision></link></model>"
    )


def mesh(name, uri, x):
    return box(name, x).replace("<box><size>1 1 1</size></box>", f"<mesh><uri>{uri}</uri></mesh>")


@pytest.fixture
def folder(tmp_path):
    """Where the exported files go: away from the world."""
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def run_of(tmp_path, models, keep=None, protected=(), reading=PLAIN, robot=None):
    """A run of a world with these models, of which it has `keep` left, by name."""
    world = tmp_path / "world" / "w.sdf"
    world.parent.mkdir(exist_ok=True)
    world.write_text(f"<sdf version='1.9'><world name='w'>{''.join(models)}</world></sdf>")
    scenario = with_options(scenario_for_world(world, (0, 0, 0.2, 0), (6, 0)), reading=reading)
    scenario = scenario.model_copy(update={"protected": tuple(protected)})
    if robot is not None:
        scenario = scenario.model_copy(
            update={"robot": scenario.robot.model_copy(update={"model": robot})}
        )
    run = tmp_path / "run.ddenv"
    create_run(scenario, run)
    if keep is not None:
        _reduce(run, list(keep))
    return run


def _reduce(run, keep):
    """One round, in which the first partition shows the failure."""
    with RunFile(run) as file:
        file.own()
        names = file.events()[0].event.elements
        keep, everything = [names.index(name) for name in keep], list(range(len(names)))
        parts = [keep, [number for number in everything if number not in keep]]
        writing, split = (
            Writing(file),
            {"partitions": parts, "candidates": [["partition", 0, None]]},
        )
        writing.write(
            "round_started", {"round": 1, "n_partitions": 2, "environment": everything} | split
        )
        writing.write("reduced", {"candidate": 0, "environment": keep, "evidence_test": 1})


def exported(run, folder, sdf="m.sdf"):
    """The scenario that is written, as data."""
    export_world(run, folder / sdf, folder / "m.yaml")
    return yaml.safe_load((folder / "m.yaml").read_text())


def test_files_beside_the_scenario_or_below_are_named_relative_to_it(tmp_path, folder):
    (folder / "worlds").mkdir()
    (folder / "models").mkdir()
    away = tmp_path / "away"
    away.mkdir()
    run = run_of(
        tmp_path,
        [box("a", 5), box("b", 7)],
        reading=reading_of(model_path=[folder / "models", away]),
    )
    told = exported(run, folder, "worlds/m.sdf")
    assert told["world"] == "worlds/m.sdf"
    assert told["robot"]["model"] == "m.robot.sdf"
    assert told["reading"]["model_path"] == ["models", str(away)]
    shutil.move(folder, tmp_path / "moved")
    world, _ = load_parts(load_scenario(tmp_path / "moved" / "m.yaml"))
    assert world.elements() == ("a", "b")


def test_a_world_elsewhere_is_named_by_its_whole_path(tmp_path, folder, monkeypatch):
    run = run_of(tmp_path, [box("a", 5)])
    monkeypatch.chdir(folder)
    (tmp_path / "other").mkdir()
    assert exported(run, folder, tmp_path / "other" / "m.sdf")["world"] == str(
        tmp_path / "other" / "m.sdf"
    )


@pytest.mark.parametrize(
    ("uri", "needed"),
    [
        ("rock.obj", True),
        ("file://rock.obj", True),
        ("model://rocks/rock.obj", True),
        ("model://stones/rock.obj", False),
    ],
)
def test_the_original_folder_is_searched_only_for_what_lies_there(tmp_path, folder, uri, needed):
    rocks = tmp_path / "world" / "rocks"
    stones = tmp_path / "models" / "stones"
    for place in (rocks, stones):
        place.mkdir(parents=True)
        (place / "rock.obj").write_text(TETRAHEDRON)
    (tmp_path / "world" / "rock.obj").write_text(TETRAHEDRON)
    reading = reading_of(model_path=[tmp_path / "models"])
    run = run_of(tmp_path, [mesh("rock", uri, 5), box("a", 8)], reading=reading)
    assert (str(tmp_path / "world") in exported(run, folder)["reading"]["model_path"]) is needed
    assert load_parts(load_scenario(folder / "m.yaml"))[0].elements() == ("rock", "a")


def test_a_folder_is_not_searched_for_what_was_removed(tmp_path, folder):
    (tmp_path / "world").mkdir()
    (tmp_path / "world" / "rock.obj").write_text(TETRAHEDRON)
    run = run_of(tmp_path, [mesh("rock", "rock.obj", 5), box("a", 8)], keep=["a"])
    assert exported(run, folder)["reading"]["model_path"] == []
    assert export_world(run, folder / "m.sdf", None).needs == []


def test_the_robots_folder_is_searched_for_what_it_names_there(tmp_path, folder):
    from ddenv.world.load import SDF

    text = (SDF / "robots" / "husky.sdf").read_text()
    start, end = text.index("<geometry>"), text.index("</geometry>")
    robot = tmp_path / "robots" / "r.sdf"
    robot.parent.mkdir()
    robot.write_text(f"{text[:start]}<geometry><mesh><uri>body.obj</uri></mesh>{text[end:]}")
    (robot.parent / "body.obj").write_text(TETRAHEDRON)
    run = run_of(tmp_path, [box("a", 5)], robot=robot)
    assert exported(run, folder)["reading"]["model_path"] == [str(robot.parent)]
    load_parts(load_scenario(folder / "m.yaml"))


def test_a_urdf_stays_one_and_its_package_is_found(tmp_path, folder):
    robot = tmp_path / "ws" / "cart" / "urdf" / "cart.urdf"
    (robot.parents[1] / "meshes").mkdir(parents=True)
    (robot.parents[1] / "meshes" / "body.obj").write_text(TETRAHEDRON)
    robot.parent.mkdir()
    text = (ROOT / "docs" / "examples" / "own_robot" / "cart.urdf").read_text()
    uri = "package://cart/meshes/body.obj"
    robot.write_text(
        text.replace(
            '<box size="0.36 0.26 0.10"/>', f'<mesh filename="{uri}" scale="0.1 0.1 0.1"/>'
        )
    )
    run = run_of(tmp_path, [box("a", 5)], robot=robot)
    told = exported(run, folder)
    assert (told["robot"]["model"], told["reading"]["model_path"]) == (
        "m.robot.urdf",
        [str(robot.parents[1])],
    )
    load_parts(load_scenario(folder / "m.yaml"))


def test_the_scenarios_folder_is_named_where_a_program_of_its_own_lies_there(tmp_path, folder):
    own = ROOT / "docs" / "examples" / "own_robot"
    create_run(load_scenario(own / "scenario.yaml"), tmp_path / "own.ddenv")
    assert exported(tmp_path / "own.ddenv", folder)["folder"] == str(own)
    assert load_scenario(folder / "m.yaml").folder == own
    assert "folder" not in exported(run_of(tmp_path, [box("a", 5)]), folder)


def test_what_the_kept_models_name_is_still_needed(tmp_path, folder):
    rocks = tmp_path / "models" / "rocks"
    rocks.mkdir(parents=True)
    for name in "abc":
        (rocks / f"{name}.obj").write_text(TETRAHEDRON)
    uris = [f"model://rocks/{name}.obj" for name in "abc"]
    models = [mesh(uri[-5], uri, 5 + 3 * number) for number, uri in enumerate(uris)]
    run = run_of(
        tmp_path, models, keep=["a", "c"], reading=reading_of(model_path=[tmp_path / "models"])
    )
    assert export_world(run, folder / "m.sdf", None).needs == [uris[0], uris[2]]


def test_protected_models_are_called_as_they_are_in_the_exported_world(tmp_path, folder):
    models = [box("box", 5), box("box", 8), box("post", 11), box("box", 14), box("crate", 17)]
    run = run_of(tmp_path, models, keep=["crate"], protected=["box #3", "post"])
    assert exported(run, folder)["protected"] == ["box", "post"]
    world, _ = load_parts(load_scenario(folder / "m.yaml"))
    assert {model.name: model.pose.position[0] for model in world.models} == {
        "post": 11,
        "box": 14,
        "crate": 17,
    }


GROUND = (
    box("ground", 0)
    .replace("<box><size>1 1 1</size></box>", "<plane><normal>0 0 1</normal></plane>")
    .replace("5 0", "0 0")
)
TABLE = box("table", 0).replace("0 5 0", "0 0 -0.5").replace("1 1 1", "3 3 1")
SLOPE = box("slope", 0).replace("0 5 0 0 0", "-2 4 0 0 0.2")


def ball(name, x):
    """It rolls down the slope, and away for good."""
    round = (
        box(name, x)
        .replace("5 0 0", "4 0.9 0")
        .replace("<box><size>1 1 1</size></box>", "<sphere><radius>0.2</radius></sphere>")
    )
    return round.replace("<static>1</static>", "")


# The models, and those of them that are left.
PARTS = {
    "a far one is gone": (
        [GROUND, box("post", 2).replace("2 5", "2 0.6"), box("far", 300)],
        ["post"],
    ),
    "a low one is gone": ([TABLE, box("low", 0).replace("5 0", "0 -9")], ["table"]),
    "another one that moves is gone": (
        [GROUND, SLOPE, ball("ball", -2), ball("other", 30)],
        ["slope", "ball"],
    ),
}


@pytest.mark.parametrize("parts", slow(pytest.mark.rates, PARTS, but=["a far one is gone"]))
def test_the_robot_does_the_same_in_what_was_written_as_in_the_reduction(
    tmp_path, folder, monkeypatch, parts
):
    models, keep = PARTS[parts]
    # How a ball rolls is found out for so long, shared by all of them.
    monkeypatch.setattr(pile_simulator, "BUDGET", 5.0)
    run = run_of(tmp_path, models, keep=keep)
    export_world(run, folder / "m.sdf", folder / "m.yaml")
    with RunFile(run) as file:
        scenario, *parts = read_parts(file)
    there = load_scenario(folder / "m.yaml")
    one = PlantCache(*parts, scenario).run(frozenset(keep), seed=1)
    two = PlantCache(*load_parts(there), there).run(frozenset(keep), seed=1)
    assert (one.failure, one.trajectory.tobytes()) == (two.failure, two.trajectory.tobytes())
    assert {name: rows.tobytes() for name, rows in one.motions.items()} == {
        name: rows.tobytes() for name, rows in two.motions.items()
    }
    assert ("ball" in keep) == bool(one.motions)


def test_the_command_line_says_what_is_still_needed(tmp_path, folder):
    for name in "abcde":
        (tmp_path / f"{name}.obj").write_text(TETRAHEDRON)
    models = [
        mesh(name, tmp_path / f"{name}.obj", 5 + 3 * number) for number, name in enumerate("abcde")
    ]
    words = [
        sys.executable,
        "-m",
        "ddenv",
        "export",
        run_of(tmp_path, models),
        "--sdf",
        folder / "m.sdf",
    ]
    done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
    assert done.stdout == f"wrote {folder / 'm.sdf'}\n"
    # It was stopped before its baseline was done.
    needs, known = done.stderr.splitlines()
    assert (
        known == "no failure is known yet: this is the whole world; 'ddenv resume RUN' reduces it"
    )
    assert needs.startswith(f"{folder / 'm.sdf'} still needs ")
    assert needs.endswith("c.obj and 2 more")
