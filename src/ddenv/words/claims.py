"""What a run may claim of its result: said here alone, from the runs that show it, with their
number and interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ddenv.evidence.certificate import NEEDED_SHARE
from ddenv.evidence.claims import (
    FreshRuns,
    current,
    expected_fresh_runs,
    failing_instead,
    fresh_runs_made,
    helping,
    is_minimal,
    never_left_out,
    so_far,
)
from ddenv.runfile.events import EndsElsewhere
from ddenv.runfile.failure_words import deed
from ddenv.runfile.fold_decisions import failures_at, origin
from ddenv.runfile.progress import Certificate, Claim, Isolation, Node, Returned
from ddenv.runfile.state import RunState
from ddenv.runfile.supports import stack_with
from ddenv.text import (
    Sentences,
    as_sentence,
    between,
    count,
    first_of,
    percent,
    percent_at_least,
    percent_at_most,
)
from ddenv.words.signs import metres

MOST_NAMES = 3
MOST_SEEDS = 4


def verdict_on(certificate: Certificate, pinned: int = 0, each: str = "single model") -> str:
    """What a finished certificate shows, in one sentence without a full stop.

    `pinned` models could not be left out; `each` is what was left out at a time.
    """
    left, *removals = certificate.claims
    if left.verdict == "lost":
        return (
            f"what is left keeps less than {percent(certificate.keep_rate)} of "
            f"{_whole_rate(certificate)}: {rate(left)}"
        )
    if left.verdict != "kept" and not certificate.seeds:
        aim = f"{percent_at_least(certificate.certify_rate)} of {_whole_rate(certificate)}"
        shown = f"; it keeps at least {percent_at_least(left.bound)}" if left.bound else ""
        return f"not shown that what is left keeps {aim}{shown}: {rate(left)}"
    verdicts = {str(claim.without): claim.verdict for claim in removals}
    if certificate.elsewhere is not None:
        return f"{_elsewhere(certificate.elsewhere)}; with everything that is left {rate(left)}"
    if doubt := _doubt(
        verdicts, "not shown that each model is needed", "not minimal: f seems to show", "without"
    ):
        return f"{doubt}; with everything that is left {rate(left)}"
    but = f"; {_stayed(pinned)}" if pinned else ""
    if certificate.seeds:
        return f"{_exactly(certificate)}; with other seeds {rate(left)}{but}"
    if not removals:
        return f"nothing is left that can be removed: {rate(left)}{but}"
    if helps := helping(certificate):
        first = next(claim for claim in removals if claim.without == helps[0])
        return (
            f"minimal but for {first_of(helps, MOST_NAMES)}: {kept(certificate)}; without "
            f"{helps[0]} {rate(first)}{but}"
        )
    most = max(removals, key=lambda claim: claim.high)
    one = f"{'other ' if pinned else ''}{each}"
    without = f"any one of these {len(removals)}" if len(removals) > 1 else removals[0].without
    bound = _at_most(certificate)
    if bound is None:
        often = rate(most)
    else:
        often = f"{_seldom(removals)} (upper bound: {percent_at_most(bound)} as often)"
    return f"no {one} can be removed: {kept(certificate)}; without {without}, {often}{but}"


def _elsewhere(ends: EndsElsewhere) -> str:
    """That what is left mostly ends where f did not, within epsilon of it."""
    return (
        "what is left may show another failure within epsilon: of the runs of the whole world "
        f"with f {ends.whole} of {ends.of_whole} ended in one place, of what is left {ends.left} "
        f"of {ends.of_left} did, and others ended {ends.apart:.2g} m away; --epsilon "
        f"{ends.epsilon:g} tells them apart"
    )


def _doubt(verdicts: Mapping[str, str], unsure: str, refuted: str, how: str) -> str:
    """Of which models, by name, a result is `unsure` or `refuted`; "" if of none."""
    starts = {
        "unknown": f"{unsure}: tests broke {how}",
        "not shown": f"{unsure}: undecided {how}",
        "not needed": f"{refuted} about as often {how}",
    }
    for word, start in starts.items():
        if names := [name for name, verdict in verdicts.items() if verdict == word]:
            return f"{start} {first_of(names, MOST_NAMES)}"
    return ""


def _seldom(removals: Sequence[Claim]) -> str:
    """How often f showed at most with one model removed: "f in none of 12 fresh runs each"."""
    most = max(removals, key=lambda claim: (claim.shown / max(1, claim.runs), claim.high))
    each = " each" if len(removals) > 1 else ""
    if most.shown:
        return f"f in {'at most ' if each else ''}{most.shown} of {count(most.runs, 'fresh run')}"
    if len({claim.runs for claim in removals}) > 1:
        each = ""
    return f"f in none of {count(most.runs, 'fresh run')}{each}"


def _exactly(certificate: Certificate) -> str:
    """What the chosen runs show: "f shows with seed 3 each time; without any one of these 4 models
    it does not".
    """
    _, *removals = certificate.claims
    shows = f"f shows with {seeds_of(certificate)} each time"
    if not removals:
        return f"{shows}; nothing is left that can be removed"
    names = f"any one of these {len(removals)} models" if len(removals) > 1 else removals[0].without
    runs = removals[0].runs
    return (
        f"{shows}; without {names} it "
        f"{f'shows with none of the {runs} chosen seeds' if runs > 1 else 'does not'}"
    )


def seeds_of(certificate: Certificate) -> str:
    seeds = certificate.seeds
    return f"seed{'s' * (len(seeds) > 1)} {first_of([str(seed) for seed in seeds], MOST_SEEDS)}"


def kept(certificate: Certificate) -> str:
    """What is left keeps: "f in 16 of 16 fresh runs (80 % to 100 %), at least 68 % of the whole
    world's rate".
    """
    return (
        f"{rate(certificate.claims[0])}, at least {percent_at_least(_kept(certificate))} of "
        f"{_whole_rate(certificate)}"
    )


def _kept(certificate: Certificate) -> float:
    """The share that "kept" has shown. Certificates of older versions had no bound beyond what they
    asked for.
    """
    bound = certificate.claims[0].bound
    if bound is None:
        return certificate.certify_rate
    return bound


def _at_most(certificate: Certificate) -> float | None:
    """How often f shows with any one model removed, at most, as a share of its rate with it; None
    if that was not bounded.
    """
    bounds = [claim.bound for claim in certificate.claims if claim.without is not None]
    if None not in bounds:
        return max((bound for bound in bounds if bound is not None), default=None)
    return None


def _as_often(bound: float | None) -> str:
    if bound is None:
        return "rarer"
    return f"at most {percent_at_most(bound)} as often"


def shown(state: RunState) -> str:
    """What fresh runs show of what is left, by a finished certificate or so far; one sentence
    without a full stop.
    """
    if (found := current(state)) is not None:
        return verdict_on(found, never_left_out(state, found))
    said = [missing(state)]
    if (now := state.certificate) is not None:
        bounds = {
            name: claim.bound
            for name, claim in so_far(state, now).items()
            if claim.bound is not None
        }
        if share := bounds.pop(None, 0.0):
            said.append(f"so far at least {percent_at_least(share)} of {_whole_rate(now)} is kept")
        less = [
            f"without {name} f shows {_as_often(share)}"
            for name, share in bounds.items()
            if share < 1.0
        ]
        said += less[:MOST_NAMES]
    return "; ".join(said)


def uncertified(state: RunState, run: object) -> str:
    """Why what needs a finished certificate cannot be had of a run, and the command that makes
    one.
    """
    command = "certify" if state.status == "finished" else "resume"
    return f"{run}: {shown(state)}; make a certificate first: ddenv {command} {run}"


def _stayed(pinned: int) -> str:
    if pinned == 1:
        return "1 pinned model was never left out"
    return f"{pinned} pinned models were never left out"


def environment_named(node: int) -> str:
    if node == 0:
        return "the whole world"
    return f"the environment of step {node}"


def what_ran(one: FreshRuns) -> str:
    """What was run with fresh seeds: "what is left", "without crate_00" or "the whole world"."""
    if one.without is not None:
        return f"without {one.without}"
    if one.is_left:
        return "what is left"
    return environment_named(one.node)


def bound_sign(claim: Claim) -> str:
    """That "≥ 63 %" of the rate is kept, or "≤ 21 %" as often without the model; "" if nothing is
    shown yet.
    """
    if claim.bound is None:
        return ""
    if claim.without is not None:
        return f"≤ {percent_at_most(claim.bound)}" if claim.bound < 1.0 else ""
    return f"≥ {percent_at_least(claim.bound)}" if claim.bound > 0.0 else ""


def shows(claim: Claim) -> str:
    """The same in words."""
    if claim.bound is None or not bound_sign(claim):
        return ""
    if claim.without is not None:
        return f"at most {percent_at_most(claim.bound)} as often"
    return f"keeps at least {percent_at_least(claim.bound)} of the rate"


def rate(fresh: Claim) -> str:
    """How often fresh runs showed f: "f in 23 of 23 fresh runs (86 % to 100 %)"; without an
    interval, how often chosen ones did.
    """
    return f"f in {_share(fresh.shown, fresh)}"


def _share(number: int, one: Claim | Returned) -> str:
    if one.low == one.high:
        return f"{number} of {count(one.runs, 'chosen run')}"
    interval = f" ({percent(one.low)} to {percent(one.high)})" if one.runs else ""
    return f"{number} of {count(one.runs, 'fresh run')}{interval}"


def for_everyone(certificate: Certificate) -> str:
    """What a finished certificate shows, for readers who know no statistics; one sentence without a
    full stop.
    """
    left, *removals = certificate.claims
    share = f"{percent(left.low)} to {percent(left.high)} of all runs, with 95 % confidence"
    said = (
        f"It failed like this in {left.shown} of {count(left.runs, 'new run')} with nothing else "
        f"there ({share})"
    )
    if not is_minimal(certificate):
        return f"{said}, but not every part of this result has been shown"
    if not removals:
        return said
    most = max(removals, key=lambda claim: claim.high)
    one = "it" if len(removals) == 1 else "any one of them"
    if certificate.seeds:
        return f"{said}; none of the {most.runs} chosen runs failed like this without {one}"
    seldom = f"at most {most.shown}" if most.shown else "none"
    return (
        f"{said}; with {one} removed, in {seldom} of {most.runs} (at most "
        f"{percent_at_most(most.high)})"
    )


def in_another_simulator(name: str, fails: bool | None, there: Claim, here: Claim) -> str:
    """What runs `there`, in another simulator, show of what is left; without a full stop.

    The certificate says `here` of what is left. `fails` is what `rates.shows_at` says of the runs
    at the low end of its interval.
    """
    verdicts = {
        True: f"fails in {name}, too",
        False: f"does not fail in {name} as it did",
        None: f"the runs do not show whether it fails in {name} as it did",
    }
    return f"{verdicts[fails]}: {_there(there)}; by its certificate {rate(here)}"


def without_in_another_simulator(name: str, verdict: str, there: Claim) -> str:
    """What runs without a model show in another simulator, beside those of what is left there;
    without a full stop.
    """
    verdicts = {
        "needed": f"needed in {name}, too",
        "helps": f"helps in {name}",
        "rarer": f"rarer without it in {name}, too, but by how much is not shown",
        "not needed": f"seems not needed in {name}",
    }
    return (
        f"{there.without}: {verdicts.get(verdict, f'not shown for {name}')}: without it "
        f"{_there(there)}"
    )


def _there(there: Claim) -> str:
    return (
        f"f in {of_runs(there.shown, there.runs)} ({percent(there.low)} to {percent(there.high)})"
    )


def still_fails(fails: bool | None, certificate: Certificate) -> str:
    """What new runs of what is left show.

    `fails` is what `rates.shows_at` says of them at the low end of its interval, or whether it
    fails with each chosen seed.
    """
    if fails is None:
        return "the runs do not decide"
    if certificate.seeds:
        return f"it {'still fails' if fails else 'does not fail'} with each chosen seed"
    low = certificate.claims[0].low
    if fails:
        return f"it still fails, at {percent_at_least(low / 2.0)} or more"
    return f"it no longer fails at {percent(low)} or more"


def means(state: RunState, certificate: Certificate, claim: Claim) -> str:
    """What the verdict of a claim means, and what happens without a needed model where the robot
    then fails otherwise.
    """
    other = instead(state, certificate, claim)
    if other:
        return f"{meaning(claim, certificate)}; {other}"
    return meaning(claim, certificate)


def meaning(claim: Claim, certificate: Certificate) -> str:
    """What the verdict of a claim means, in plain words."""
    rate = _whole_rate(certificate)
    bound = claim.bound
    if claim.without is None and bound is not None and claim.verdict in ("not shown", "unknown"):
        return (
            f"shown to keep at least {percent_at_least(bound)} of {rate}, not "
            f"{percent_at_least(certificate.certify_rate)}"
        )
    often = "with none of these seeds" if claim.is_exact else _as_often(bound)
    return {
        "exact": f"f shows with {seeds_of(certificate)} each time",
        "kept": (
            "keeps at least "
            f"{percent_at_least(certificate.certify_rate if bound is None else bound)} of {rate}"
        ),
        "lost": f"keeps less than {percent(certificate.keep_rate)} of {rate}",
        "needed": f"needed: without it f shows {often}",
        "helps": (
            f"helps: without it f is rarer, but not by much: more than {percent(NEEDED_SHARE)} "
            "as often"
        ),
        "rarer": f"rarer without it: {'by how much is not shown' if bound == 1.0 else often}",
        "not needed": "seems not needed: without it f showed about as often",
        "not shown": "not shown: the runs are inconclusive",
        "unknown": "unknown: too many runs broke",
    }.get(claim.verdict, "")


def _whole_rate(certificate: Certificate) -> str:
    """The rate that what is left has to keep a part of."""
    if certificate.branch:
        return "the rate at the start of its branch"
    return "the whole world's rate"


def of_passing(state: RunState, one: Isolation) -> str:
    """What an isolation that has ended shows, in one sentence without a full stop."""
    if not one.checks:
        stacks = (
            stack_with(state, state.elements, state.elements[model]) for model in one.asked.suspects
        )
        return (
            "no passing world was found: the robot does not reach its goal often enough even "
            "without all "
            f"{count(len(set().union(*stacks)), 'model')} that may be removed"
        )
    check = one.checks[-1]
    gone = state.removals[check.removal - 1].models
    (first, *backs) = check.claims
    names = f"{count(len(gone), 'model')} of {len(state.elements)} ({first_of(gone, MOST_NAMES)})"
    if one.found is None:
        return f"no world is shown to pass: without {names} {_reaching(one, first)}"
    tested = "" if one.asked.chosen else f", tested above {percent(one.asked.rather_than)}"
    without = "it" if len(gone) == 1 else "them"
    said = (
        f"a nearest world that passes lacks {names}: without {without} "
        f"{_reaching(one, first)}{tested}"
    )
    verdicts = {str(claim.back): claim.verdict for claim in backs}
    if doubt := _doubt(
        verdicts,
        "not shown that each of them has to go",
        "not a nearest one: the robot seems to pass",
        "with",
    ):
        return f"{said}; {doubt} put back"
    most = max(backs, key=lambda claim: claim.high)
    back = "it" if len(backs) == 1 else f"any one of these {len(backs)}"
    if one.asked.chosen:
        return f"{said}; with {back} put back it misses its goal in a chosen run"
    return (
        f"{said}; with {back} put back in "
        f"{'' if len(backs) == 1 else 'at most '}{_share(most.reached, most)}"
    )


def _reaching(one: Isolation, claim: Returned) -> str:
    if one.asked.chosen:
        chosen = f"each of {count(len(one.asked.chosen), 'chosen run')} and in "
    else:
        chosen = ""
    return f"the robot reaches its goal in {chosen}{_share(claim.reached, claim)}"


def of_all_parts(left: Sequence[str], could_go: Sequence[str], smaller: Sequence[str]) -> str:
    """What is known of an environment that shows f where it is known of every part of the world;
    without a full stop.

    `could_go` are its models without which f still shows; `smaller` is a smaller set that shows f,
    somewhere in the world.
    """
    if could_go:
        any_one = "any one of " if len(could_go) > 1 else ""
        return f"more can go: f also shows without {any_one}{first_of(could_go, MOST_NAMES)}"
    if not left:
        return "nothing is left that can be removed"
    known = (
        "no single one can go: f is gone without "
        f"{'it' if len(left) == 1 else f'any one of these {len(left)} models'}"
    )
    if smaller:
        return f"{known}; but not the smallest: {', '.join(smaller)} show f, too"
    return f"{known}. No smaller set shows f either; only checking all sets can tell"


def usual_runs(state: RunState, now: Certificate) -> str:
    """How many runs a certificate is expected to take, such as "30 to 150 runs"."""
    low, _, high = expected_fresh_runs(state, now)
    return f"{between(low, high)} runs"


def made_of_usual(state: RunState, now: Certificate) -> str:
    """How far a certificate is: "23 of about 30 to 150 runs"."""
    return f"{fresh_runs_made(state, now)} of about {usual_runs(state, now)}"


def instead(state: RunState, certificate: Certificate, claim: Claim) -> str:
    """What mostly happens without a needed model if it is another failure: "the robot got stuck 0.5
    m from f's end in 7 of 10".
    """
    end = failing_instead(state, certificate, claim)
    if end is None:
        return ""
    away = f" {metres(end.away)} from f's end" if metres(end.away) else ""
    return f"the robot {deed(end.failure)}{away} in {end.runs} of {claim.runs}"


def short(claim: Claim) -> str:
    other_words = {"lost": "too rare", "not needed": "seems not needed", "unknown": "tests broke"}
    return other_words.get(claim.verdict, claim.verdict)


def terms(certificate: Certificate, pinned: int = 0) -> str:
    """What a certificate asks for, in one sentence without a full stop."""
    if certificate.seeds:
        return (
            "they measure how often what is left shows f with seeds other than "
            f"{seeds_of(certificate)}"
        )
    aim = f"{percent_at_least(certificate.certify_rate)} of {_whole_rate(certificate)}"
    return (
        f"they have to show that what is left keeps {aim}, and that removing {_any_one(pinned)} "
        "makes f rarer"
    )


def promise(state: RunState, certificate: Certificate) -> str:
    """What "minimal" means by a certificate of a run, in one sentence without a full stop."""
    if certificate.seeds:
        return (
            "minimal means: for the chosen seeds this is exact, since a seed repeats its run "
            "exactly; for other seeds, fresh runs measure how often f shows, and nothing more"
        )
    kept = f"{percent_at_least(_kept(certificate))} of {_whole_rate(certificate)}"
    pinned = never_left_out(state, certificate)
    often = _as_often(_at_most(certificate))
    return (
        f"minimal means: what is left keeps at least {kept}; with {_any_one(pinned)} removed, f "
        f"shows {often}; "
        f"the chance that this is wrong is at most {math.ceil(1000 * certificate.error) / 10:g} %"
    )


def _any_one(pinned: int) -> str:
    if pinned:
        return f"any one model that is not pinned ({_stayed(pinned)})"
    return "any one model"


def ended(state: RunState) -> str:
    """Why a finished run ended, without a full stop; it says so where no fresh runs show what the
    result is worth.
    """
    said = (state.reason, "" if state.baseline is None else missing(state), smaller_known(state))
    return "; ".join(words for words in said if words)


def smaller_known(state: RunState) -> str:
    """That a smaller environment is known to show f, which the search may not take, and where it
    is; "" if there is none.
    """
    left = len(state.environment)
    nodes = [
        (
            len(node.environment),
            f"#{node.number} in the history{', taken back' if node.rejected else ''}",
        )
        for node in state.nodes
        if node.shown
        and not node.lost_rate
        and len(node.environment) < left
        # The same failures count as f there as now.
        and failures_at(state, node.number) == state.failures
    ]
    trials = [
        (one.size, one.label)
        for one in state.trials
        if one.size < left and one.verdict == "similar"
        # Verdicts may stand although f is another failure by now.
        if any(test.shows_f for test in state.tests_of(one.tests))
    ]
    if not nodes and not trials:
        return ""
    size, where = min((*nodes, *trials), key=lambda each: each[0])
    return f"a smaller environment is known to show f: {count(size, 'model')} ({where})"


def shape_doubts(state: RunState) -> Sentences:
    """On models that are left, and whose shapes are only nearly those of their files."""
    doubts = (words for about, words in state.notes if about in ("pieces", "terrain"))
    return tuple(map(as_sentence, doubts))


def missing(state: RunState) -> str:
    """Why the current environment has no finished certificate; "" if it has one."""
    if current(state) is not None:
        return ""
    if state.certificate is None:
        return "no fresh runs were made"
    return "its certificate is not finished"


def drift(state: RunState) -> Sentences:
    """How often f showed in the current environment and where it was seen first, from all runs;
    shorter and shorter forms.

    Empty in the whole world, and where a certificate says more.
    """
    here = state.here
    if here is None or not here.runs or current(state) is not None:
        return ()
    whole = origin(state, here.number)
    if whole is here:
        return ()
    long, brief = (
        ("in the whole world", "whole world")
        if whole.parent is None
        else ("where the branch began", "first")
    )
    return (
        f"f in {seen(here)} here, {seen(whole)} {long}",
        f"f {here.shown}/{len(here.runs)} here, {whole.shown}/{len(whole.runs)} {brief}",
        f"f {here.shown}/{len(here.runs)} here",
    )


def seen(node: Node) -> str:
    """How often f showed in an environment, from all runs so far; "" without runs."""
    if node.runs:
        return f"{node.shown} of {len(node.runs)}"
    return ""


def of_runs(shown: int, runs: int) -> str:
    """3 of 5 runs."""
    return f"{shown} of {count(runs, 'run')}"
