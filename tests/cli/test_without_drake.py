"""Where Drake has no wheels, what needs it says so in one line."""

import os

import pytest

from tests.command import ddenv
from tests.conftest import DATA

COMMANDS = {
    "run": ["run", DATA / "wall.yaml"],
    "test": ["test", DATA / "wall.yaml"],
    "settle": ["world", "settle", DATA / "wall.sdf", "-o", "settled.sdf"],
}


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_what_needs_drake_says_so(home, words):
    (home / "sitecustomize.py").write_text("import sys\n\nsys.modules['pydrake'] = None\n")
    path = os.pathsep.join([str(home), os.environ.get("PYTHONPATH", "")])
    done = ddenv(*words, cwd=home, env=os.environ | {"PYTHONPATH": path, "DDENV_HOME": str(home)})
    assert done.returncode == 2
    last = done.stderr.strip().splitlines()[-1]
    assert "Drake, which is not installed here: pip install drake" in last
    assert "Traceback" not in done.stderr
