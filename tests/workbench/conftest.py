"""What the workbench's tests share: runs at fixed times in a folder of their own."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import fake_run

from ddenv.workbench.app import Workbench

# Every event of a test happens now, Unix time s; the screen looks 83 s later.
MOMENT = 1_700_000_000.0


def lasting(notify):
    """As `notify`, but what is said stays for the whole test."""
    return lambda app, message, **options: notify(app, message, **options | {"timeout": 3600.0})


@pytest.fixture(autouse=True)
def still_time(monkeypatch):
    """Neither events nor screens depend on the clock."""
    monkeypatch.setattr("ddenv.runfile.store.time", SimpleNamespace(time=lambda: MOMENT))
    monkeypatch.setattr("ddenv.workbench.shared.poll.now", lambda: MOMENT + 83.0)
    monkeypatch.setattr("ddenv.workbench.app.Workbench.notify", lasting(Workbench.notify))
    monkeypatch.setenv("TZ", "UTC")
    monkeypatch.delenv("NO_COLOR", raising=False)


@pytest.fixture(autouse=True)
def runs(tmp_path, monkeypatch) -> Path:
    """The runs folder."""
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "home"))
    folder = tmp_path / "home" / "runs"
    folder.mkdir(parents=True)
    return folder


@pytest.fixture
def run(runs):
    """A new run of the crates world, `crates-1`."""
    made = fake_run.FakeRun(runs / "crates-1.ddenv")
    yield made
    made.close()


@pytest.fixture
def scenarios(tmp_path, monkeypatch) -> Path:
    """A folder of bundled scenarios with one in it, `crates`."""
    import yaml

    folder = tmp_path / "scenarios"
    folder.mkdir()
    (folder / "crates.sdf").write_bytes(fake_run.world_text())
    (folder / "robot.sdf").write_bytes(fake_run.ROBOT_SDF)
    (folder / "crates.yaml").write_text(yaml.safe_dump(fake_run.scenario()))
    monkeypatch.setattr("ddenv.world.load.SCENARIOS", folder)
    monkeypatch.setattr("ddenv.runs.processor.usable_cores", lambda: 4)
    return folder


@pytest.fixture
def started(monkeypatch) -> list[tuple]:
    """What engines were started with, instead of starting them: the run's file name,
    the options and the job.
    """
    calls = []

    def start_engine(path, options, job):
        calls.append((path.name, options, job))
        return SimpleNamespace(poll=lambda: None)

    monkeypatch.setattr("ddenv.runs.programs.start_engine", start_engine)
    return calls
