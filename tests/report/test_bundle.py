"""A bundle has all that reproduces a failure, and says in an exit code whether it does."""

import shutil
import sqlite3
import subprocess
import sys
import zipfile
from contextlib import closing

import pytest

from ddenv.errors import UserError
from ddenv.report.bundle import write_bundle
from ddenv.report.run_data import read_run
from tests.conftest import ROOT
from tests.workbench import fake_moments, fake_run

FILES = [
    "ISSUE.md",
    "report.html",
    "repro.py",
    "run.ddenv",
    "scenario.robot.sdf",
    "scenario.yaml",
    "world.sdf",
]
EXAMPLE = ROOT / "docs/examples/any_simulator"


@pytest.fixture
def run(tmp_path):
    return fake_moments.isolated(fake_run.FakeRun(tmp_path / "one.ddenv")).path


def trajectories(run):
    with closing(sqlite3.connect(run)) as file:
        return file.execute("SELECT count(*) FROM motion").fetchone()[0]


def test_folder_and_zip_have_the_same_files(run, tmp_path):
    written = write_bundle(run, tmp_path / "handed")
    assert [path.name for path in written] == FILES
    assert write_bundle(run, tmp_path / "handed.zip") == [tmp_path / "handed.zip"]
    with zipfile.ZipFile(tmp_path / "handed.zip") as archive:
        assert archive.namelist() == [f"handed/{name}" for name in FILES]
    assert not list(tmp_path.glob(".ddenv-bundle-*"))


def test_the_run_that_goes_along_says_the_same_and_has_only_the_trajectories_that_are_drawn(
    run, tmp_path
):
    write_bundle(run, tmp_path / "handed")
    whole, copy = read_run(run), read_run(tmp_path / "handed" / "run.ddenv")
    assert (copy.state, copy.reasons, copy.ways, copy.original) == (
        whole.state,
        whole.reasons,
        whole.ways,
        whole.original,
    )
    assert copy.evidence == whole.evidence
    assert copy.nearest == whole.nearest
    assert copy.nearest.parting
    assert not copy.troubles
    assert 0 < trajectories(tmp_path / "handed" / "run.ddenv") < trajectories(run)


def test_the_issue_says_what_fails_how_often_and_what_is_needed(run, tmp_path):
    write_bundle(run, tmp_path / "handed")
    issue = (tmp_path / "handed" / "ISSUE.md").read_text()
    assert issue.startswith("# 2 of 11 models are enough to make the robot fail\n")
    assert (
        "f in 23 of 23 fresh runs (80 % to 100 %): keeps at least 81 % of the whole world's rate"
        in issue
    )
    assert "- `crate_00`\n- `crate_01`\n" in issue
    assert all(
        f"`{shown}`" in issue
        for shown in ("report.html", "ddenv open run.ddenv", "ddenv test scenario.yaml")
    )
    assert "Without crate_00 the robot reaches its goal" in issue
    assert "A nearest world that passes lacks 1 model of 11 (crate_00)" in issue


@pytest.mark.parametrize("name", ["handed", "handed.zip"])
def test_nothing_is_replaced_and_nothing_is_written_where_a_certificate_lacks(run, tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(UserError, match="exists already"):
        write_bundle(run, tmp_path / name)
    (tmp_path / name).rmdir()
    uncertified = fake_moments.uncertified(fake_run.FakeRun(tmp_path / "other.ddenv")).path
    with pytest.raises(UserError, match="make a certificate first: ddenv certify"):
        write_bundle(uncertified, tmp_path / name)
    assert not (tmp_path / name).exists()


@pytest.mark.programs
def test_without_this_ddenv_nothing_is_said_of_the_failure(run, tmp_path):
    write_bundle(run, tmp_path / "handed")
    (tmp_path / "ddenv").mkdir()
    (tmp_path / "ddenv" / "__init__.py").touch()
    program = [sys.executable, "handed/repro.py"]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (125, "")
    assert "repro.py: needs ddenv-workbench" in done.stderr
    assert "pip install ddenv" not in (tmp_path / "handed" / "ISSUE.md").read_text()


@pytest.mark.examples
def test_git_bisect_finds_the_change_that_made_the_robot_fail(tmp_path, home):
    """In a repository with the user's own simulator; the change is seen by the run that failed
    after it.
    """
    repository, bundle = tmp_path / "repository", tmp_path / "bundle"
    shutil.copytree(EXAMPLE, repository)
    program = repository / "drive.py"
    broken = program.read_text()

    def git(*words):
        name = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false")
        done = subprocess.run(
            ["git", *name, *words], cwd=repository, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    git("init", "-q")
    # A robot that slides through what it meets reaches its goal.
    versions = [broken.replace("RADIUS, SPEED, STEP = 0.3", "RADIUS, SPEED, STEP = 0.0"), broken]
    for number in range(5):
        program.write_text(f"{versions[number >= 3]}\n# {number}\n")
        git("add", ".")
        git("commit", "-q", "-m", f"change {number}")
    ddenv = [sys.executable, "-m", "ddenv"]
    start = ["run", "scenario.yaml", "--trust", "--output", "found.ddenv", "--jobs", "2"]
    done = subprocess.run(
        [*ddenv, *start], cwd=repository, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    write_bundle(repository / "found.ddenv", bundle)
    git("bisect", "start", "HEAD", "HEAD~4")
    said = git("bisect", "run", sys.executable, str(bundle / "repro.py"), "--folder", ".")
    assert "is the first bad commit" in said
    assert "change 3" in said
