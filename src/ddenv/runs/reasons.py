"""Why what is left makes the robot fail: what happens without each of its models, from the
certificate's fresh runs alone; and the nearest world that passes.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from ddenv.errors import UserError
from ddenv.evidence.claims import current, is_nearest, runs_behind
from ddenv.evidence.rates import anytime_interval
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import COLUMNS, RunFile
from ddenv.runfile.supports import stack_with
from ddenv.text import Names, coordinates, count, first_of, percent
from ddenv.words.claims import of_passing, uncertified, verdict_on
from ddenv.world.pose import Point

# What a run shows, beside f ("similar"): the robot reached its goal, or it failed otherwise.
F = "similar"
GOAL = "pass"
# What the robot does, by the `failure` of a run.
DOES = {
    "stuck": "gets stuck",
    "tipped over": "tips over",
    "fell": "falls",
    "lost": "is lost",
    "out of time": "runs out of time",
}
# Runs that end within this distance of one place end near it, m.
NEAR = 0.5
# Two runs have visibly parted when the robots are this far from each other, m.
APART = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """A way in which `number` runs ended, after `seconds` of simulated time (their median) at
    `place`, x and y, m (medians).

    None of them ended farther than `reach`, m, from there. They ended so far `away` from f's end, m
    (median). `kind` is `F`, `GOAL`, or the `failure` of a run that ended otherwise.
    """

    kind: str
    number: int
    seconds: float
    place: Point
    reach: float = 0.0
    away: float = math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Divergence:
    """Where two runs with the same seed part: one of what is left, which shows f, and one without a
    model.

    The robot moves alike to the last bit until `equal`, s, and is `APART` at `apart`, s, at
    `place`, x and y, m; None if it never is. It touched the model, or else sensed it, for the first
    time at `met`, s; None if it did not.
    """

    with_test: int
    without_test: int
    seed: int
    equal: float
    apart: float | None
    place: Point | None
    met: float | None
    touched: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """What happens without the model `without` and what rests on it, all of `gone`.

    `ends` are those of the `runs` fresh runs (`exact`: of the chosen runs), the most frequent one
    first. `parting` is None where no pair of runs shows it; `lacks` says why, if the run file does
    not have what it takes.
    """

    without: str
    gone: Names
    runs: int
    ends: tuple[End, ...]
    parting: Divergence | None
    lacks: str = ""
    exact: bool = False


def reasons(file: RunFile, state: RunState) -> tuple[Reason, ...]:
    """A reason for each model that the current certificate left out. Raises UserError where there
    is none.
    """
    certificate = current(state)
    if certificate is None:
        raise UserError(uncertified(state, file.path))
    end, *removals = certificate.claims
    left = {test.run: test for test in runs_behind(state, certificate, end) if test.outcome == F}
    found = []
    for claim in removals:
        mine = runs_behind(state, certificate, claim)
        kinds: dict[str, list[Test]] = {}
        for test in mine:
            kinds.setdefault(_kind(test), []).append(test)
        ends = sorted(
            (_end(kind, them) for kind, them in kinds.items()), key=lambda end: -end.number
        )
        gone = tuple(
            stack_with(state, state.nodes[certificate.node].environment, str(claim.without))
        )
        # Also where it mostly still fails as in f: what it does else shows what the model is needed
        # for.
        shown = next((end.kind for end in ends if end.kind != F), None)
        pairs = (
            (left[test.run], test) for test in mine if test.run in left and _kind(test) == shown
        )
        parting, _, lacks = parting_of(file, next(pairs, None), gone)
        exact = bool(certificate.seeds)
        found.append(
            Reason(
                without=str(claim.without),
                gone=gone,
                runs=len(mine),
                ends=tuple(ends),
                parting=parting,
                lacks=lacks,
                exact=exact,
            )
        )
    return tuple(found)


def no_reasons(certificate: Certificate) -> str:
    """Why a finished certificate left out no model, in a sentence."""
    if certificate.claims[0].verdict == "kept":
        return "No model is left to leave out, so there is nothing to compare."
    return (
        "What the robot does without each model is not known, because none was left out: "
        f"{verdict_on(certificate)}."
    )


def _kind(test: Test) -> str:
    if test.outcome in (F, GOAL):
        return test.outcome
    return test.failure


def _end(kind: str, tests: Sequence[Test]) -> End:
    places = [test.end_pose[:2] for test in tests if test.end_pose is not None] or [
        (math.nan, math.nan)
    ]
    x, y = (median(place[axis] for place in places) for axis in range(2))
    reach = max(math.dist((x, y), place) for place in places)
    away = median([test.distance for test in tests if test.distance is not None] or [math.nan])
    return End(
        kind=kind,
        number=len(tests),
        seconds=median(test.simulated_seconds for test in tests),
        place=(x, y),
        reach=reach,
        away=away,
    )


def parting_of(
    file: RunFile, pair: tuple[Test, Test] | None, gone: Sequence[str]
) -> tuple[Divergence | None, str, str]:
    """Where two tests part, one with the models `gone` and one without them; which of these took
    part first, "" if none did; and what the run file lacks to say so. None where there is no such
    `pair`.
    """
    if pair is None:
        return None, "", ""
    with_it, without = pair
    try:
        equal, apart, place = parted(file.trajectory(with_it.id), file.trajectory(without.id))
    except UserError as error:
        return None, "", str(error)
    touched = {model: at for model, at in with_it.first_touched if model in gone}
    met = touched or {model: at for model, at in with_it.first_sensed if model in gone}
    first = min(met, key=met.__getitem__, default="")
    parting = Divergence(
        with_test=with_it.id,
        without_test=without.id,
        seed=with_it.seed,
        equal=equal,
        apart=apart,
        place=place,
        met=met.get(first),
        touched=bool(touched),
    )
    return parting, first, ""


def parted(first: array[float], second: array[float]) -> tuple[float, float | None, Point | None]:
    """Until when two trajectories (flat rows of `COLUMNS`) are equal, s; when and where the second
    is `APART` from the first.
    """
    equal = 0.0
    same = True
    for row in range(0, min(len(first), len(second)), COLUMNS):
        one = first[row : row + COLUMNS]
        other = second[row : row + COLUMNS]
        same = same and one == other
        if same:
            equal = one[0]
        elif math.dist(one[1:3], other[1:3]) >= APART:
            return equal, other[0], (other[1], other[2])
    return equal, None, None


def sentence(reason: Reason) -> str:
    """What happens without the models, in one sentence, from the runs that show it."""
    if len(reason.gone) > 1:
        others = f" and what rests on it ({count(len(reason.gone) - 1, 'model')})"
    else:
        others = ""
    without = f"Without {reason.without}{others}"
    kind = "chosen run" if reason.exact else "fresh run"
    if not reason.ends:
        return f"{without}: no {kind} ended."
    most, *rarer = reason.ends
    low, high = anytime_interval(most.number, reason.runs)
    interval = "" if reason.exact else f", {percent(low)} to {percent(high)}"
    share = f"{most.number} of {count(reason.runs, kind)}{interval}"
    more = "".join(f"; it {_does(end)} in {end.number}" for end in rarer)
    return f"{without} the robot {_does(most)} ({share}){more}."


def _does(end: End) -> str:
    if end.kind == GOAL:
        return f"reaches its goal after {end.seconds:.0f} s"
    if end.kind == F:
        return "still fails as in f"
    # Rounded up: no run ends farther away than is said.
    near = "near" if end.reach <= NEAR else f"at most {math.ceil(10 * end.reach) / 10:.1f} m from"
    away = "elsewhere" if math.isnan(end.away) else f"{end.away:.1f} m from f's end"
    return f"{DOES.get(end.kind, 'fails')} {away}, {near} ({coordinates(end.place)}) m"


def parting_sentence(reason: Reason) -> str:
    """Where the paths with and without the models diverge, in one or two sentences; "" if no pair
    of runs shows it.
    """
    it = "it" if len(reason.gone) == 1 else "one of them"
    return parting_words(reason.parting, reason.lacks, f"With {it} there,", it)


def parting_words(one: Divergence | None, lacks: str, met: str, it: str = "it") -> str:
    """When two runs begin to differ, and when and where they are visibly apart, or why that is not
    known; then a sentence that begins with `met`, if the robot met `it`.
    """
    if one is None:
        if lacks:
            return f"Where the paths diverge is not known: {lacks}."
        return ""
    if one.apart is None or one.place is None:
        # Their ways may be equal to the end.
        equal = f" equal until {one.equal:.1f} s, and" if one.equal else ""
        words = f"With seed {one.seed} the two runs are{equal} never {APART:g} m apart."
    else:
        start = "from the start" if not one.equal else f"after {one.equal:.1f} s"
        apart = f"{APART:g} m apart after {one.apart:.1f} s, at ({coordinates(one.place)}) m"
        words = f"With seed {one.seed} the two runs differ {start}, and are {apart}."
    if one.met is not None:
        words += (
            f" {met} the robot {'touches' if one.touched else 'senses'} {it} after {one.met:.1f} s."
        )
    return words


# The nearest world that passes, beside the whole world that fails.


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearest:
    """The nearest world that passes: the whole world without the models `gone`.

    `words` say what fresh runs show of it, in one sentence. `shown`: they show that it passes, and
    that it does not with any one of `gone` put back. `parting` compares a run of the whole world,
    `with_test`, with one without `gone`; None where no pair of runs with one seed shows it; `lacks`
    says why, if the run file does not have what it takes. `first` of `gone` took part first there.
    """

    gone: Names
    words: str
    shown: bool
    parting: Divergence | None = None
    first: str = ""
    lacks: str = ""

    @property
    def sentences(self) -> str:
        """All of it in a few sentences."""
        said = f"{self.words[:1].upper()}{self.words[1:]}."
        met = (
            f"Of the removed models, {first_of((self.first,), 1)} is the first that can affect "
            "the run:"
        )
        return f"{said} {parting_words(self.parting, self.lacks, met)}".rstrip()


def nearest(file: RunFile, state: RunState) -> Nearest | None:
    """What the last isolation found; None if there was none, or if it did not end."""
    one = state.isolated
    if one is None:
        return None
    words = of_passing(state, one)
    shown = is_nearest(one)
    if one.found is None:
        return Nearest(gone=(), words=words, shown=shown)
    gone = state.removals[one.found - 1].models
    # A run of the whole world that fails, if possible as in f, and one of its seed, in the passing
    # world, that does not.
    passing = {
        test.run: test for test in state.tests if test.removal == one.found and test.outcome == GOAL
    }
    whole = [test for test in state.tests if test.run in passing and test.environment == 0]
    failing = [test for test in whole if test.outcome in (F, "other")]
    chosen = min(failing, key=lambda test: (test.outcome != F, test.cut, test.id), default=None)
    parting, first, lacks = parting_of(
        file, None if chosen is None else (chosen, passing[chosen.run]), gone
    )
    return Nearest(gone=gone, words=words, shown=shown, parting=parting, first=first, lacks=lacks)


def removed_in_passing(state: RunState, where: object) -> Names:
    """The models that the nearest world that passes lacks. Raises UserError where there is no such
    world yet.
    """
    one = state.isolated
    if one is None:
        raise UserError(
            f"{where}: no world that passes is known yet; find the nearest one first: ddenv "
            f"isolate {where}"
        )
    if one.found is None:
        raise UserError(f"{where}: {of_passing(state, one)}")
    return state.removals[one.found - 1].models
