"""Runs of Drake's model directives: what is welded stays or goes together, and what is left is a
file of directives again.
"""

import shutil

import pytest

from ddenv.errors import UserError
from ddenv.guiding.commands import Context, Try
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runfile.supports import stack_with, stacks_of
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import load_parts, read_parts, scenario_for_world
from ddenv.runs.export import export_world
from ddenv.runs.folder import named_file
from ddenv.world.load import load_scenario
from tests.runs.test_export import _reduce, box

HALL = """# A hall.
directives:
- add_model: {name: table, file: box.sdf}
- add_weld: {parent: world, child: table::l, X_PC: {translation: [5, 5, 0]}}
- add_model: {name: lamp, file: box.sdf}
- add_weld: {parent: table::l, child: lamp::l, X_PC: {translation: [0, 0, 1]}}  # on it
- add_model: {name: chair, file: box.sdf}
- add_weld: {parent: world, child: chair::l, X_PC: {translation: [-5, 5, 0]}}
"""


@pytest.fixture
def hall(tmp_path):
    folder = tmp_path / "hall"
    folder.mkdir()
    text = box("box", 0).replace("<static>1</static>", "")
    (folder / "box.sdf").write_text(f"<sdf version='1.9'>{text}</sdf>")
    (folder / "hall.dmd.yaml").write_text(HALL)
    return folder / "hall.dmd.yaml"


def run_of(world, protected=()):
    scenario = scenario_for_world(world, (0, 0, 0.2, 0), (6, 0)).model_copy(
        update={"protected": protected}
    )
    run = world.parent.with_name("run.ddenv")
    create_run(scenario, run)
    return run


def test_what_is_welded_stays_or_goes_together(hall):
    with RunFile(run_of(hall)) as run:
        state = fold(run.events())
    assert stacks_of(state, state.environment) == (("table", "lamp"), ("chair",))
    assert stack_with(state, state.environment, "table") == ("table", "lamp")


def test_what_is_welded_to_a_model_that_stays_is_free(hall):
    with RunFile(run_of(hall, ("table",))) as run:
        state = fold(run.events())
    assert stacks_of(state, state.environment) == (("lamp",), ("chair",))


def test_a_selection_by_hand_does_not_part_what_is_welded(hall):
    run = run_of(hall)
    _reduce(run, ["table", "lamp"])
    with RunFile(run) as file:
        now = Context(fold(file.events()))
    assert "lamp is welded to table" in Try((1,)).refusal(now)
    assert "welded" not in Try((0, 2)).refusal(now)


def test_what_is_left_is_directives_again_and_the_run_file_needs_no_other_file(hall, tmp_path):
    run = run_of(hall)
    _reduce(run, ["table", "lamp"])
    target = tmp_path / "out"
    shutil.move(hall.parent, target)
    with RunFile(run) as file:
        assert [model.name for model in read_parts(file)[1].models] == ["table", "lamp", "chair"]
    shutil.copytree(target, hall.parent)
    with pytest.raises(UserError, match=r"minimal\.sdf: .*\.dmd\.yaml"):
        export_world(run, target / "minimal.sdf", None)
    assert export_world(run, target / "minimal.dmd.yaml", target / "minimal.yaml").needs == [
        "box.sdf"
    ]
    assert (target / "minimal.dmd.yaml").read_text() == "\n".join(HALL.splitlines()[:6]) + "\n"
    world, _ = load_parts(load_scenario(target / "minimal.yaml"))
    assert [(model.name, model.links[0].pose.position) for model in world.models] == [
        ("table", (5, 5, 0)),
        ("lamp", (5, 5, 1)),
    ]


def test_directives_are_worlds_on_the_command_line(hall, command):
    assert named_file(str(hall)) == ("world", hall)
    said = command("world", "check", hall)
    assert (
        said.returncode,
        "3 can be removed; welded, so they are removed together: lamp to table;" in said.stdout,
    ) == (
        0,
        True,
    )
    hall.write_text(HALL.replace("lamp::l", "lamp::k"))
    said = command("run", hall, "--spawn", "0,0,0.2,0", "--goal", "6,0", "--output", hall.parent)
    assert (said.returncode, said.stderr) == (
        2,
        f"ddenv: {hall}:6: there is no frame 'lamp::k' here (did you mean lamp::l?)\n",
    )
    assert {path.name for path in hall.parent.iterdir()} == {"hall.dmd.yaml", "box.sdf"}
