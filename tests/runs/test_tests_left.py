"""How many tests are left of a run, by the engine's forecast, and how many a reduction takes roughly."""

import pytest

from ddenv.runfile.fold import fold
from ddenv.runs.tests_left import remaining, rough_tests
from tests.workbench import fake_run

# Mean tests of random worlds (docs/benchmarks.md): models, with a failure that always shows, and with one in 80 % of the runs.
MEASURED = (
    ("ddenv", False, ((43, 15.9, 44), (25, 35.0, 120), (200, 54.9, 170))),
    ("ddenv", True, ((43, 36.9, 120), (36, 67.9, 242), (200, 238.5, 858))),
    ("ddmin", False, ((43, 28.3, 91), (25, 82.9, 304), (200, 156.7, 562))),
    ("probdd", False, ((43, 13.1, 37), (25, 28.1, 95), (200, 45.2, 139))),
    ("splitting", False, ((43, 11.6, 31), (25, 19.6, 63), (5000, 59.1, 160))),
)


@pytest.fixture
def run(tmp_path):
    made = fake_run.FakeRun(tmp_path / "crates-1.ddenv")
    yield made
    made.close()


def state_of(run):
    return fold(run.file.events())


def left(run, at_work=True):
    return remaining(state_of(run), at_work)


@pytest.mark.parametrize(("algorithm", "as_printed", "cells"), MEASURED)
def test_a_rough_interval_holds_what_random_worlds_took(algorithm, as_printed, cells):
    for models, steady, flaky in cells:
        for tests, iterations in ((steady, 0), (flaky, 3)):
            low, likely, high = rough_tests(models, algorithm, iterations, as_printed)
            assert low <= tests <= high
            assert low <= likely <= high


@pytest.mark.parametrize("models", [0, 1, 2, 3])
@pytest.mark.parametrize("algorithm", ["ddenv", "ddmin", "probdd", "splitting", "theirs"])
def test_tiny_worlds_take_few_tests(models, algorithm):
    low, likely, high = rough_tests(models, algorithm, 3, as_printed=True)
    assert 0 <= low <= likely <= high < 60


def test_each_test_leaves_one_less(run):
    before = left(fake_run.mid_round(run))
    run.finish(11, "pass")
    after = left(run)
    assert after.tests[1] == before.tests[1] - 1
    # 2 s a test on 2 workers that are busy for most of the time.
    assert before.seconds[1] == pytest.approx(before.tests[1] * 2 / 1.9)


def test_the_tests_that_run_are_left_at_least(run):
    fake_run.mid_round(run)
    run.write("forecast", round=2, tests=[0, 1, 9], tests_done=10)
    assert left(run).tests == (2, 2, 9)
    assert left(run, at_work=False).tests == (0, 1, 9)


def test_no_time_is_said_while_nothing_runs(run):
    fake_run.mid_round(run)
    assert left(run, at_work=False).seconds is None
    run.write("paused")
    assert left(run).seconds is None


def test_nothing_is_left_of_what_did_not_begin_or_has_ended(run):
    assert left(run) is None
    fake_run.confirming(run)
    assert left(run) is None
    run.write("finished", minimal=True, reason="")
    assert left(run) is None


def test_more_tests_than_expected_end_the_forecast_and_so_does_another_search(run):
    fake_run.mid_round(run)
    run.write("forecast", round=2, tests=[0, 1, 2], tests_done=1)
    assert left(run) is None
    run.write("forecast", round=2, tests=[1, 5, 9], tests_done=9)
    assert left(run) is not None
    run.go_back(0)
    assert left(run) is None


def test_a_run_file_without_forecasts_is_read(run):
    fake_run.mid_round(run)
    events = [event for event in run.file.events() if event.kind != "forecast"]
    assert remaining(fold(events), True) is None


def test_a_budget_ends_it(run):
    state = state_of(fake_run.mid_round(run))
    scenario = state.scenario | {"reduction": state.scenario["reduction"] | {"budget": 13}}
    assert max(remaining(state.changed(scenario=scenario), True).tests) <= 3


@pytest.mark.parametrize("value", ["x", None, float("inf"), float("nan"), -3, 10**30, True])
def test_settings_that_make_no_sense_do_no_harm(run, value):
    state = state_of(fake_run.mid_round(run))
    low, likely, high = remaining(state.changed(scenario={"reduction": {"budget": value}}), True).tests
    assert low <= likely <= high
