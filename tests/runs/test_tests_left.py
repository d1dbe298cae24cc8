"""How many tests are left of a run, by the engine's forecast, and how many a reduction takes
roughly.
"""

from random import Random
from statistics import median

import pytest

from ddenv.environment import Environment
from ddenv.evidence.certificate import (
    Pairs,
    Terms,
    certificate_from_here,
    certificate_tests,
    error_of,
    falls,
    keeps,
    settle,
)
from ddenv.runs.tests_left import LATE, left_said, remaining, rough_run, search_tests
from ddenv.settings import PRINTED
from ddenv.world.load import load_scenario
from tests.conftest import DATA
from tests.tiers import slow
from tests.workbench import fake_moments

# Mean tests of random worlds (docs/benchmarks.md): models, with a failure that always shows, and
# with one in 80 % of the runs.
MEASURED = (
    ("ddenv", False, ((43, 15.9, 44), (25, 35.0, 120), (200, 54.9, 170))),
    ("ddenv", True, ((43, 36.9, 120), (36, 67.9, 242), (200, 238.5, 858))),
    ("ddmin", False, ((43, 28.3, 91), (25, 82.9, 304), (200, 156.7, 562))),
    ("probdd", False, ((43, 13.1, 37), (25, 28.1, 95), (200, 45.2, 139))),
    ("splitting", False, ((43, 11.6, 31), (25, 19.6, 63), (5000, 59.1, 160))),
)


def first(algorithm, iterations, as_printed=False):
    """The settings of a search that takes what shows f once."""
    changes = {"algorithm": algorithm, "iterations": iterations, "accept_rate": "first"}
    growth = {"growth": "paper" if as_printed else "steady"}
    return load_scenario(DATA / "wall.yaml").reduction.model_copy(update=changes | growth)


def left(run, at_work=True):
    return remaining(run.state, at_work)


@pytest.mark.parametrize(("algorithm", "as_printed", "cells"), MEASURED)
def test_a_rough_interval_holds_what_random_worlds_took(algorithm, as_printed, cells):
    for models, steady, flaky in cells:
        for tests, iterations in ((steady, 0), (flaky, 3)):
            low, likely, high = search_tests(models, first(algorithm, iterations, as_printed))
            assert low <= tests <= high
            assert low <= likely <= high


def certified(rate, certify_rate, left, at_least, random):
    """The tests of a certificate of so many needed models that keep the whole world's rate, as the
    engine makes it.
    """
    whole, end = "whole", "end"
    rates, shown = {whole: rate, end: rate}, {}

    def show(subject, number):
        (name,) = subject
        return shown.setdefault((name, number), random.random() < rates.get(name, 0.0))

    terms = Terms(
        certify_rate=certify_rate,
        keep_rate=max(certify_rate, 0.8),
        error=error_of(1),
        at_least=at_least,
    )
    kept = settle(keeps(frozenset([end]), frozenset([whole]), terms), show).verdict == "kept"
    for model in range(left if kept else 0):
        settle(falls(frozenset([str(model)]), frozenset([end]), terms.error_of_models(1.0)), show)
    return len(shown)


@pytest.mark.parametrize("certify_rate", [0.8, 2 / 3])
@pytest.mark.parametrize("rate", [1.0, 0.8])
@pytest.mark.parametrize("left", slow(pytest.mark.rates, [1, 3], but=[3]))
def test_the_tests_of_a_certificate_are_those_that_the_engine_makes(rate, certify_rate, left):
    random = Random(1)
    made = [certified(rate, certify_rate, left, 10, random) for _ in range(40)]
    low, likely, high = certificate_tests(rate, certify_rate, left, 10)
    assert low <= median(made) <= high
    assert low < likely < high


@pytest.mark.parametrize("runs", [4, 10])
def test_a_rate_that_few_runs_showed_may_be_another_one(runs):
    random, inside = Random(2), []
    for _ in range(60):
        rate = random.uniform(0.5, 1.0)
        believed = (sum(random.random() < rate for _ in range(runs)) + 0.5) / (runs + 1)
        low, likely, high = certificate_tests(believed, 0.8, 3, runs, runs)
        inside.append(low <= certified(rate, 0.8, 3, runs, random) <= high)
        assert (
            low
            <= certificate_tests(believed, 0.8, 3, runs)[0]
            < likely
            < certificate_tests(believed, 0.8, 3, runs)[2]
            <= high
        )
    assert sum(inside) >= 48


def test_a_rough_run_has_its_certificate():
    asked = load_scenario(DATA / "wall.yaml").reduction.model_copy(
        update={"baseline_runs": 10, "certify_rate": 0.8}
    )
    kept, printed = rough_run(43, asked), rough_run(43, asked.model_copy(update=PRINTED))
    assert kept.certificate == printed.certificate == certificate_tests(10.5 / 11, 0.8, 3, 10)
    assert kept.tests[1] == 10 + kept.search[1] + kept.certificate[1]
    assert kept.search[1] < printed.search[1]
    assert rough_run(1, asked).certificate[1] < kept.certificate[1]
    assert rough_run(0, asked).tests[0] >= 10


