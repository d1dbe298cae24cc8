"""What the screens look like. Update with `pytest tests/workbench --snapshot-update` after looking at them."""

import fake_run
import pytest

from ddenv.workbench.app import Workbench

SIZES = [(120, 36), (80, 24)]


async def settled(pilot):
    await pilot.pause()
    await pilot.app.workers.wait_for_complete()
    await pilot.pause(0.15)


def baseline(run):
    run.created()
    run.test(None, "failed")
    run.test(None, "pass", run=1)
    run.live((run.start(None, 2), 0.7), (run.start(None, 3), 0.3))
    return run


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("moment", [baseline, fake_run.mid_round, fake_run.waiting, fake_run.finished])
def test_run_screen(snap_compare, run, moment, size):
    moment(run)
    if moment is not fake_run.finished:
        run.hold()
    assert snap_compare(Workbench(run.path), terminal_size=size, run_before=settled)


def test_run_screen_without_its_engine(snap_compare, run):
    fake_run.mid_round(run)
    assert snap_compare(Workbench(run.path), terminal_size=SIZES[0], run_before=settled)


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_setup_screen(snap_compare, scenarios, runs, size):
    fake_run.finished(fake_run.FakeRun(runs / "crates-1.ddenv")).close()
    assert snap_compare(Workbench(), terminal_size=size, run_before=settled)


def test_no_color(snap_compare, run, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    fake_run.mid_round(run).hold()
    assert snap_compare(Workbench(run.path), terminal_size=SIZES[0], run_before=settled)
