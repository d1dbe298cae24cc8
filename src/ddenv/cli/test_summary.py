"""What several runs of `ddenv test` show together: of each environment how many of its runs failed, with the interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from ddenv.amounts import count, percent
from ddenv.errors import printable
from ddenv.rates import wilson_interval
from ddenv.runfile.state import BROKEN


def line(result: Mapping[str, Any]) -> str:
    """A run and how it ended."""
    without = f"  without {result['without']}" if result["without"] else ""
    if result["end_pose"] is None:
        return printable(f"seed {result['seed']:<4} {result['outcome']:<8} {result['failure']}{without}")
    x, y, z = result["end_pose"][:3]
    distance = "" if result["distance"] is None else f"  {result['distance']:.2f} m from f"
    failure = f"  {result['failure']}" if result["failure"] else ""
    return printable(
        f"seed {result['seed']:<4} {result['outcome']:<8} ended at ({x:.2f}, {y:.2f}, {z:.2f}) m "
        f"after {result['simulated_seconds']:.1f} s{failure}{distance}{without}"
    )


def summary(results: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """For all models, then without each one that was left out: its runs that did not break, and how many of them failed.

    `shown` counts the runs that ended in f, or in any failure where no f is known; `rate`, `low` and `high` are None without runs.
    """
    withouts = dict.fromkeys(result["without"] for result in results)
    return [_summary(without, [each for each in results if each["without"] == without]) for without in withouts]


def _summary(without: str | None, results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    outcomes = Counter(str(result["outcome"]) for result in results)
    shown = outcomes["similar"] + outcomes["failed"]
    runs = sum(number for outcome, number in outcomes.items() if outcome not in BROKEN)
    low, high = wilson_interval(shown, runs) if runs else (None, None)
    return {
        "without": without,
        "models": results[0]["models"],
        "runs": runs,
        "shown": shown,
        "rate": shown / runs if runs else None,
        "low": low,
        "high": high,
        "outcomes": dict(outcomes),
    }


def lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The same for people."""
    # Without a known f, all failures are alike.
    known = any("similar" in row["outcomes"] or "other" in row["outcomes"] for row in rows)
    return [printable(_line(row, known)) for row in rows]


def _line(row: Mapping[str, Any], known: bool) -> str:
    what = f"without {row['without']}" if row["without"] else f"all {count(row['models'], 'model')}"
    broke = sum(number for outcome, number in row["outcomes"].items() if outcome in BROKEN)
    also = f"; {count(broke, 'more run')} broke" if broke else ""
    if not row["runs"]:
        return f"{what}: no run ended{also}"
    share = f"{row['shown']} of {count(row['runs'], 'run')}"
    said = f"f in {share}" if known else f"{share} failed"
    return f"{what}: {said} ({percent(row['low'])} to {percent(row['high'])}){also}"