def test_slices_leave_little_of_a_large_world_to_test():
    asked = load_scenario(DATA / "wall.yaml").reduction
    sliced, whole = rough_run(5000, asked), rough_run(5000, asked, slices=False)
    assert rough_run(43, asked) == sliced
    assert rough_run(5000, asked.model_copy(update={"slice": False})) == whole
    assert all(few < many for few, many in zip(sliced.search, whole.search, strict=True))


def test_each_test_leaves_one_less(run):
    before = left(fake_moments.mid_round(run))
    run.finish(11, "pass")
    after = left(run)
    assert after.tests[1] == before.tests[1] - 1
    # 2 s a test on 2 workers that are busy for most of the time.
    assert before.seconds[1] == pytest.approx(before.tests[1] * 2 / 1.9)


# After three of four baseline runs with f.
CERTIFICATE = certificate_tests(3.5 / 5, 2 / 3, 3, 4, 4)


def test_the_certificate_is_left_after_the_search(run):
    state = fake_moments.mid_round(run).state
    search = (
        max(0, each - state.tests_done + state.forecast.tests_done) for each in state.forecast.tests
    )
    assert left(run).tests == tuple(a + b for a, b in zip(search, CERTIFICATE, strict=True))


def test_a_certificate_takes_the_tests_that_it_has_not_made(run):
    fake_moments.mid_round(run)
    terms = {"rate": 0.99, "keep_rate": 0.8, "error": 0.03, "at_least": 4}
    run.write("certificate_started", certificate=1, run=10_000, **terms)
    low, likely, high = certificate_tests(0.99, 0.8, 6, 4, 4)
    assert left(run).tests == (low, likely, high)

    def make(number):
        test = 1 + len(run.state.tests)
        place = {"phase": "certify", "round": None, "candidate": None, "node": 1}
        run.write("test_started", test=test, **place, run=number, seed=number)
        run.finish(test, "similar", 0.1)

    for made in range(1, high):
        make(10_000 + made)
        if made == likely:
            assert left(run).tests == (2, likely // LATE, high - likely), (
                "it is late, so it is not about to end"
            )
    # Those that run are left in any case.
    assert left(run).tests == (2, 2, 2)
    make(10_000 + high)
    assert left(run) is None
    assert left_said(run.state, True)[0] == "more tests than forecast"
    run.write("engine_stopped", reason="")
    assert not left_said(run.state, False), "nothing is left of what was stopped"


def test_no_time_is_said_while_nothing_runs(run):
    fake_moments.mid_round(run)
    assert left(run, at_work=False).seconds is None
    run.write("paused")
    assert left(run).seconds is None


def test_nothing_is_left_of_what_did_not_begin_or_has_ended(run):
    assert left(run) is None
    fake_moments.mid_round(run)
    assert left(run) is not None
    run.write("finished", minimal=True, reason="")
    assert left(run) is None


def test_more_tests_than_expected_end_the_forecast_and_so_does_another_search(run):
    fake_moments.mid_round(run)
    run.write("forecast", round=2, tests=[0, 1, 2], tests_done=1)
    assert left(run) is None
    assert left_said(run.state, True)[0] == "more tests than forecast"
    run.write("forecast", round=2, tests=[1, 5, 9], tests_done=9)
    assert left(run) is not None
    run.go_back(0)
    assert left(run) is None


@pytest.mark.parametrize("value", [13, "x", None, float("inf"), float("nan"), -3, 10**30, True])
def test_a_budget_ends_it_and_one_that_makes_no_sense_does_no_harm(run, value):
    state = fake_moments.mid_round(run).state
    scenario = state.scenario | {"reduction": state.scenario["reduction"] | {"budget": value}}
    for each in (scenario, {"reduction": {"budget": value}}):
        low, likely, high = remaining(state.changed(scenario=each), True).tests
        assert low <= likely <= high
        assert value != 13 or high <= 3


def test_each_forecast_narrows_the_one_before_unless_they_contradict_each_other(run):
    done = fake_moments.mid_round(run).state.tests_done
    seen = []
    for tests in ((10, 20, 40), (5, 30, 60), (20, 50, 90), (50, 60, 70)):
        run.write("forecast", round=1, tests=tests, tests_done=done)
        seen.append(run.state.forecast.tests)
    assert seen == [(10, 20, 40), (10, 30, 40), (20, 40, 40), (50, 60, 70)]


@pytest.mark.parametrize(("left", "without"), [(1.0, 0.5), (0.9, 0.7), (0.4, 0.0)])
def test_once_removals_have_shown_something_the_rest_is_forecast_from_that(left, without):
    """Where a removal only lowers the rate, it takes many more pairs than one after which f never
    shows.
    """
    rest, whole = Environment.whole(1), Environment.whole(2)
    took, low, high = [], [], []
    for salt in range(30):
        draw = Random(salt)
        cache = {}

        def shown(environment, run, draw=draw, cache=cache):
            rate = left if environment == whole else left * without
            return cache.setdefault((environment, run), draw.random() < rate)

        claim = settle(falls(rest, whole, 0.9 * error_of(1)), shown)
        seen = Pairs()
        for run in range(10):
            seen = seen.after(shown(rest, run), shown(whole, run))
        forecast = certificate_from_here(20, 10, [10], seen, 10)
        took.append(max(20, len(claim.rests_on)))
        low.append(forecast[0])
        high.append(forecast[2])
    inside = sum(
        least <= number <= most for least, number, most in zip(low, took, high, strict=True)
    )
    assert inside >= 22
