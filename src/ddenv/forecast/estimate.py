"""How many tests a reduction will take, and how many are left of one: it is played often, each time with other needed models."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from random import Random
from typing import Any

from ddenv.forecast.rehearse import Begun, Method, Play, ddenv, running_sum
from ddenv.forecast.rehearse_others import ddmin, splitting
from ddenv.runfile.settings import settings
from ddenv.runfile.state import RunState

# How likely one, two, ... models are needed of a world of up to so many; more in a larger one.
NEEDED, SMALL_WORLD = (10, 24, 22, 16, 11, 7, 5, 3, 2), 40
# How often a reduction is played: so often, or fewer times once there were so many rounds in all, but at least so often.
BEFORE, DURING = (150, 1600, 12), (60, 500, 6)
# The interval holds eight of ten plays. While a run is under way it is made wider: what was tested earlier is not all known here.
PARTS, WIDER = (0.1, 0.5, 0.9), (0.75, 1.0, 1.2)
# Of what is left after some reductions, the needed models are the nearest in so many of ten plays: the others went first.
NEAREST = 0.7
# In worlds with more models, not every verdict is worth a new estimate.
LARGE_WORLD, VERDICTS = 400, 8
# The share of the models that are near where the robot stood still.
STILL = (0.3, 0.9)
# Nobody asks for more runs than this, or begins with more parts.
MOST_NUMBER = 10_000
# More needed models than this take too long to play.
MOST_NEEDED = 60
# The latest tests tell how long one takes; workers wait for each other for some of the time.
LATEST, BUSY = 50, 0.9

Three = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Expected:
    """Tests of a reduction, without the baseline's: in one of ten cases fewer than `tests_low`, in one more than `tests_high`."""

    tests_low: int
    tests: int
    tests_high: int


@dataclass(frozen=True, slots=True)
class Remaining:
    """What is left from now on, as (low, middle, high). `seconds` is None while nothing is run."""

    tests: tuple[int, int, int]
    seconds: Three | None


def expect(
    models: int,
    algorithm: str,
    pair: str,
    iterations: int,
    rate: float = 1.0,
    needed: int = 0,
    *,
    growth: str = "paper",
    skip: str = "known",
    candidates: str = "both",
    complement_order: str = "paper",
    n_partitions: int = 2,
    jobs: int = 1,
) -> Expected:
    """What a reduction of so many `models` will take, if f shows in `rate` of the runs; at least so many are `needed`."""
    near, far_first = _near(pair), complement_order == "far-first"
    method = Method(algorithm, iterations, _fair(rate), near, growth, skip, candidates, far_first, jobs, _by_time(pair))
    played = _played(_Moment(method, models, models, n_partitions, min(needed, MOST_NEEDED)), BEFORE)
    low, middle, high = played or (0.0, 0.0, 0.0)
    return Expected(math.floor(low), round(middle), math.ceil(high))


def remaining(state: RunState, at_work: bool) -> Remaining | None:
    """What is left of a run; None before it began, when it ended, and while what is left is confirmed.

    Without an engine `at_work` nothing runs, and nobody can tell how long it will take.
    """
    if state.ended or state.confirming or state.status == "created" or not state.environment:
        return None
    moment, done = _moment(state)
    left = _played(moment, DURING)
    if left is None:
        return None
    running = len(state.running_tests) if at_work else 0
    tests = [max(running, part * wider - done) for part, wider in zip(left, WIDER, strict=True)]
    if state.baseline is None:
        runs = _whole(settings(state).baseline_runs, 0, 10)
        tests = [each + max(0, runs - state.tests_done) for each in tests]
    if state.budget is not None:
        tests = [min(each, max(0, state.budget - state.tests_done)) for each in tests]
    low, middle, high = math.floor(tests[0]), math.floor(tests[1] + 0.5), math.ceil(tests[2])
    return Remaining((low, middle, high), _seconds(state, at_work, (low, middle, high)))


@dataclass(frozen=True, slots=True)
class _Moment:
    """Where a reduction stands: `size` models are left of `whole`. Of the current round of `state`, which all else is taken from,
    the first `judged` candidates have a verdict; -1 if the next round is to come.
    """

    method: Method
    whole: int
    size: int
    n: int
    least: int
    round: int = 0
    judged: int = -1
    state: RunState | None = field(default=None, compare=False)


def _moment(state: RunState) -> tuple[_Moment, int]:
    """Where the run stands, and how many tests of candidates without a verdict are finished."""
    method, whole, now = _method(state), len(state.elements), state.round
    size, least = len(state.environment) - len(state.pinned.intersection(state.environment)), state.lower_bound
    if now is None:
        return _Moment(method, whole, size, _whole(_reduction(state).get("n_partitions"), 2, 2), least), 0
    taken = now.winner if now.winner is not None else state.waiting_candidate
    if now.done or taken is not None:
        n = now.n_partitions + (taken is None or method.growth == "paper")
        size = size if taken is None or now.done else now.candidates[taken].size - len(now.split.pinned)
        return _Moment(method, whole, size, n, least, now.number), 0
    judged = next((each.index for each in now.candidates if not each.verdict), len(now.candidates))
    done = _finished(state, islice(now.candidates, judged, judged + method.jobs + 1))
    judged -= judged % VERDICTS if whole > LARGE_WORLD else 0
    return _Moment(method, whole, size, now.n_partitions, least, now.number, judged, state), done


