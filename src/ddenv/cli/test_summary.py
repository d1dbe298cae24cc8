"""What several runs of `ddenv test` show together: of each environment how many of its runs failed, with the interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ddenv.evidence.rates import shows_at, wilson_interval
from ddenv.runfile.progress import Claim
from ddenv.runfile.state import BROKEN
from ddenv.text import count, percent, printable
from ddenv.words.claims import in_another_simulator


def line(result: Mapping[str, Any]) -> str:
    """A run and how it ended."""
    without = f"  without {result['without']}" if result["without"] else ""
    if result["end_pose"] is None:
        return printable(f"seed {result['seed']:<10} {result['outcome']:<8} {result['failure']}{without}")
    x, y, z = result["end_pose"][:3]
    distance = "" if result["distance"] is None else f"  {result['distance']:.2f} m from f"
    failure = f"  {result['failure']}" if result["failure"] else ""
    return printable(
        f"seed {result['seed']:<10} {result['outcome']:<8} ended at ({x:.2f}, {y:.2f}, {z:.2f}) m "
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


def lines(rows: Sequence[Mapping[str, Any]], said: Mapping[str | None, str] | None = None) -> list[str]:
    """The same for people; `said` has other words for a row, by the model that was left out."""
    # Without a known f, all failures are alike.
    known = any("similar" in row["outcomes"] or "other" in row["outcomes"] for row in rows)
    return [printable(_line(row, known, (said or {}).get(row["without"], ""))) for row in rows]


def _line(row: Mapping[str, Any], known: bool, said: str) -> str:
    what = f"without {row['without']}" if row["without"] else f"all {count(row['models'], 'model')}"
    broke = sum(number for outcome, number in row["outcomes"].items() if outcome in BROKEN)
    also = f"; {count(broke, 'more run')} broke" if broke else ""
    if not row["runs"] or said:
        return f"{said or f'{what}: no run ended'}{also}"
    share = f"{row['shown']} of {count(row['runs'], 'run')}"
    words = f"f in {share}" if known else f"{share} failed"
    return f"{what}: {words} ({percent(row['low'])} to {percent(row['high'])}){also}"


def elsewhere(results: Sequence[Mapping[str, Any]], here: Claim, simulator: str) -> list[dict[str, Any]]:
    """What runs in another simulator show of what is left, of which the certificate says `here`, and of that without each model.

    `fails` says whether they show f at the certificate's rate, or at less than half of it; None if they do not decide. `said` has
    the same in words. An environment without a run that ended is left out.
    """
    found = []
    for row in (each for each in summary(results) if each["runs"]):
        ended = [each for each in results if each["without"] == row["without"] and each["outcome"] not in BROKEN]
        fails = shows_at((each["outcome"] == "similar" for each in ended), here.low)
        there = replace(here, **{key: row[key] for key in ("without", "shown", "runs", "low", "high")})
        said = in_another_simulator(simulator, fails, there, here)
        found.append({"without": row["without"], "fails": fails, "said": said})
    return found
