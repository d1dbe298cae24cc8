"""The figures in a lesson's texts: `{names}` from a closed set, over the recorded runs. Nothing is
ever computed from a text.

`{without NAME}` and `{verdict on NAME}` are a certificate's claim about a model, `{here_bound
without NAME}` is what is shown of it at the place of the step. `{rate of NAME, NAME}` is the rate
that an oracle knows, `{chance of NAME, NAME}` the chance that one of a candidate's runs shows f.
`{OTHER.name}` is a figure of a run beside the lesson's own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ddenv.errors import UserError
from ddenv.evidence.certificate import NEEDED_SHARE
from ddenv.evidence.claims import so_far
from ddenv.evidence.rates import anytime_interval, miss_chance
from ddenv.learn.attempt import Oracle
from ddenv.runfile.failure_words import deed
from ddenv.runfile.progress import Certificate, Claim, Node
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import CERTIFY, RunState
from ddenv.schemas import nearest
from ddenv.text import first_of, percent, percent_at_least, percent_at_most
from ddenv.words import claims
from ddenv.words.slices import slice_words

# Terms that contain a digit.
TERMS = ("1-minimal", "Algorithm 1", "(1 − rate)")
_FIGURE = re.compile(r"\{([^{}]*)\}")
_NAMED = 8


def _certificate(state: RunState) -> Certificate | None:
    """The last finished certificate, also one of an environment that the run has left since."""
    return next((each for each in reversed(state.certificates) if each.claims), None)


def _fresh(state: RunState) -> str:
    found = _certificate(state)
    if found is None:
        return "no fresh run"
    return claims.rate(found.claims[0])


def _fresh_whole(state: RunState) -> str:
    """How often f showed in the whole world, by the same certificate, if it did not only run where
    what is left missed f.
    """
    found = _certificate(state)
    if found is None:
        return "no fresh run"
    tests = [
        test
        for test in state.tests
        if test.phase == CERTIFY and test.run >= found.first_run and test.without is None
    ]
    whole = [test for test in tests if test.node == 0]
    outcomes = [test.outcome for test in whole if test.outcome in ("similar", "other", "pass")]
    if not outcomes or {test.run for test in whole} < {
        test.run for test in tests if test.node == found.node
    }:
        return "no fresh run"
    shown = outcomes.count("similar")
    runs = len(outcomes)
    low, high = anytime_interval(shown, runs)
    claim = Claim(without=None, verdict="", shown=shown, runs=runs, low=low, high=high)
    return claims.rate(claim)


def _now(state: RunState) -> Certificate:
    """The certificate that is made, or was made last. Raises UserError before the first."""
    if state.certificate is None:
        raise UserError("no certificate has begun at this step")
    return state.certificate


def _bound(state: RunState, without: str | None = None) -> str:
    """What it has shown by now of what is left, or of that without a model. Raises UserError if it
    has not left that out.
    """
    now = _now(state)
    made = {claim.without: claim for claim in now.claims}
    claim = made.get(without) if made else so_far(state, now).get(without)
    if claim is None:
        raise UserError(f"at this step, no fresh run has yet left '{without}' out")
    if without is None:
        return percent_at_least(claim.bound or 0.0)
    return percent_at_most(claim.bound or 0.0)


def _left(state: RunState) -> str:
    now = _now(state)
    runs = [
        test for test in state.confirm_tests if test.run >= now.first_run and test.without is None
    ]
    ended = [test.outcome for test in runs if test.node == now.node and test.is_finished]
    return claims.of_runs(ended.count("similar"), len(ended))


def _of_baseline(state: RunState, name: str) -> str:
    if state.baseline is None:
        return ""
    return percent(getattr(state.baseline, name))


def _first_slice(state: RunState) -> Node | None:
    return next((node for node in state.nodes if node.how == "sliced"), None)


# Over the whole run, from its end.
OF_RUN: dict[str, Callable[[RunState], object]] = {
    "models": lambda state: len(state.elements),
    "left": lambda state: len(state.environment),
    "smaller": lambda state: (
        f"{100 - round(100 * len(state.environment) / max(1, len(state.elements)))} %"
    ),
    "kept": lambda state: first_of(list(state.environment), _NAMED),
    "tests": lambda state: state.tests_done,
    "search_tests": lambda state: sum(
        test.phase == "round" and test.is_finished for test in state.tests
    ),
    "fresh_tests": lambda state: sum(test.phase == "certify" for test in state.tests),
    "reruns": lambda state: state.deflake_runs,
    "rounds": lambda state: state.rounds_done,
    "failed_runs": lambda state: 0 if state.baseline is None else state.baseline.failures,
    "baseline_runs": lambda state: 0 if state.baseline is None else state.baseline.runs,
    "iterations": lambda state: settings(state).iterations,
    "epsilon": lambda state: f"{settings(state).epsilon:g} m",
    "failure": lambda state: deed(state.failure),
    "runs_each": lambda state: 1 + settings(state).iterations,
    "rate": lambda state: _of_baseline(state, "rate"),
    "rate_low": lambda state: _of_baseline(state, "low"),
    "rate_high": lambda state: _of_baseline(state, "high"),
    "miss_chance": lambda state: (
        ""
        if state.baseline is None
        else percent(miss_chance(state.baseline.rate, settings(state).iterations))
    ),
    "keep_rate": lambda state: percent(settings(state).keep_rate),
    "needed_share": lambda state: percent(NEEDED_SHARE),
    "certificates": lambda state: sum(bool(each.claims) for each in state.certificates),
    "fresh": _fresh,
    "fresh_whole": _fresh_whole,
    "error": lambda state: (
        f"{math.ceil(1000 * found.error) / 10:g} %"
        if (found := _certificate(state)) is not None
        else ""
    ),
    "reason": lambda state: f"{state.reason[:1].upper()}{state.reason[1:]}",
    "sliced": lambda state: len(
        state.elements if (node := _first_slice(state)) is None else node.environment
    ),
    "slice": lambda state: (
        "nothing was removed without testing"
        if (node := _first_slice(state)) is None
        else slice_words(state, node)
    ),
    "audit": lambda state: settings(state).audit,
    "subsets": lambda state: (
        f"{2 ** len(state.elements):,}" if len(state.elements) < 30 else "countless"
    ),
}
# At the place of the step.
HERE: dict[str, Callable[[RunState], object]] = {
    "here_models": lambda state: len(state.environment),
    "here_tests": lambda state: state.tests_done,
    "here_round": lambda state: 0 if state.round is None else state.round.number,
    "here_n": lambda state: 0 if state.round is None else state.round.n_partitions,
    "here_parts": lambda state: 0 if state.round is None else len(state.round.partitions),
    "here_candidates": lambda state: 0 if state.round is None else len(state.round.candidates),
    "here_kept": lambda state: first_of(list(state.environment), _NAMED),
    "here_aim": lambda state: percent_at_least(_now(state).certify_rate),
    "here_left": _left,
    "here_bound": _bound,
    "here_fresh": _fresh,
    "here_fresh_whole": _fresh_whole,
}
# From the oracle that knows every part of the world.
OF_ORACLE: dict[str, Callable[[Oracle], object]] = {
    "failing": lambda oracle: len(oracle.showing),
    "minimal_sets": lambda oracle: len(oracle.minimal),
    "smallest": lambda oracle: min(map(len, oracle.minimal), default=0),
    "smallest_set": lambda oracle: ", ".join(oracle.minimal[0] if oracle.minimal else ()),
}


# The rates that the oracle knows: of the whole world, at the place of the step, and at the run's
# end.
TRUE_RATES = ("whole_rate", "here_rate", "end_rate")
# Figures about one model, or about a set of them.
_ABOUT_CLAIM = re.compile(r"(without|verdict on|here_bound without) (\S.*)")
_BESIDE = re.compile(r"([\w-]+)\.(.+)")
_OF_SET = re.compile(r"(rate|chance) of (\S.*)")
NAMES = (*OF_RUN, *HERE, *OF_ORACLE, *TRUE_RATES)


def check(text: str) -> None:
    """Raises UserError if `text` has a digit of its own, or a name that is not known."""
    for name in _FIGURE.findall(text):
        other, bare = _parts(name)
        about = _ABOUT_CLAIM.fullmatch(bare) or _OF_SET.fullmatch(name)
        if bare not in (OF_RUN if other else NAMES) and not about:
            meant = nearest(name, NAMES) or f"; known figures are {', '.join(NAMES)}"
            raise UserError(f"unknown figure '{{{name}}}'{meant}")
    bare = _FIGURE.sub("", text)
    for term in TERMS:
        bare = bare.replace(term, "")
    if found := re.search(r"\S*\d\S*", bare):
        raise UserError(
            f"'{found[0]}' is a bare figure; write one of the {{names}}, so that it stays true"
        )
    if found := re.search(r"[{}]", bare):
        raise UserError(f"a single '{found[0]}'; figures are {{names}} between braces")


def _parts(name: str) -> tuple[str, str]:
    """The run beside the lesson's own that a name is about, or "", and the rest."""
    found = _BESIDE.fullmatch(name)
    if found:
        return (found[1], found[2])
    return ("", name)


