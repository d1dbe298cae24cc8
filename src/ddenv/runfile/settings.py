"""The settings of a run's scenario that views show, as the run's first event recorded them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ddenv.errors import printable
from ddenv.runfile.state import RunState


@dataclass(frozen=True, slots=True)
class Settings:
    """`epsilon` in m, `timeout` in simulated s; `iterations` re-runs a candidate, `baseline_runs` of the whole world."""

    name: str = "run"
    algorithm: str = "ddenv"
    pair: str = ""
    growth: str = "paper"
    iterations: int = 3
    baseline_runs: int = 10
    epsilon: float = 0.33
    timeout: float = 45.0


def settings(state: RunState) -> Settings:
    """What the run was asked to do; a damaged entry falls back to its default."""
    scenario = state.scenario
    reduction, failure = _section(scenario, "reduction"), _section(scenario, "failure")
    standard = Settings()
    return Settings(
        name=_plain(scenario.get("name", standard.name)),
        algorithm=_plain(reduction.get("algorithm", standard.algorithm)),
        pair=_plain(reduction.get("pair", standard.pair)),
        growth=_plain(reduction.get("growth", standard.growth)),
        iterations=_number(reduction, "iterations", standard.iterations),
        baseline_runs=_number(reduction, "baseline_runs", standard.baseline_runs),
        epsilon=_number(failure, "epsilon", standard.epsilon),
        timeout=_number(failure, "timeout", standard.timeout),
    )


def _section(data: dict[str, Any], key: str) -> dict[str, Any]:
    value = data.get(key)
    return value if isinstance(value, dict) else {}


def _number(data: dict[str, Any], key: str, standard: Any) -> Any:
    value = data.get(key, standard)
    return value if isinstance(value, (int, float)) else standard


def _plain(value: Any) -> str:
    return printable(" ".join(str(value).split()))
