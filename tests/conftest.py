"""What tests of several rooms share."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A slow machine is no bug.
settings.register_profile("ddenv", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("ddenv")

DATA = Path(__file__).parent / "data"
ROOT = Path(__file__).parents[1]


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    """A folder of its own for runs."""
    monkeypatch.setenv("DDENV_HOME", str(tmp_path))
    return tmp_path