def filled(text: str, value: Callable[[str], str]) -> str:
    """`text` with its figures: `value` says what a name stands for."""
    return _FIGURE.sub(lambda found: value(found[1]), text)


@dataclass(frozen=True)
class Figures:
    """What names stand for in a step: `end` is the state at the run's end, `here` at the step's
    place, `others` have the ends of other runs by name.
    """

    end: RunState
    here: RunState
    oracle: Oracle | None = None
    others: Mapping[str, RunState] = field(default_factory=dict)

    def __call__(self, name: str) -> str:
        """Raises UserError where the run or the oracle does not know it."""
        other, bare = _parts(name)
        if other and other not in self.others:
            raise UserError(
                f"{{{name}}}: the lesson has no run '{other}' beside its own; give it under the "
                "key 'beside'"
            )
        end = self.others[other] if other else self.end
        if bare in OF_RUN:
            return str(OF_RUN[bare](end))
        if bare in HERE:
            return str(HERE[bare](self.here))
        if about := _ABOUT_CLAIM.fullmatch(bare):
            if about[1] == "here_bound without":
                return _bound(self.here, about[2])
            claim = _claim_without(end, about[2])
            return claims.rate(claim) if about[1] == "without" else claims.short(claim)
        if self.oracle is None:
            raise UserError(f"{{{name}}} needs an oracle; give the key 'oracle'")
        return self._of_oracle(bare, self.oracle)

    def _of_oracle(self, name: str, oracle: Oracle) -> str:
        if name in TRUE_RATES:
            sets = (self.end.elements, self.here.environment, self.end.environment)
            return percent(oracle.rate(sets[TRUE_RATES.index(name)]))
        of_set = _OF_SET.fullmatch(name)
        if of_set is None:
            return str(OF_ORACLE[name](oracle))
        rate = oracle.rate(of_set[2].split(", "))
        if of_set[1] == "rate":
            return percent(rate)
        return percent(1 - miss_chance(rate, settings(self.end).iterations))


def _claim_without(state: RunState, model: str) -> Claim:
    """What the last certificate claims of what is left without `model`. Raises UserError."""
    made = _certificate(state)
    for claim in made.claims if made else ():
        if claim.without == model:
            return claim
    raise UserError(f"{{without {model}}}: the last certificate says nothing about '{model}'")
