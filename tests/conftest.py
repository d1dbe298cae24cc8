"""What tests of several rooms share."""

import fcntl
import gc
import os
import shutil
import signal
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from hypothesis import settings

from ddenv.runs import processor
from tests.command import Said, in_process
from tests.tiers import SLOW

settings.load_profile("quick")

# Programs that tests start can be interrupted, also where the tests run in the background.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

DATA = Path(__file__).parent / "data"
ROOT = Path(__file__).parents[1]


def pytest_configure() -> None:
    # Nothing is written to the user's own folders. All processes of the session have the same one.
    if "PYTEST_XDIST_WORKER" not in os.environ:
        os.environ["DDENV_HOME"] = tempfile.mkdtemp(prefix="ddenv-tests-")


def pytest_unconfigure() -> None:
    if "PYTEST_XDIST_WORKER" not in os.environ:
        shutil.rmtree(os.environ["DDENV_HOME"], ignore_errors=True)


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    """A folder of its own for runs."""
    monkeypatch.setenv("DDENV_HOME", str(tmp_path))
    return tmp_path


@pytest.fixture
def command(monkeypatch, capsys) -> Callable[..., Said]:
    """`ddenv` with these words, in this process."""
    return partial(in_process, monkeypatch, capsys)


@pytest.fixture
def run(tmp_path):
    """A run file to write events to, in place of an engine."""
    from tests.workbench.fake_run import FakeRun

    made = FakeRun(tmp_path / "crates-1.ddenv")
    yield made
    made.close()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is slow for one of the named reasons is `slow`, but for its witness."""
    for item in items:
        if any(item.get_closest_marker(name) for name in SLOW) and not item.get_closest_marker(
            "witness"
        ):
            item.add_marker("slow")
    # The longest come first, so that no process is left with them alone in the end.
    items.sort(key=lambda item: item.get_closest_marker("rates") is None)


def pytest_terminal_summary(terminalreporter) -> None:
    """The table of false claims, where their number was asked for."""
    if "DDENV_CLAIMS" not in os.environ:
        return
    rows = [
        f"| {report.nodeid.partition('::')[2]} | {row} |"
        for outcome in ("passed", "failed")
        for report in terminalreporter.stats.get(outcome, ())
        for kind, row in report.user_properties
        if kind == "false claims"
    ]
    if rows:
        terminalreporter.write_line(
            "| oracle and world | sentence | said falsely | allowed | p |\n|---|---|---|---|---|"
        )
        terminalreporter.write_line("\n".join(rows))


def pytest_collection_finish() -> None:
    # What was imported stays. Looking through it again and again took a tenth of the tests' time.
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory) -> Callable[[str, Callable[[Path], None]], Path]:
    """Makes a folder's content in one of the session's processes, whichever needs it first; the
    others find it there.
    """
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own

    def folder(name: str, make: Callable[[Path], None]) -> Path:
        made = shared / name
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (made / "complete").exists():
                made.mkdir(exist_ok=True)
                make(made)
                (made / "complete").touch()
        return made

    return folder


def pytest_xdist_auto_num_workers() -> int:
    """Many tests wait for a terminal, a browser or another program: one worker more keeps all cores
    busy.
    """
    return 1 + processor.usable_cores()
