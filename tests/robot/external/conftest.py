"""Proof that no simulator leaves anything behind."""

import tempfile
import uuid

import pytest

from ddenv.robot.external.simulator import ExternalSimulator
from ddenv.runs.experiment import load_parts
from tests.robot.external.own import TOKEN, own_scenario, processes_with
from tests.waiting import wait_until


@pytest.fixture(autouse=True)
def tidy(tmp_path, monkeypatch):
    """In the end no process is left that the test started, and no temporary file."""
    token = uuid.uuid4().hex
    monkeypatch.setenv(TOKEN, token)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    yield
    wait_until(lambda: not processes_with(token) and not list(temporary.iterdir()))


@pytest.fixture
def simulator_of(tmp_path):
    """Makes the simulator of a scenario as `own_scenario` does."""

    def make(*arguments, **options) -> ExternalSimulator:
        scenario = own_scenario(tmp_path, *arguments, **options)
        return ExternalSimulator(load_parts(scenario)[0], scenario)

    return make
