"""What the baseline makes of its runs: which failure is f, how often it shows, and when there are
enough runs.
"""

from __future__ import annotations

import random
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from ddenv.engine.judging import fix_failure
from ddenv.evidence.rates import estimated_rate
from ddenv.reduction.verdict import FEWEST_SHOWN, LONGEST_BASELINE
from ddenv.runfile.events import BaselineFinished, Outcomes
from ddenv.runfile.state import Test as Ran
from ddenv.runfile.store import RunFile
from ddenv.words.baseline import baseline
from ddenv.world.scenario import FailureSpec
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.killing import Killed
from tests.engine.reading import state_of

SPEC = FailureSpec(epsilon=0.5)


def way(*points) -> np.ndarray:
    return np.array(
        [(float(time), *point, 0.0, 1.0, 0.0, 0.0, 0.0) for time, point in enumerate(points)]
    )


def ran(*outcomes, spec: FailureSpec = SPEC, wanted: int = 1, chose: int = 0):
    """What runs show; each is "pass", "error", or the way of a run that failed, with how it
    failed.
    """
    tests, ways = [], {}
    for run, one in enumerate(outcomes):
        outcome, kind, rows = (
            (one, "broken" if one == "error" else "", None)
            if isinstance(one, str)
            else ("failed", *one)
        )
        end = None if rows is None else tuple(rows[-1, 1:])
        tests.append(
            Ran(
                id=run + 1,
                environment=0,
                phase="baseline",
                round=None,
                candidate=None,
                run=run,
                seed=run,
                outcome=outcome,
                failure=kind,
                end_pose=end,
            )
        )
        if rows is not None:
            ways[run + 1] = rows
    return fix_failure(tests, ways, spec, 3, wanted, chose, usual=len(tests))


def stuck(x: float, kind: str = "stuck"):
    return kind, way((0, 0), (x, 0))


def test_f_is_the_end_that_most_runs_share():
    found = ran(
        stuck(9),
        stuck(20),
        stuck(30),
        stuck(0.2),
        stuck(0.1),
        stuck(-20),
        stuck(-30),
        stuck(0),
        stuck(0.1),
    )
    assert (found.failure_test, found.failures, found.runs) == (5, 4, 9)
    assert found.position == (0.1, 0.0, 0.0)
    assert [each.runs for each in found.seen] == [4, 1, 1, 1, 1, 1]


def test_runs_that_broke_are_not_in_the_rate():
    found = ran("error", stuck(1), "pass", stuck(1), "error")
    assert (found.failures, found.runs, found.broken, found.rate) == (2, 3, 2, pytest.approx(2 / 3))
    assert (found.miss_chance, found.iterations_95) == (pytest.approx((1 / 3) ** 4), 2)
    assert "all 1 baseline runs (1 more broke" in ran("error", "pass")
    assert "shows in less than 26 % of all runs (95 %): --baseline-runs 30 looks further" in ran(
        *["pass"] * 10
    )
    assert ran("error", "error") == "no baseline run finished: broken"


def test_the_way_there_decides_where_the_oracle_asks_for_it():
    detours = [("stuck", way((0, 0), (1, side), (2, 0))) for side in (-5, 5, 5, -5, 5)]
    found = ran(*detours, spec=FailureSpec(epsilon=0.5, similarity="trajectory"))
    assert (found.failure_test, found.failures) == (2, 3)
    assert [each.runs for each in found.seen] == [3, 2]
    assert ran(*detours).failures == 5


def test_another_failure_can_be_chosen_by_its_number():
    runs = (
        stuck(5, "fell"),
        stuck(1),
        stuck(1.1),
        "pass",
        stuck(1, "out of time"),
        stuck(5, "fell"),
        stuck(-9, "lost"),
    )
    assert [(each.test, each.runs, each.kinds) for each in ran(*runs).seen] == [
        (2, 3, ("stuck", "out of time")),
        (1, 2, ("fell",)),
        (7, 1, ("lost",)),
    ]
    second = ran(*runs, wanted=2)
    assert (second.failure_test, second.failures, second.position) == (1, 2, (5.0, 0.0, 0.0))
    assert second.judged.outcomes == {
        1: "similar",
        2: "other",
        3: "other",
        5: "other",
        6: "similar",
        7: "other",
    }
    assert ran(*runs, wanted=4) == (
        "there is no failure number 4; 7 runs of the whole world showed these: 1. stuck or out "
        "of time at (1.00, 0.00) in 3 runs; "
        "2. fell at (5.00, 0.00) in 2 runs; 3. lost at (-9.00, 0.00) in 1 run"
    )


def test_the_runs_that_chose_f_are_not_in_its_rate():
    chosen = stuck(1), stuck(1), stuck(5), "error"
    found = ran(*chosen, stuck(5), stuck(5), stuck(1), "pass", "error", chose=4)
    assert (found.failure_test, found.position, found.chose) == (1, (1.0, 0.0, 0.0), 4)
    assert (found.failures, found.runs, found.broken, found.rate) == (1, 4, 1, 0.25)
    assert [one.runs for one in found.seen] == [2, 1]
    assert found.judged.outcomes == {
        1: "similar",
        2: "similar",
        3: "other",
        5: "other",
        6: "other",
        7: "similar",
    }
    # Where none of the others shows f, its rate is from all.
    found = ran(*chosen, "pass", stuck(5), chose=4)
    assert (found.chose, found.failures, found.runs, found.broken) == (0, 2, 5, 1)


