"""The result of a run: an object for programs, and lines for people."""

from __future__ import annotations

import shlex
from pathlib import Path

from ddenv.evidence.claims import (
    current,
    fresh_runs,
    helping,
    is_minimal,
    never_left_out,
    only_helping,
)
from ddenv.evidence.rates import wilson_interval
from ddenv.evidence.slices import simulated
from ddenv.runfile.progress import Claim, Node
from ddenv.runfile.state import RunState, spent
from ddenv.runs.folder import attach_name
from ddenv.text import Data, count, first_of, percent, printable
from ddenv.words.claims import (
    drift,
    meaning,
    means,
    missing,
    promise,
    rate,
    seen,
    shows,
    smaller_known,
    verdict_on,
    what_ran,
)
from ddenv.words.early_stop import why_off

# The maximum number of names in a line, and of models with a line each.
MOST_NAMES = 12


def summary(state: RunState, path: Path) -> Data:
    """The object that `--json` prints. Durations are in s."""
    return {
        "models_before": len(state.elements),
        "models_after": len(state.environment),
        "kept": list(state.environment),
        "tests": state.tests_done,
        "simulated": simulated(state),
        "ahead_for_nothing": state.ahead,
        "outcomes": state.outcomes(),
        "deflake_runs": state.deflake_runs,
        "ended_early": state.cut_tests,
        "rounds": state.rounds_done,
        "minimal": state.certified,
        "failure": state.failure or None,
        "rate_left": _rate(state.here),
        "rate_whole_world": _rate(state.nodes[0] if state.nodes else None),
        "certificate": certificate(state),
        "wall_seconds": round(spent(state, state.updated_at), 3),
        "status": state.status,
        "reason": state.reason,
        "smaller_known": smaller_known(state) or None,
        "run_file": str(path),
    }


def _rate(node: Node | None) -> Data | None:
    """How often f showed in an environment, from all runs of it that did not break."""
    if node is None or not node.runs:
        return None
    return _share(node.shown, len(node.runs))


def _share(shown: int, runs: int) -> Data:
    low, high = wilson_interval(shown, runs)
    return {"shown": shown, "runs": runs, "rate": shown / runs, "low": low, "high": high}


def certificate(state: RunState) -> Data | None:
    """What fresh runs show of what is left; None where none were made."""
    found = current(state)
    if found is None:
        return None
    whole = _whole_world(state)
    claims = [
        {
            "without": claim.without,
            "verdict": claim.verdict,
            "means": means(state, found, claim),
            "shown": claim.shown,
            "runs": claim.runs,
            "rate": claim.shown / claim.runs if claim.runs else None,
            "low": claim.low,
            "high": claim.high,
            "keeps_at_least" if claim.without is None else "without_at_most": claim.bound,
            "outcomes": dict(claim.outcomes),
        }
        for claim in found.claims
    ]
    return {
        "number": found.number,
        "keep_rate": found.keep_rate,
        "certify_rate": found.certify_rate,
        "error": found.error,
        "seeds": list(found.seeds),
        "minimal": is_minimal(found),
        "minimal_but_for": list(helping(found)),
        "never_left_out": never_left_out(state, found),
        "means": promise(state, found) if is_minimal(found) else verdict_on(found),
        "claims": claims,
        "whole_world": None if whole is None else _rate_of(whole),
    }


def _rate_of(claim: Claim) -> Data:
    interval = {"low": claim.low, "high": claim.high}
    return {**_share(claim.shown, claim.runs), **interval, "outcomes": dict(claim.outcomes)}


def _whole_world(state: RunState) -> Claim | None:
    """The certificate's runs of the whole world, if it made any with all seeds of those of what is
    left.
    """
    for each in fresh_runs(state):
        if each.node == 0 and not each.is_left and each.has_rate:
            return each.claim
    return None


def summary_lines(state: RunState, path: Path) -> list[str]:
    before = len(state.elements)
    after = len(state.environment)
    if state.baseline is None:
        return [printable(f"run file: {path}")]
    found = current(state)
    helps = () if found is None else helping(found)
    what = "minimal environment" if state.certified else "environment so far"
    if state.status == "finished" and not state.certified:
        what = (
            "environment, "
            f"{f'minimal but for {first_of(helps, 3)}' if helps else 'not shown to be minimal'}"
        )
    tests = ", ".join(
        f"{number} {outcome}" for outcome, number in state.outcomes().items() if number
    )
    more = f"; {state.cut_tests} ended early" if state.cut_tests else ""
    more += f"; {state.implied} implied, not simulated" if state.implied else ""
    more += (
        f"; {state.ahead} started early and not needed"
        if state.ahead and state.status == "finished"
        else ""
    )
    names = first_of(state.environment, MOST_NAMES)
    # They say nothing about the failure.
    broken = [test for test in state.tests if test.broke]
    said = [
        (
            f"{what}: {after} of {count(before, 'model')} "
            f"({percent(1 - after / before).replace(' ', '')} smaller): {names}"
        ),
        *_certificate_lines(state),
        f"{state.tests_done} tests ({tests}; {count(state.deflake_runs, 're-run')}{more}) in "
        f"{count(state.rounds_done, 'round')}, "
        f"{spent(state, state.updated_at):.0f} s",
        *([off] if (off := why_off(state)) else []),
        *([known] if (known := smaller_known(state)) else []),
        *(
            [f"{count(len(broken), 'test')} broke; the last one: {broken[-1].failure}"]
            if broken
            else []
        ),
        f"run file: {path}",
    ]
    if state.status == "finished" and found is not None:
        could_go = only_helping(found)
        out = f", and H in it leaves {could_go[0]} out" if could_go else ""
        run = attach_name(path)
        bundle = shlex.quote(f"{path.stem}.zip")
        if state.isolated is not None:
            passing = ""
        else:
            passing = f"'ddenv isolate {run}' finds a nearest world that passes, "
        said.append(
            f"next: 'ddenv open {run}' shows it{out}, 'ddenv why {run}' says why it fails, "
            f"{passing}"
            f"'ddenv export {run} --bundle {bundle}' packs it for others"
        )
    return [printable(line) for line in said]


def _certificate_lines(state: RunState) -> list[str]:
    """What fresh runs show; an unfinished certificate has shown something, too, which holds
    whenever it is stopped.
    """
    found = current(state)
    if found is None:
        rates = drift(state) or (f"f in {seen(state.nodes[0])} in the whole world",)
        rows = [one for one in fresh_runs(state) if shows(one.claim)]
        return [
            f"{rates[0]}; {missing(state)}",
            *(
                f"  {what_ran(one)}: {rate(one.claim)}: {shows(one.claim)}"
                for one in rows[:MOST_NAMES]
            ),
        ]
    left, *removals = found.claims
    lines = [f"  what is left: {rate(left)}: {meaning(left, found)}"]
    lines += [
        f"  without {one.without}: {rate(one)}: {means(state, found, one)}"
        for one in removals[:MOST_NAMES]
    ]
    if (more := len(removals) - MOST_NAMES) > 0:
        lines.append(f"  and {count(more, 'more model')}")
    if (whole := _whole_world(state)) is not None:
        lines.append(f"  the whole world: {rate(whole)}")
    if state.certified:
        return [*lines, promise(state, found)]
    return lines
