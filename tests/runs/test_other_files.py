"""Worlds that name other files: a run keeps what it needs of them."""

import pytest

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import (
    load_parts,
    read_parts,
    reading_of,
    scenario_for_world,
    scenario_named,
    with_options,
)
from ddenv.runs.export import export_world
from ddenv.world.load import load_scenario
from ddenv.world.model import Cylinder, Mesh
from tests.runs.test_export import TETRAHEDRON

GROUND = (
    "<model name='ground'><static>1</static><link name='l'><collision "
    "name='c'><geometry><plane/></geometry></collision>"
    "</link></model>"
)
ROCK = (
    "<sdf version='1.7'><model name='rock'><static>1</static><link name='l'><collision "
    "name='c'><geometry><mesh>"
    "<uri>model://rock/rock.obj</uri></mesh></geometry></collision></link></model></sdf>"
)


@pytest.fixture
def world(tmp_path):
    """A world with an included rock, whose shape is in a third file, and a barrel that is
    nowhere.
    """
    folder = tmp_path / "models" / "rock"
    folder.mkdir(parents=True)
    (folder / "rock.obj").write_text(TETRAHEDRON)
    (folder / "model.sdf").write_text(ROCK)
    rock = "<include><uri>model://rock</uri><pose>5 5 0 0 0 0</pose></include>"
    barrel = (
        "<include><uri>model://barrel</uri><name>barrel</name><pose>3 0 0 0 0 0</pose></include>"
    )
    path = tmp_path / "world.sdf"
    path.write_text(
        f"<sdf version='1.9'>\n<world name='w'>\n{GROUND}\n{rock}\n{barrel}\n</world></sdf>"
    )
    return path


def scenario_of(world, **reading):
    chosen = reading_of(
        model_path=[world.parent / "models"], stand_in=["model://barrel=cylinder:0.3,1"], **reading
    )
    return with_options(scenario_for_world(world, (0, 0, 0.14, 0), (6, 0)), reading=chosen)


def test_a_run_needs_no_other_file_than_its_own(world, tmp_path):
    run = tmp_path / "run.ddenv"
    create_run(scenario_of(world), run)
    (world.parent / "models" / "rock" / "rock.obj").unlink()
    (world.parent / "models" / "rock" / "model.sdf").unlink()
    with RunFile(run) as file:
        _, again, _ = read_parts(file)
    assert again.elements() == ("rock", "barrel")
    assert isinstance(again.model("rock").collisions[0].shape, Mesh)
    assert again.model("barrel").collisions[0].shape == Cylinder(0.3, 1)


def test_the_exported_scenario_finds_the_files_again(world, tmp_path):
    run, out = tmp_path / "run.ddenv", tmp_path / "elsewhere"
    create_run(scenario_of(world), run)
    out.mkdir()
    export_world(run, out / "small.sdf", out / "small.yaml")
    assert (out / "small.sdf").read_bytes() == world.read_bytes()
    again, _ = load_parts(load_scenario(out / "small.yaml"))
    assert again.elements() == ("rock", "barrel")


def test_folders_and_stand_ins_of_a_scenario_come_after_those_of_the_command_line(world, tmp_path):
    scenario = scenario_of(world)
    other = tmp_path / "other"
    other.mkdir()
    more = reading_of(
        scenario.reading, model_path=[other], stand_in=["model://barrel=sphere:1"], ignore=["mesh"]
    )
    assert more.model_path == (other, tmp_path / "models")
    assert more.stand_ins == {"model://barrel": "sphere:1"}
    assert more.ignore == ("mesh",)
    assert reading_of(more, stand_in=["auto", "model://x=none"]).stand_ins == more.stand_ins | {
        "*": "auto",
        "model://x": "none",
    }


WRONG = {
    "no folder": ({"model_path": ["nowhere"]}, "--model-path: there is no folder nowhere"),
    "no shape": ({"stand_in": ["model://x"]}, "--stand-in: expected URI=SHAPE"),
    "unknown shape": (
        {"stand_in": ["model://x=cone:1,2"]},
        "'cone:1,2' is not a stand-in; use box:x,y,z",
    ),
    "too few sizes": (
        {"stand_in": ["model://x=cylinder:1"]},
        "expected radius,length in m, found '1'",
    ),
    "a shape for everything": (
        {"stand_in": ["*=sphere:1"]},
        "only auto can stand for all that is missing",
    ),
    "no size": ({"stand_in": ["model://x=sphere:0"]}, "sizes must be positive"),
    "not finite": ({"stand_in": ["model://x=sphere:nan"]}, "expected radius in m"),
    "no centre": ({"stand_in": ["model://x=sphere:1@2"]}, "expected x,y,z in m, found '2'"),
}


@pytest.mark.parametrize(("options", "words"), WRONG.values(), ids=WRONG.keys())
def test_wrong_options_get_one_line(options, words):
    from pathlib import Path

    options = options | {"model_path": [Path(each) for each in options.get("model_path", [])]}
    with pytest.raises(UserError, match=words):
        reading_of(**options)


def test_a_wrong_stand_in_in_a_scenario_is_told_with_its_uri(world, tmp_path):
    scenario = scenario_of(world)
    reading = scenario.reading.model_copy(update={"stand_ins": {"model://barrel": "tube:1"}})
    with pytest.raises(
        UserError, match="stand-in for 'model://barrel': 'tube:1' is not a stand-in"
    ):
        create_run(with_options(scenario, reading=reading), tmp_path / "run.ddenv")


def test_a_guess_is_left_out_where_the_robot_starts(tmp_path):
    def include(name, x):
        return (
            f"<include><uri>model://{name}</uri><name>{name}</name><pose>{x} 0 0 0 0 "
            "0</pose></include>"
        )

    path, said = tmp_path / "world.sdf", []
    models = include("hall", 0) + include("crate", 4) + include("wagon", 0.3)
    path.write_text(f"<sdf version='1.9'><world name='w'>{GROUND}{models}</world></sdf>")
    given = {"stand_in": ["auto"], "spawn": (0, 0, 0.2, 0), "goal": (9, 0), "world": None}
    scenario = scenario_named(str(path), given, said.append)
    world, _ = load_parts(scenario)
    assert [model.name for model in world.models] == ["ground", "crate"]
    assert said == [
        "the robot would start inside a guess, so this is left out: model://hall, model://wagon"
    ]
    run = tmp_path / "run.ddenv"
    create_run(scenario, run)
    with RunFile(run) as file:
        assert read_parts(file)[1].elements() == ("crate",)
