"""The example of docs/any-simulator.md works as the page says, and the page says what is true."""

import json
import re
import shutil
import subprocess
import sys

import pytest
import yaml

from ddenv.robot.external.python_simulator import PythonSimulator
from ddenv.robot.external.simulator import COLUMNS, EXPECTED, TOO_LARGE, ExternalSimulator, PoseLog
from ddenv.robot.external.supervise import GRACE
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import load_parts
from ddenv.world.command import PLACEHOLDERS
from ddenv.world.load import load_scenario
from ddenv.world.scenario import Oracle
from tests.command import ddenv
from tests.conftest import ROOT

PAGE = (ROOT / "docs/any-simulator.md").read_text()
BLOCKS = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
SCENARIO = ROOT / "docs/examples/any_simulator/scenario.yaml"


@pytest.fixture(scope="session")
def reduced(made_once):
    """The run file of the example, and what the command printed."""
    command, _ = re.findall(r"\$ ddenv (run .*)", PAGE)

    def make(folder):
        done = ddenv(*command.split(), "--output", folder / "run.ddenv", cwd=ROOT)
        assert done.returncode == 0, done.stderr
        (folder / "printed").write_text(done.stdout)

    folder = made_once("example", make)
    return folder / "run.ddenv", (folder / "printed").read_text()


@pytest.mark.examples
def test_the_command_of_the_page_reduces_the_example_as_the_page_says(reduced):
    promise, _ = re.findall(r"minimal environment: .*", PAGE)
    assert promise in reduced[1].splitlines()


@pytest.mark.examples
def test_another_simulator_is_told_from_the_one_of_the_run(reduced, tmp_path):
    """A robot that drives where nothing stands in its way reaches its goal, so that nothing fails
    there.
    """
    drive = SCENARIO.with_name("drive.py").read_text()
    (tmp_path / "drive.py").write_text(drive)
    (tmp_path / "open.py").write_text(drive.replace("obstacles(world)\n    print", "[]\n    print"))
    said = {}
    for name in ("drive.py", "open.py"):
        (tmp_path / name).chmod(0o755)
        (tmp_path / "simulator.yaml").write_text(
            f"name: {name}\ncommand: ./{name} {{world}} {{seed}}\n"
        )
        words = [
            "--minimal",
            "--leave-each-out",
            "--repeat",
            8,
            "--json",
            "--simulator",
            "simulator.yaml",
        ]
        found = json.loads(ddenv("test", reduced[0], *words, cwd=tmp_path).stdout)["elsewhere"]
        said[name] = [(each["without"], each["fails"]) for each in found]
    assert said["drive.py"] == [(None, True), ("shelf_left", False), ("shelf_right", False)]
    assert said["open.py"] == [(None, False), ("shelf_left", None), ("shelf_right", None)]


@pytest.mark.examples
def test_a_test_for_pytest_fails_as_long_as_the_robot_fails(reduced, tmp_path):
    done = ddenv("export", reduced[0], "--pytest", tmp_path, cwd=tmp_path)
    assert done.stdout.splitlines() == [
        f"wrote {tmp_path / 'test_run.py'}",
        f"wrote {tmp_path / 'run.ddenv'}",
    ]
    test = tmp_path / "test_run.py"
    pytest_ = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:ddenv",
        "-p",
        "ddenv.engine.pytest_plugin",
        "-c",
        "/dev/null",
        test,
    ]
    said = subprocess.run(pytest_, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.returncode == 1 and "it still fails, at " in said.stdout, said.stdout
    test.write_text(test.read_text().replace("is False", "is True"))
    assert subprocess.run(pytest_, cwd=tmp_path, capture_output=True, check=False).returncode == 0


@pytest.mark.examples
def test_the_same_seed_gives_the_same_run(tmp_path):
    done = ddenv("test", SCENARIO, "--seed", 3, "--repeat", 2, "--json", cwd=tmp_path)
    again = ddenv("test", SCENARIO, "--seed", 3, "--json", cwd=tmp_path)
    one, other = json.loads(done.stdout)["runs"]
    assert json.loads(again.stdout)["runs"][0]["end_pose"] == one["end_pose"] != other["end_pose"]


def test_the_class_of_the_page_runs_as_the_command_does():
    (shown,) = re.findall(r"```python\n(class .*?)```", PAGE, re.DOTALL)
    assert SCENARIO.with_name("corner.py").read_text().endswith(shown)
    scenario = load_scenario(SCENARIO)
    in_python = scenario.model_copy(
        update={"oracle": Oracle(**yaml.safe_load(BLOCKS[1])["oracle"])}
    )
    world, _ = load_parts(scenario)
    one, other = ExternalSimulator(world, scenario), PythonSimulator(world, in_python)
    try:
        for left in (world.elements(), ("shelf_left",)):
            first, second = (each.run(frozenset(left), 3) for each in (one, other))
            # The log of the command is rounded.
            assert (first.outcome, first.failure) == (second.outcome, second.failure)
            assert first.trajectory[:, :4] == pytest.approx(second.trajectory[:, :4], abs=1e-3)
            assert second.took_part <= frozenset(left)
    finally:
        other.close()


@pytest.mark.examples
def test_what_the_class_says_took_part_is_used_and_a_lie_is_found(tmp_path):
    code = SCENARIO.with_name("corner.py").read_text()
    for name, took_part in (("true", "touched"), ("lie", 'touched - {"shelf_right"}')):
        folder = tmp_path / name
        shutil.copytree(SCENARIO.parent, folder)
        (folder / "corner.py").write_text(
            code.replace("took_part=touched", f"took_part={took_part}")
        )
        text = SCENARIO.read_text().replace(*(block.strip() for block in BLOCKS[:2]))
        (folder / "scenario.yaml").write_text(text)
        done = ddenv("run", "scenario.yaml", "--output", "run.ddenv", cwd=folder)
        assert done.returncode == 0, done.stderr
        with RunFile(folder / "run.ddenv") as run:
            state = fold(run.events())
        assert set(state.environment) == {"shelf_left", "shelf_right"}, name
        assert (state.refuted is not None) == (name == "lie")
        assert name == "lie" or any(node.sliced_by for node in state.nodes)


def test_the_page_shows_the_scenario_the_placeholders_and_the_variables(monkeypatch):
    monkeypatch.delenv("DDENV_HOME", raising=False)
    assert yaml.safe_load(BLOCKS[0])["oracle"] == yaml.safe_load(SCENARIO.read_text())["oracle"]
    assert re.findall(r"^\| `\{(\w+)\}`", PAGE, re.MULTILINE) == list(PLACEHOLDERS)
    scenario = load_scenario(SCENARIO)
    simulator = ExternalSimulator(load_parts(scenario)[0], scenario)
    told = set(simulator._environment(dict.fromkeys(PLACEHOLDERS, "")))
    shown = set(re.findall(r"`(DDENV_\w+|\w+_PATH)`", PAGE))
    assert shown == {name for name in told if name.startswith("DDENV_") or name in shown}
    assert f"SIGTERM) and killed {GRACE:g} s later" in PAGE


def test_the_log_and_the_complaints_of_the_page_are_those_of_the_program():
    (block,) = re.findall(r"    t,x,y.*?\n\n", PAGE, re.DOTALL)
    log = PoseLog()
    log.add("".join(line.strip() + "\n" for line in block.splitlines()).encode())
    assert log.finish()[:, 0].tolist() == [0, 0.1]
    assert ",".join(COLUMNS) in block
    assert EXPECTED in PAGE and TOO_LARGE in PAGE
