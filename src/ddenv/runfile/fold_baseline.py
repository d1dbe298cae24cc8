"""Folds the end of the baseline: f is fixed, and all failures of the whole world are counted."""

from __future__ import annotations

from dataclasses import replace

from ddenv.runfile.events import Changes, Data, chance, number, vector, whole
from ddenv.runfile.failures import Baseline, SeenFailure
from ddenv.runfile.fold_decisions import with_outcomes
from ddenv.runfile.fold_rates import seen
from ddenv.runfile.progress import Point
from ddenv.runfile.state import RunState


def baseline_finished(state: RunState, data: Data, _: float) -> Changes:
    x, y, z = vector(data["position"], 3)
    baseline = Baseline(
        runs=whole(data["runs"]),
        failures=whole(data["failures"]),
        rate=chance(data["rate"]),
        low=chance(data["low"]),
        high=chance(data["high"]),
        failure_test=whole(data["failure_test"]),
        position=(x, y, z),
        miss_chance=chance(data["miss_chance"]),
        iterations_95=whole(data["iterations_95"]),
        broken=whole(data.get("broken", 0)),
        wall_limit=None if data.get("wall_limit") is None else number(data["wall_limit"]),
        seen=tuple(map(_seen, data.get("seen", ()))),
    )
    compared = with_outcomes(state, data)
    point = Point(compared.tests_done, len(state.environment))
    runs, shown = seen(compared.tests, (test.id for test in compared.tests if test.phase == "baseline"))
    first = baseline.failure_test
    root = () if not state.nodes else (replace(state.nodes[0], evidence_test=first, runs=runs, shown=shown),)
    return {
        "tests": compared.tests,
        "tally": compared.tally,
        "deflake_runs": compared.deflake_runs,
        "baseline": baseline,
        "evidence_test": first,
        "failures": (first,),
        "nodes": (*root, *state.nodes[1:]),
        "history": (*state.history, point),
        "status": state.status if state.paused else "running",
    }


def _seen(data: Data) -> SeenFailure:
    x, y, z = vector(data["position"], 3)
    return SeenFailure(whole(data["test"]), whole(data["runs"]), tuple(map(str, data["kinds"])), (x, y, z))