def _begun(moment: _Moment) -> tuple[Begun | None, list[tuple[int, int]]]:
    """The round that is under way, and places of which one at least is needed, each from one up to another."""
    state = moment.state
    if moment.method.algorithm != "ddenv" or state is None or moment.judged < 0:
        return None, []
    sizes, closed = tuple(map(len, state.round.partitions)), state.round.candidates[: moment.judged]
    # A model was pinned or unpinned: the next round knows.
    if sum(sizes) != moment.size:
        return None, []
    failed = {each.partition for each in closed if each.kind == "complement" and each.verdict == "dissimilar"}
    ends = running_sum(sizes)
    # Models that went one by one were all tried alone before.
    before = state.history[-2].models if len(state.history) > 1 else 0
    alone = len(sizes) == moment.size and 0 <= before - len(state.environment) <= 1
    begun = Begun(sizes, frozenset((each.kind, each.partition) for each in closed), alone)
    return begun, [(ends[part], ends[part + 1]) for part in sorted(failed)]


def _finished(state: RunState, candidates: Any) -> int:
    tests = [state.tests[id - 1] for each in candidates for id in each.tests if 0 < id <= len(state.tests)]
    return sum(test.is_finished for test in tests)


def _method(state: RunState) -> Method:
    options, more = settings(state), _reduction(state)
    rate = state.baseline.rate if state.baseline is not None else 1.0
    return Method(
        algorithm=options.algorithm,
        iterations=_whole(options.iterations, 0, 3),
        rate=_fair(rate),
        near=_near(options.pair),
        growth=options.growth,
        skip=str(more.get("skip", "known")),
        candidates=str(more.get("candidates", "both")),
        far_first=more.get("complement_order") == "far-first",
        jobs=max(1, state.jobs),
        by_time=_by_time(options.pair),
    )


def _near(pair: str) -> bool:
    """Whether the needed models come first: what the robot met is near f, too."""
    return pair.endswith(("-proximal", "/timestep"))


def _by_time(pair: str) -> bool:
    return pair.startswith(("timeseg/", "trajectoryseg/"))


def _reduction(state: RunState) -> dict[str, Any]:
    found = state.scenario.get("reduction")
    return found if isinstance(found, dict) else {}


def _whole(value: Any, least: int, standard: int) -> int:
    """A number from a run file, if it makes sense."""
    return value if isinstance(value, int) and least <= value <= MOST_NUMBER else standard


def _fair(rate: float) -> float:
    """A few runs of the whole world do not tell more."""
    return min(1.0, max(0.2, rate))


@lru_cache(maxsize=32)
def _played(moment: _Moment, limits: tuple[int, int, int]) -> Three | None:
    """Tests that are left, from `moment` on; None where so many models are needed that playing takes long."""
    if moment.size < 1:
        return 0.0, 0.0, 0.0
    begun, sure = _begun(moment)
    if max(len(sure), moment.least) > MOST_NEEDED:
        return None
    most, most_rounds, fewest = limits
    random, counts, rounds = Random(moment.whole), [], 0
    while len(counts) < most and (rounds < most_rounds or len(counts) < fewest):
        play = Play(random, moment.method, moment.size, _places(random, moment, sure), moment.n)
        if moment.method.by_time:
            play.still = round(random.uniform(*STILL) * moment.size)
        counts.append(_tests(play, begun))
        rounds += play.rounds
    counts.sort()
    low, middle, high = (counts[round(part * (len(counts) - 1))] for part in PARTS)
    return low, middle, high


def _tests(play: Play, begun: Begun | None) -> float:
    match play.method.algorithm:
        case "ddmin":
            return ddmin(play)
        case "probdd" | "splitting":
            return splitting(play)
    return ddenv(play, begun)


def _places(random: Random, moment: _Moment, sure: Sequence[tuple[int, int]]) -> list[int]:
    """Where the needed models stand in the line: most of them near its beginning, if that is near f; some for `sure`."""
    models, algorithm = moment.size, moment.method.algorithm
    places = {random.randrange(begin, end) for begin, end in sure}
    count = max(len(places), _needed(random, moment))
    near = algorithm != "ddmin" and (moment.method.near or algorithm in ("probdd", "splitting"))
    others_went = algorithm == "ddenv" and not moment.method.far_first
    first = others_went and random.random() < NEAREST * (1 - models / moment.whole)
    scale = 10 ** random.uniform(-3.0, -1.0)
    for place in range(count if near else 0):
        # In a plane, the rank grows with the square of the distance.
        drawn = int(models * scale * random.gammavariate(2, 1) ** 2) if not first else place
        if drawn < models and len(places) < count and (not first or random.random() < 0.8):
            places.add(drawn)
    while len(places) < count:
        places.add(random.randrange(models))
    return sorted(places)


def _needed(random: Random, moment: _Moment) -> int:
    """How many models are needed."""
    more = max(0, round(math.log10(moment.whole / SMALL_WORLD)))
    numbers = range(1 + more, 1 + more + len(NEEDED))
    weights = [
        weight if moment.least <= number <= moment.size else 0 for number, weight in zip(numbers, NEEDED, strict=True)
    ]
    if any(weights):
        return random.choices(numbers, weights)[0]
    return min(moment.size, max(1, moment.least))


def _seconds(state: RunState, at_work: bool, tests: Sequence[int]) -> Three | None:
    if not at_work or state.paused or state.waiting_candidate is not None:
        return None
    finished = (test.wall_seconds for test in islice(reversed(state.tests), 2 * LATEST) if test.is_finished)
    times = [each for each in islice(finished, LATEST) if each > 0]
    if not times:
        return None
    each = sum(times) / len(times) / (1 + BUSY * (max(1, state.jobs) - 1))
    low, middle, high = (number * each for number in tests)
    return low, middle, high