def rare(rate: float, salt: int):
    """In this part of its runs the wall stops the robot; in others it ends elsewhere, or the
    simulation breaks.
    """

    def oracle(keep, seed):
        luck = random.Random(f"{salt} {seed}").random()
        if luck < rate:
            return "similar" if "wall" in keep else "pass"
        return "other" if luck < rate + 0.05 else "error" if luck > 0.95 else "pass"

    return oracle


def last_baseline(folder, oracle, jobs: int, kill_every: int, baseline_runs: int = 4):
    """The baseline, and the runs made in it, of an engine that is killed and started again all the
    time.
    """
    path = new_run(folder, accept_rate="kept", baseline_runs=baseline_runs, iterations=1)
    for _ in range(40):
        pool = FakePool(oracle, jobs)
        with suppress(Killed):
            drive(path, pool, prepare=lambda file: _kill_at_end_of_baseline(file, kill_every))
            break
        state = state_of(path)
        if state.baseline is not None:
            break
    state = state_of(path)
    runs = {test.run for test in state.tests if test.phase == "baseline" and test.is_finished}
    if state.baseline is None:
        return None, state.status, sorted(runs)
    # The numbers of tests depend on how often an engine was killed.
    seen = [
        (state.tests[one.test - 1].run, one.runs, one.kinds, one.position)
        for one in state.baseline.seen
    ]
    return (
        replace(state.baseline, failure_test=0, judged=Outcomes({}, {}), seen=()),
        seen,
        sorted(runs),
    )


def _kill_at_end_of_baseline(file: RunFile, events: int) -> None:
    """No more than so many events are written, and none after the baseline."""
    append, written = file.append, []

    def appended(event, *values):
        written.append(event)
        recorded = append(event, *values)
        if len(written) > events or isinstance(event, BaselineFinished):
            raise Killed
        return recorded

    file.append = appended


@pytest.mark.parametrize("salt", range(6))
def test_where_few_runs_show_f_the_baseline_goes_on_in_the_same_way_for_all_engines(tmp_path, salt):
    oracle = rare(0.2, salt)
    usual = last_baseline(tmp_path, oracle, 1, 10_000)
    found, status, runs = usual
    assert (
        last_baseline(tmp_path, oracle, 3, 10_000)
        == last_baseline(tmp_path, oracle, 2, 25)
        == usual
    )
    if found is None:
        assert (status, runs) == ("finished", [0, 1, 2, 3])
    else:
        assert len(runs) == found.chose + found.runs + found.broken
        # No run more than needed.
        assert (
            len(runs) - found.chose == 4
            or (found.failures == FEWEST_SHOWN)
            or (len(runs) == LONGEST_BASELINE)
        )
        assert found.failures >= FEWEST_SHOWN or len(runs) == LONGEST_BASELINE


def competing(rate: float, salt: int):
    """Two failures, each in this part of the runs."""

    def oracle(keep, seed):
        luck = random.Random(f"{salt} {seed}").random()
        return "similar" if luck < rate else "other" if luck < 2 * rate else "pass"

    return oracle


@pytest.mark.rates
def test_where_failures_compete_the_rate_of_the_luckiest_is_not_too_high(tmp_path):
    oracles = [competing(0.45, salt) for salt in range(100)]
    found = [last_baseline(tmp_path, oracle, 1, 10_000, 10) for oracle in oracles]
    # Where one of them shows hardly ever, the other one was not chosen by luck.
    assert sum(one.chose == 10 for one, _, _ in found) >= 80
    rates = sum(one.rate for one, _, _ in found), sum(seen[0][1] / 10 for _, seen, _ in found)
    # The runs that choose show the luckier one in 0.56 of all.
    assert [rate / len(found) for rate in rates] == [
        pytest.approx(0.45, abs=0.05),
        pytest.approx(0.56, abs=0.05),
    ]
    # However many work, and however often they are killed.
    assert last_baseline(tmp_path, oracles[0], 3, 25, 10) == found[0]


def test_a_search_judges_by_the_rate_of_the_runs_that_chose_nothing(tmp_path):
    state = drive(
        new_run(tmp_path, accept_rate="kept", baseline_runs=10, iterations=1),
        FakePool(competing(0.45, 3), 2),
    )
    base = state.baseline
    shown = [
        test.outcome == "similar"
        for test in state.tests
        if test.phase == "baseline" and test.run >= 10
    ]
    assert (base.chose, base.failures, base.runs, base.rate) == (
        10,
        sum(shown),
        len(shown),
        sum(shown) / len(shown),
    )
    assert state.certificates[0].rate == estimated_rate(sum(shown), len(shown))
    assert (state.nodes[0].shown, len(state.nodes[0].runs)) == (sum(shown), len(shown))
    said = baseline(state)
    assert f" in {sum(shown)} of 10 runs" in said
    assert (
        "The first 10 runs served only to choose f: stuck at (9.00, 0.00) in 7 of them; "
        "other failures: 2. stuck at (2.00, 0.00) in 3 runs" in said
    )


def test_the_papers_baseline_never_goes_on(tmp_path):
    state = drive(new_run(tmp_path, baseline_runs=4, iterations=1), FakePool(rare(0.2, 2), 2))
    assert sum(test.phase == "baseline" for test in state.tests) == 4


def test_a_failure_that_crashes_now_and_then_stops_no_search(tmp_path):
    def oracle(keep, seed):
        if "wall" not in keep:
            return "pass"
        # In and beyond the baseline.
        return "error" if seed in (1, 4, 12) else "similar" if seed % 3 else "pass"

    state = drive(new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(oracle, 2))
    assert state.baseline.broken == 2
    assert state.environment == ("wall",)
    runs = {test.run for test in state.tests if test.phase == "round"}
    assert not runs & {1, 4}
    assert max(runs) < 12 or 12 in runs
