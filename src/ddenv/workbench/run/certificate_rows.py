"""The rows of the table while a certificate is made, and when it is finished: what ran, how often f showed, what it means."""

from __future__ import annotations

from collections.abc import Mapping

from ddenv.claims import fresh_runs_made, in_the_making, made_of_usual, short
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.runs.fresh_runs import FreshRuns
from ddenv.text import shortened
from ddenv.workbench.shared.poll import Snapshot
from ddenv.workbench.shared.wording import CLAIM, count, percent, signs, simulated

# Maximum width of a model's name, in cells.
NAME = 18


def name_of(one: FreshRuns) -> str:
    """What ran, in a few words."""
    if one.without is not None:
        return f"- {shortened(one.without, NAME)}"
    if one.is_left:
        return "what is left"
    return "whole world" if one.node == 0 else f"step {one.node}"


def certificate_title(state: RunState) -> tuple[str, str]:
    """The table's title, and how much of it is done."""
    certificate = state.certificate
    if certificate is None:
        return "", ""
    number = f" {certificate.number}" if certificate.number > 1 else ""
    keeps = f"has to keep {percent(certificate.keep_rate)}"
    far = (
        made_of_usual(state, certificate) if in_the_making(state) else count(fresh_runs_made(state, certificate), "run")
    )
    return f"Certificate{number}: {keeps}", far


def words(snapshot: Snapshot, one: FreshRuns) -> Mapping[str, str]:
    """The words of a row by column."""
    return {
        "environment": name_of(one),
        "runs": str(one.runs) if one.runs else "",
        "ended": signs(dict(one.outcomes)),
        "f": percent(one.shown / one.runs) if one.runs else "",
        "95 %": f"{percent(one.low)[:-2]} to {percent(one.high)[:-2]}" if one.runs else "",
        "verdict": _verdict(snapshot, one),
    }


def _verdict(snapshot: Snapshot, one: FreshRuns) -> str:
    if one.claim is not None:
        return f"{CLAIM.get(one.claim.verdict, '?')} {short(one.claim)}"
    running = one.running if snapshot.engine == "alive" else ()
    if not running:
        return ""
    seconds = snapshot.seconds(running[0].id)
    return "▶" * min(3, len(running)) + simulated(seconds, settings(snapshot.state).timeout)
