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
    run.test(None, "failed", failure="stuck")
    run.test(None, "pass", run=1)
    run.live((run.start(None, 2), 0.7), (run.start(None, 3), 0.3))
    return run


MOMENTS = [baseline, fake_run.mid_round, fake_run.waiting, fake_run.confirming, fake_run.finished]


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("moment", MOMENTS)
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


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_setup_screen_with_an_open_list(snap_compare, scenarios, size):
    async def opened(pilot):
        await settled(pilot)
        await pilot.press("enter", "end", "enter", "tab", "tab", "enter", "down")

    assert snap_compare(Workbench(), terminal_size=size, run_before=opened)


def test_setup_screen_explains_what_is_not_used(snap_compare, scenarios):
    async def chosen(pilot):
        await settled(pilot)
        await pilot.press("enter", "enter", "down", "enter", "tab")

    assert snap_compare(Workbench(), terminal_size=SIZES[1], run_before=chosen)


def reduced_by(algorithm, runs):
    data = fake_run.scenario()
    data["reduction"]["algorithm"] = algorithm
    run = fake_run.FakeRun(runs / "crates-1.ddenv", data).created().baseline()
    run.round = 1
    groups = [[0, 1, 2, 3], list(range(4, 11))]
    run.write(
        "round_started",
        round=1,
        n_partitions=2,
        environment=list(range(11)),
        partitions=groups,
        candidates=[["complement", 0, 0.0]],
    )
    run.test(0, "pass")
    run.live((run.start(0, 1), 0.4))
    return run


def test_run_screen_of_another_algorithm(snap_compare, runs):
    run = reduced_by("splitting", runs)
    run.hold()
    assert snap_compare(Workbench(run.path), terminal_size=SIZES[0], run_before=settled)
    run.close()


def test_explained_run(snap_compare, runs):
    run = reduced_by("splitting", runs)
    run.hold()

    async def explained(pilot):
        await settled(pilot)
        await pilot.press("e")

    assert snap_compare(Workbench(run.path), terminal_size=SIZES[1], run_before=explained)
    run.close()


def test_no_color(snap_compare, run, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    fake_run.mid_round(run).hold()
    assert snap_compare(Workbench(run.path), terminal_size=SIZES[0], run_before=settled)
