"""Scenarios: an error names file, key, value and what is allowed."""

import pytest
import yaml

from ddenv.errors import UserError
from ddenv.world.load import bundled_names, find_scenario, load_scenario
from tests.conftest import DATA

GOOD = yaml.safe_load((DATA / "wall.yaml").read_text())


def test_every_bundled_scenario_loads():
    assert "ditch" in bundled_names()
    for name in bundled_names():
        scenario = load_scenario(find_scenario(name))
        assert scenario.world.is_file()
        assert scenario.robot.model.is_file()


WRONG = {
    "goall: {}": r"goall: unknown key \(did you mean goal\?\); allowed are",
    "reduction: {iteration: 3}": r"reduction.iteration: unknown key \(did you mean iterations\?\)",
    "reduction: {pair: model2model/falure-proximal}": r"did you mean model2model/failure-proximal\?\); use one of",
    "reduction: {iterations: -1}": "reduction.iterations: should be greater than or equal to 0, found -1",
    "failure: {timeout: 0}": "failure.timeout: should be greater than or equal to 0.01, found 0",
    "failure: {timeout: .inf}": "failure.timeout: should be a finite number",
    "goal: {x: far, y: 0}": "goal.x: .*found 'far'",
    "goal: {x: 1}": "goal.y: is missing",
    "controller: {use: timid}": "controller.use: expected straight, costmap or module:Class, found 'timid'",
    "protected: deck": "protected: should be a list, found 'deck'",
    "oracle: {command: ''}": "oracle.command: .*at least 1 character",
    "sensors: {lidar: {beams: 1}}": "sensors.lidar.beams: should be greater than or equal to 2, found 1",
    "reduction: {n_partitions: 1}": "n_partitions: should be greater than or equal to 2",
}


@pytest.mark.parametrize(("change", "words"), WRONG.items())
def test_a_wrong_value_is_told_with_its_key(tmp_path, change, words):
    path = tmp_path / "s.yaml"
    path.write_text(yaml.safe_dump(GOOD | yaml.safe_load(change)))
    with pytest.raises(UserError, match=words) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


NO_SCENARIOS = {
    "empty": "",
    "cut": "[1, 2",
    "words": "just words",
    "code": "a: !!python/object:os.system {}",
    "NUL": "\x00",
    "deep": "[" * 1000,
    "no date": "name: 2024-13-45",
    "no number": "name: 0x_",
}


@pytest.mark.parametrize("text", NO_SCENARIOS.values(), ids=NO_SCENARIOS)
def test_a_file_that_is_no_scenario(tmp_path, text):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(UserError, match=r"s\.yaml"):
        load_scenario(path)


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(
        UserError, match=r"no scenario 'dich' \(did you mean ditch\?\); bundled are"
    ):
        find_scenario("dich")


def test_a_value_that_is_endless_when_written_out_is_cut(tmp_path):
    levels = "\n".join(f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 10)}]" for n in range(1, 12))
    path = tmp_path / "s.yaml"
    path.write_text(f"l0: &l0 [x]\n{levels}\nname: *l11\n")
    with pytest.raises(UserError, match=r"s\.yaml"):
        load_scenario(path)
