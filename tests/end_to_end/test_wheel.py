"""The wheel, as a user installs it: every file is in it, it works outside of this checkout, and its
types are there for a user's own program.
"""

import os
import re
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.waiting import PATIENCE

pytestmark = [pytest.mark.programs, pytest.mark.xdist_group("wheel")]


def run(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*map(str, words)],
        cwd=cwd,
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    built = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    assert built.returncode == 0, built.stderr
    (made,) = folder.iterdir()
    return made


@pytest.fixture(scope="module")
def programs(wheel, tmp_path_factory) -> Path:
    """The programs of a new environment that has the wheel, and borrows all other packages."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home)
    python = home / "bin/python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index"]
    installed = run(*pip, wheel, cwd=home)
    assert installed.returncode == 0, installed.stderr
    # Python follows no link from there to this checkout, as it would from its own packages.
    own = sysconfig.get_path("purelib", vars={"base": str(home)})
    borrowed = sysconfig.get_path("purelib")
    (Path(own) / "borrowed.pth").write_text(borrowed)
    return python.parent


def test_every_file_of_the_package_is_in_the_wheel(wheel):
    homes = {"src/ddenv": "ddenv", "scenarios": "ddenv/data/scenarios", "sdf": "ddenv/data/sdf"}
    wanted = {"ddenv/py.typed"}
    for here, there in homes.items():
        for path in (ROOT / here).rglob("*"):
            if path.is_file() and path.suffix != ".pyc":
                wanted.add(f"{there}/{path.relative_to(ROOT / here).as_posix()}")
    assert wanted - set(zipfile.ZipFile(wheel).namelist()) == set()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--version"], "ddenv, version"),
        (["learn", "--list"], "7  Groups"),
        (["world", "check", "ditch"], "44 models, 43 can be removed"),
        (["test", "ditch"], "seed "),
    ],
)
def test_the_command_works_outside_of_the_checkout(programs, home, words, said):
    done = run(programs / "ddenv", *words, cwd=home)
    assert said in done.stdout, done.stderr


def test_pytest_has_its_fixture(programs, tmp_path):
    (tmp_path / "test_it.py").write_text("def test_it(ddenv_reproduce):\n    pass\n")
    done = run(programs / "python", "-m", "pytest", cwd=tmp_path)
    assert "1 passed" in done.stdout, done.stdout


# A user's program; what its comments say is what mypy has to say of these lines.
PROGRAM = '''
import numpy as np

import ddenv


def fails(kept: frozenset[str]) -> bool:
    return "crate" in kept


class Simulator:
    """A simulator of the user's own."""

    def __init__(self, setup: ddenv.SimulatorSetup) -> None:
        self.setup = setup

    def run(self, world: ddenv.SubWorld, seed: int, timeout: float) -> ddenv.Ended:
        raise ddenv.UserError(f"{world} with {seed}: not within {timeout} s")


found: ddenv.Reduction = ddenv.reduce(
    ["crate", "tile"],
    fails,
    positions={"crate": (0.0, 0.0, 0.0), "tile": (1.0, 0.0, 0.0)},
    trajectory=np.zeros((3, 5)),
    traits={"crate": ddenv.Traits(size=1.0, friction=0.8, dynamic=True)},
)
names: tuple[str, ...] = found.kept
stop = ddenv.Twist(0.0, 0.0)
number: int = found.kept  # assignment
ddenv.reduce(["crate"], 3)  # arg-type
ddenv.reduce(["crate"], fails, iteration=3)  # call-arg
found.keep  # attr-defined
ddenv.reduces  # attr-defined
'''


def test_types_of_a_users_program_are_checked(programs, tmp_path):
    file = tmp_path / "program.py"
    file.write_text(PROGRAM)
    done = run(programs / "python", "-m", "mypy", "--strict", file, cwd=tmp_path)
    said = re.findall(r"^\S+?:(\d+): error: .*\[([\w-]+)\]$", done.stdout, re.MULTILINE)
    wanted = [
        (str(number), line.partition("  # ")[2])
        for number, line in enumerate(PROGRAM.splitlines(), start=1)
        if "  # " in line
    ]
    assert said == wanted, done.stdout
