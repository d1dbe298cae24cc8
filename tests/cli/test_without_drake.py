"""Where Drake has no wheels, what needs it says so in one line, and all that only looks works.
Windows lacks more than Drake. What needs an extra names it.
"""

import os

import pytest

from ddenv.learn.catalog import LESSONS
from tests.command import ddenv, is_one_line
from tests.conftest import DATA
from tests.tiers import slow

RUN = LESSONS / "ditch.ddenv"
COMMANDS = {
    "run": ["run", DATA / "wall.yaml"],
    "test": ["test", DATA / "wall.yaml"],
    "settle": ["world", "settle", DATA / "wall.sdf", "-o", "settled.sdf"],
    "mcap": ["export", RUN, "--mcap", "ditch.mcap"],
}
LOOKS = {
    "learn": (["learn", "--list"], "7  Groups"),
    "page": (["learn", "5", "--page", "five.html"], "wrote five.html"),
    "report": (["report", RUN, "-o", "ditch.html"], "wrote ditch.html"),
    "show": (["world", "show", "ditch"], "43 models"),
}


def without(home, modules, words):
    (home / "sitecustomize.py").write_text(
        f"import sys\n\nsys.modules.update(dict.fromkeys({modules!r}))\n"
    )
    path = os.pathsep.join([str(home), os.environ.get("PYTHONPATH", "")])
    return ddenv(*words, cwd=home, env=os.environ | {"PYTHONPATH": path, "DDENV_HOME": str(home)})


@pytest.mark.parametrize("name", slow(pytest.mark.programs, LOOKS, but=["show"]))
def test_what_only_looks_needs_none_of_them(home, name):
    words, said = LOOKS[name]
    done = without(home, ("pydrake", "fcntl", "termios", "sklearn"), words)
    assert done.returncode == 0 and said in done.stdout, done.stderr


@pytest.mark.parametrize("name", slow(pytest.mark.programs, COMMANDS, but=["run"]))
def test_what_needs_drake_says_so(home, name):
    done = without(home, ("pydrake",), COMMANDS[name])
    assert done.returncode == 2
    last = done.stderr.strip().splitlines()[-1]
    assert "Drake, which is not installed here: pip install drake" in last
    assert "Traceback" not in done.stderr


@pytest.mark.programs
def test_messages_need_an_extra_and_say_which(home):
    done = without(home, ("mcap_ros2",), COMMANDS["mcap"])
    is_one_line(done, "--mcap needs another package: pip install '.[mcap]'")
