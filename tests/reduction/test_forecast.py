"""What a reduction is expected to take: held against real ones without a robot, and against what runs say on their way."""

import pytest

import ddenv
from ddenv.forecast.estimate import expect, remaining
from ddenv.runfile.fold import fold
from tests.workbench import fake_run

NEAR = "model2model/failure-proximal"
# The table in docs/benchmarks.md: models, mean tests with a failure that always shows and with one that shows in 80 % of the runs.
TABLE = (
    ("ddenv", {"growth": "steady", "skip": "implied"}, ((43, 15.9, 44), (25, 35.0, 120), (200, 54.9, 170))),
    ("ddenv", {}, ((43, 36.9, 120), (36, 67.9, 242), (200, 238.5, 858))),
    ("ddmin", {}, ((43, 28.3, 91), (25, 82.9, 304), (200, 156.7, 562))),
    ("probdd", {}, ((43, 13.1, 37), (25, 28.1, 95), (200, 45.2, 139))),
    ("splitting", {}, ((43, 11.6, 31), (25, 19.6, 63), (5000, 59.1, 160))),
)


@pytest.mark.parametrize(("algorithm", "options", "cells"), TABLE)
def test_the_interval_holds_what_random_worlds_took(algorithm, options, cells):
    for models, steady, flaky in cells:
        for tests, iterations, rate in ((steady, 0, 1.0), (flaky, 3, 0.8)):
            expected = expect(models, algorithm, NEAR, iterations, rate, **options)
            assert expected.tests_low <= tests <= expected.tests_high
            assert expected.tests_low <= expected.tests <= expected.tests_high


def test_more_is_needed_and_more_is_expected():
    few, many = (expect(60, "ddenv", NEAR, 3, needed=needed).tests for needed in (0, 6))
    assert few < many
    assert expect(60, "ddenv", NEAR, 0).tests < few
    assert expect(20, "ddenv", NEAR, 3).tests < few
    assert expect(60, "ddenv", NEAR, 3) == expect(60, "ddenv", NEAR, 3)


@pytest.mark.parametrize("models", [0, 1, 2, 3])
@pytest.mark.parametrize("algorithm", ["ddenv", "ddmin", "probdd", "splitting", "theirs"])
def test_tiny_worlds(models, algorithm):
    expected = expect(models, algorithm, "model2model/random", 3, 0.5, needed=9)
    assert 0 <= expected.tests_low <= expected.tests_high < 60


def test_complements_alone_take_fewer_tests():
    assert 0 < expect(43, "ddenv", NEAR, 3, candidates="complements").tests < expect(43, "ddenv", NEAR, 3).tests


@pytest.fixture
def run(tmp_path):
    made = fake_run.FakeRun(tmp_path / "crates-1.ddenv")
    yield made
    made.close()


def state_of(run):
    return fold(run.file.events())


def left(run, at_work=True):
    return remaining(state_of(run), at_work)


def play(run, needed, iterations=3):
    """A run whose failure needs some models, written as an engine would; gives what was left to expect, and what was left."""
    run.created().baseline(4)
    told, state = [], state_of(run)
    rounds, tests, verdicts = [], 0, []

    def shows(kept):
        verdicts.append(set(kept))
        return needed <= set(kept)

    ddenv.reduce(
        run.elements,
        shows,
        positions={name: (float(place), 0.0, 0.0) for place, name in enumerate(run.elements)},
        failure_pose=(0.0, 0.0, 0.0),
        growth="paper",
        skip="known",
        iterations=iterations,
        check=False,
        on_round=lambda round: rounds.append((len(verdicts), round)),
    )
    for at, round in rounds:
        run.round += 1
        numbers = [[run.elements.index(name) for name in part] for part in round.partitions]
        run.write(
            "round_started",
            round=run.round,
            n_partitions=round.n_partitions,
            environment=sorted(number for part in numbers for number in part),
            partitions=numbers,
            candidates=[[one.kind, one.partition, None] for one in round.candidates],
        )
        told.append((at, left(run).tests))
        tests = len(verdicts)
        kept = next((one for one in round.candidates if needed <= one.models), None)
        if kept is not None:
            numbers = sorted(run.elements.index(name) for name in kept.models)
            run.write("reduced", candidate=round.candidates.index(kept), environment=numbers, evidence_test=1)
        run.write("round_finished")
    assert state.baseline is not None
    return [(low, tests - at, high) for at, (low, _, high) in told]


@pytest.mark.parametrize("needed", [{"crate_00", "crate_01"}, {"crate_01", "crate_04", "crate_05"}])
def test_what_is_left_is_in_the_interval_in_most_rounds(run, needed):
    told = play(run, needed)
    assert sum(low <= left <= high for low, left, high in told) >= 0.6 * len(told)


def test_what_is_left_grows_less_with_every_test(run):
    before = left(fake_run.mid_round(run))
    run.finish(11, "pass")
    after = left(run)
    assert after.tests[1] == before.tests[1] - 1
    # 2 s a test on 2 workers that are busy for most of the time.
    assert before.seconds[1] == pytest.approx(before.tests[1] * 2 / 1.9)


def test_no_time_is_told_while_nothing_runs(run):
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


def test_a_budget_ends_it(run):
    state = state_of(fake_run.mid_round(run))
    scenario = state.scenario | {"reduction": state.scenario["reduction"] | {"budget": 13}}
    assert max(remaining(state.changed(scenario=scenario), True).tests) <= 3


@pytest.mark.parametrize("value", ["x", None, float("inf"), float("nan"), -3, 10**30, True])
def test_settings_that_make_no_sense_do_no_harm(run, value):
    state = state_of(fake_run.mid_round(run))
    reduction = dict.fromkeys(("iterations", "baseline_runs", "n_partitions", "budget", "pair", "growth"), value)
    for odd in (state, state.changed(baseline=None), state.changed(round=None), state.changed(pinned=frozenset("x"))):
        told = remaining(odd.changed(scenario={"reduction": reduction}), True)
        assert told.tests[0] <= told.tests[1] <= told.tests[2]
