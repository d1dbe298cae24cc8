"""The guide to robots and controllers of one's own keeps to what is true, and its example works as
it says.
"""

from __future__ import annotations

import json
import os

import pytest

from ddenv.robot.protocol import Estimate, Imu, Reading, Scan, Setup
from tests.command import ddenv
from tests.conftest import ROOT

EXAMPLE = ROOT / "docs" / "examples" / "own_robot"
GUIDE = (ROOT / "docs" / "own-robot.md").read_text()


@pytest.mark.parametrize(("language", "file"), [("python", "timid.py"), ("yaml", "scenario.yaml")])
def test_the_guide_shows_the_examples_files(language, file):
    assert GUIDE.split(f"```{language}\n")[1].split("```")[0] == (EXAMPLE / file).read_text()


@pytest.mark.parametrize(
    "part", [Setup, Reading, Estimate, Imu, Scan], ids=lambda part: part.__name__
)
def test_the_guide_tells_every_field(part):
    assert [name for name in part.__annotations__ if f"`{name}`" not in GUIDE] == []


@pytest.mark.examples
def test_the_example_is_reduced_to_what_the_guide_says(tmp_path):
    """On Drake, by the command of the guide; the budget ends it in the certificate, whose fresh
    runs take most of the time.
    """
    environment = os.environ | {"DDENV_HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    done = ddenv(
        "run", EXAMPLE / "scenario.yaml", "--jobs", "2", "--budget", "24", "--json", env=environment
    )
    assert done.returncode == 1, done.stderr
    summary = json.loads(done.stdout.splitlines()[-1])
    assert "minimal environment: 2 of 12 models (83% smaller): locker_back, locker_left" in GUIDE
    assert summary["kept"] == ["locker_back", "locker_left"]
