"""`ddenv run --inside`, on a world and on what a run has left, and its key in the workbench."""

import json
import shutil

import pytest

from ddenv.workbench.run.run_screen import RunScreen
from ddenv.world.sdf.read import read_world
from tests.command import ddenv, is_one_line
from tests.workbench import fake_moments
from tests.workbench.attached import Attached

GROUND = (
    "<model name='ground'><static>true</static><link name='l'><collision "
    "name='c'><geometry><plane><normal>0 0 1</normal>"
    "<size>50 50</size></plane></geometry></collision></link></model>"
)
PLACES = ("--spawn", "0,0,0.15,0", "--goal", "6,0", "--timeout", "12")


def box(name, x, y):
    return (
        f"<collision name='{name}'><pose>{x} {y} 0.4 0 0 0</pose><geometry><box><size>0.4 0.3 "
        "0.8</size></box></geometry>"
        "</collision>"
    )


def written(path, shapes, more=""):
    yard = f"<model name='yard'><static>true</static><link name='l'>{shapes}</link></model>"
    path.write_text(f"<sdf version='1.9'><world name='w'>{GROUND}{yard}{more}</world></sdf>")
    return path


@pytest.mark.slow
def test_what_a_run_has_left_is_reduced_inside_to_the_part_that_stops_the_robot(tmp_path):
    """A post in the robot's way, in one model with others, which another file holds, beside a
    crate.
    """
    others = "".join(box(f"far_{number}", 1 + number, 3) for number in range(4))
    crate = (
        f"<model name='crate'><static>true</static><link name='l'>{box('c', 2, -3)}</link></model>"
    )
    yard = (
        "<model name='m'><static>true</static><link "
        f"name='l'>{box('post', 0, 0) + others}</link></model>"
    )
    (tmp_path / "yard").mkdir()
    (tmp_path / "yard" / "model.sdf").write_text(f"<sdf version='1.6'>{yard}</sdf>")
    included = (
        "<include><name>yard</name><pose>2 0 0 0 0 0</pose><uri>yard/model.sdf</uri></include>"
    )
    world = tmp_path / "world.sdf"
    world.write_text(f"<sdf version='1.9'><world name='w'>{GROUND}{crate}{included}</world></sdf>")
    assert ddenv("run", world, *PLACES, "--output", tmp_path / "whole.ddenv").returncode == 0
    shutil.rmtree(tmp_path / "yard")
    minimal = tmp_path / "minimal.sdf"
    done = ddenv(
        "run", tmp_path / "whole.ddenv", "--inside", "--output", tmp_path / "inside.ddenv", "--json"
    )
    assert json.loads(done.stdout)["kept"] == ["yard/post"]
    scenario = tmp_path / "minimal.yaml"
    assert (
        ddenv(
            "export", tmp_path / "inside.ddenv", "--output", minimal, "--scenario", scenario
        ).returncode
        == 0
    )
    assert [len(model.collisions) for model in read_world(minimal).models] == [1, 1]
    runs = ddenv("test", scenario, "--repeat", 2, "--json")
    assert {each["outcome"] for each in json.loads(runs.stdout)["runs"]} == {"failed"}, runs.stdout
    is_one_line(ddenv("run", tmp_path / "inside.ddenv", "--inside"), "inside models already")


def test_a_world_without_models_that_have_parts_is_refused_in_one_line(tmp_path, command):
    world = written(tmp_path / "yard.sdf", box("only", 2, 0))
    done = command("run", world, *PLACES, "--inside", "--output", tmp_path / "run.ddenv")
    is_one_line(done, "no model has parts that can be removed")
    assert not (tmp_path / "run.ddenv").exists()


def test_inside_a_run_other_options_are_refused_and_not_ignored(run, command):
    fake_moments.finished(run)
    for option in (
        ("--seed", "5"),
        ("--cluster", "tcp://there:8786"),
        ("--exact",),
        ("--spawn", "0,0,0.2,0"),
    ):
        is_one_line(command("run", run.path, "--inside", *option), "a run keeps its own options")


async def test_a_key_begins_a_run_inside_what_is_left(run, home):
    """The models of the world are single boxes: that is said in the line of messages, and no file
    is written.
    """
    fake_moments.finished(run)
    async with Attached(run) as session:
        await session.press("I")
        await session.app.workers.wait_for_complete()
        await session.look()
        assert "no model has parts that can be removed" in session.said()
        assert isinstance(session.app.screen, RunScreen)
        assert not list(home.glob("**/*-inside*"))
