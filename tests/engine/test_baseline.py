"""What the baseline makes of its runs: which failure is f, how often it shows, and when there are enough runs."""

from __future__ import annotations

import numpy as np
import pytest

from ddenv.engine.baseline import fix_failure
from ddenv.runfile.state import Test as Ran
from ddenv.world.scenario import FailureSpec

SPEC = FailureSpec(epsilon=0.5)


def way(*points) -> np.ndarray:
    return np.array([(float(time), *point, 0.0, 1.0, 0.0, 0.0, 0.0) for time, point in enumerate(points)])


def ran(*outcomes, spec: FailureSpec = SPEC, wanted: int = 1):
    """What runs show; each is "pass", "error", or the way of a run that failed, with how it failed."""
    tests, ways = [], {}
    for run, one in enumerate(outcomes):
        outcome, kind, rows = (
            (one, "broken" if one == "error" else "", None) if isinstance(one, str) else ("failed", *one)
        )
        end = None if rows is None else tuple(rows[-1, 1:])
        tests.append(Ran(run + 1, "baseline", None, None, run, run, outcome, kind, end_pose=end))
        if rows is not None:
            ways[run + 1] = rows
    return fix_failure(tests, ways, spec, 3, wanted)


def stuck(x: float, kind: str = "stuck"):
    return kind, way((0, 0), (x, 0))


def test_f_is_the_end_that_most_runs_share():
    found = ran(stuck(9), stuck(20), stuck(30), stuck(0.2), stuck(0.1), stuck(-20), stuck(-30), stuck(0), stuck(0.1))
    assert (found["failure_test"], found["failures"], found["runs"]) == (5, 4, 9)
    assert found["position"] == (0.1, 0.0, 0.0)
    assert [each["runs"] for each in found["seen"]] == [4, 1, 1, 1, 1, 1]


def test_runs_that_broke_are_not_in_the_rate():
    found = ran("error", stuck(1), "pass", stuck(1), "error")
    assert (found["failures"], found["runs"], found["broken"], found["rate"]) == (2, 3, 2, pytest.approx(2 / 3))
    assert "all 1 baseline runs (1 more broke" in ran("error", "pass")


def test_the_way_there_decides_where_the_oracle_asks_for_it():
    detours = [("stuck", way((0, 0), (1, side), (2, 0))) for side in (-5, 5, 5, -5, 5)]
    found = ran(*detours, spec=FailureSpec(epsilon=0.5, similarity="trajectory"))
    assert (found["failure_test"], found["failures"]) == (2, 3)
    assert [each["runs"] for each in found["seen"]] == [3, 2]
    assert ran(*detours)["failures"] == 5


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
    assert [(each["test"], each["runs"], each["kinds"]) for each in ran(*runs)["seen"]] == [
        (2, 3, ("stuck", "out of time")),
        (1, 2, ("fell",)),
        (7, 1, ("lost",)),
    ]
    second = ran(*runs, wanted=2)
    assert (second["failure_test"], second["failures"], second["position"]) == (1, 2, (5.0, 0.0, 0.0))
    assert second["outcomes"] == {
        "1": "similar",
        "2": "other",
        "3": "other",
        "5": "other",
        "6": "similar",
        "7": "other",
    }
    assert ran(*runs, wanted=4) == (
        "there is no failure number 4; 7 runs of the whole world showed these: 1. stuck or out of time at (1.00, 0.00) in 3 runs; "
        "2. fell at (5.00, 0.00) in 2 runs; 3. lost at (-9.00, 0.00) in 1 run"
    )
