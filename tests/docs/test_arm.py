"""The arm among shelves, bins and boxes: its hand gets stuck for the reason that its page names,
and it is reduced to that.
"""

import os
import re

import pytest

from ddenv.robot.external.python_simulator import PythonSimulator
from ddenv.runs.experiment import load_parts
from ddenv.world.load import load_scenario
from tests.command import ddenv
from tests.conftest import ROOT

PAGE = ROOT / "docs/any-simulator.md"
SCENARIO = ROOT / "docs/examples/arm/scenario.yaml"
LEFT = frozenset({"bin_1", "carton_1", "shelf_1"})


@pytest.fixture(scope="module")
def simulator():
    scenario = load_scenario(SCENARIO)
    made = PythonSimulator(load_parts(scenario)[0], scenario)
    yield made
    made.close()


def test_the_carton_alone_lets_the_hand_pass_and_the_arm_moves_with_it(simulator):
    run = simulator.run(LEFT - {"bin_1", "shelf_1"}, 1)
    assert run.outcome == "pass"
    assert {"arm::forearm", "carton_1"} <= set(run.motions) and "arm::base" not in run.motions


@pytest.mark.examples
def test_the_arm_is_reduced_to_the_carton_and_what_holds_it(tmp_path):
    environment = os.environ | {"DDENV_HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    done = ddenv("run", SCENARIO, "--output", tmp_path / "run.ddenv", cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    promise = re.findall(r"minimal environment: .*", PAGE.read_text())[-1]
    assert set(promise.split(": ")[-1].split(", ")) == LEFT and promise in done.stdout.splitlines()
