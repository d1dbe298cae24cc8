"""The wheel, as a user installs it: all files are in it, it works outside of this checkout, and
its types are there for users' own programs.
"""

import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.waiting import PATIENCE

pytestmark = pytest.mark.programs

SOURCE = ROOT / "src/ddenv"


def run(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*map(str, words)],
        cwd=cwd,
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
    """The programs of a new environment with the wheel; it borrows other packages from here."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home)
    packages = Path(sysconfig.get_path("purelib", vars={"base": home, "platbase": home}))
    there = home / "bin/python"
    options = ["--no-deps", "--no-index", "--disable-pip-version-check"]
    done = run(
        sys.executable, "-m", "pip", "--python", there, "install", *options, wheel, cwd=home
    )
    assert done.returncode == 0, done.stderr
    # What stands here comes after the environment's own packages, and a link to this checkout is
    # not followed.
    (packages / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return there.parent


def test_every_file_of_the_source_is_in_the_wheel(wheel):
    files = [path for path in SOURCE.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    wanted = {path.relative_to(SOURCE.parent).as_posix() for path in files}
    for folder in ("scenarios", "sdf"):
        wanted |= {
            f"ddenv/data/{path.relative_to(ROOT).as_posix()}"
            for path in (ROOT / folder).rglob("*")
            if path.is_file()
        }
    assert "ddenv/py.typed" in wanted
    assert wanted - set(zipfile.ZipFile(wheel).namelist()) == set()


WORDS = {
    "version": (["--version"], "ddenv"),
    "lessons": (["learn", "--list"], "7  Groups"),
    "world": (["world", "check", "ditch"], "43 models"),
    "test": (["test", "ditch"], "seed"),
}


@pytest.mark.parametrize("name", WORDS)
def test_the_command_works_outside_of_the_checkout(programs, home, name):
    words, said = WORDS[name]
    done = run(programs / "ddenv", *words, cwd=home)
    assert said in done.stdout, done.stdout + done.stderr
