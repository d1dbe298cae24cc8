"""How a run reduces its world: the algorithm's listing, what it uses of the pair, and the explanations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from ddenv.runfile.run_settings import Settings
from ddenv.runfile.state import Round
from ddenv.schemas import BOTH, Kind, explanation, names, uses
from ddenv.text import count, plain

Step = Literal["baseline", "split", "next", "test", "rerun", "waiting", "reduced", "nothing", "returned"]
Lines = tuple[tuple[int, str], ...]

# Before any algorithm begins.
FIX_F = (0, "f ← failure of R(E, goal, timeout), several runs")


@dataclass(frozen=True, slots=True)
class Listing:
    """`lines` with their numbers; the line of each step; `sweep` is the one that leaves out each model in turn at the end."""

    lines: Lines
    split: int
    next: int
    test: int
    rerun: int
    waiting: int
    reduced: int
    nothing: int
    returned: int
    sweep: int | None = None
    baseline: int = 0

    def line(self, step: Step, current: Round | None) -> int:
        """The line of a step in the round `current`."""
        if self.sweep is not None and step not in ("baseline", "returned") and is_sweep(current):
            return self.sweep
        line: int = getattr(self, step)
        return line


def is_sweep(current: Round | None) -> bool:
    """Whether the round leaves out each model in turn."""
    if current is None or not current.candidates or len(current.candidates) != len(current.environment):
        return False
    return current.candidates[0].kind == "complement"


# The paper's Algorithm 1 with the paper's numbers.
DDENV = Listing(
    (
        FIX_F,
        (1, "while E' not reached do"),
        (2, " subenvironments ← partition(E, f, n_partitions)"),
        (3, " subenvironments ← prioritize(subenvironments)"),
        (4, " for s in subenvironments do"),
        (5, "   result ← R(s, f, timeout)"),
        (6, "   if is_new_failure or is_success then"),
        (7, "     results ← deflake(s, R, iterations, timeout)"),
        (8, "     result ← find_similar_failure(results, f)"),
        (10, "   if is_similar_failure(result, f) then"),
        (11, "     E ← s; break"),
        (15, " n_partitions ← n_partitions + 1"),
        (16, " if none similar and n_partitions = E.size then"),
        (17, "   E' ← E; break"),
        (21, "return E'"),
    ),
    split=2,
    next=4,
    test=5,
    rerun=7,
    waiting=10,
    reduced=11,
    nothing=15,
    returned=21,
)
DDMIN = Listing(
    (
        FIX_F,
        (1, "while E' not reached do"),
        (2, " parts ← cut(E, n), in the order of the file"),
        (3, " for s in parts, then in their complements do"),
        (4, "   result ← R(s, f, timeout)"),
        (5, "   if not similar: deflake(s, R, iterations)"),
        (6, "   if similar: E ← s; n ← 2, or n - 1; break"),
        (7, " nothing similar: n ← 2 n; at E.size: E' ← E"),
        (8, "return E'"),
    ),
    split=2,
    next=3,
    test=4,
    rerun=5,
    waiting=6,
    reduced=6,
    nothing=7,
    returned=8,
)
PROBDD = Listing(
    (
        FIX_F,
        (1, "while some model's chance p of being needed < 1"),
        (2, " group ← models with the greatest expected gain"),
        (3, " result ← R(E without group, f, timeout)"),
        (4, " if not similar: deflake(E without group, ...)"),
        (5, " if similar: E ← E without group"),
        (6, " else: p rises for each model of the group"),
        (7, "for m in E: if similar without m, remove m"),
        (8, "return E'"),
    ),
    split=2,
    next=3,
    test=3,
    rerun=4,
    waiting=5,
    reduced=5,
    nothing=6,
    returned=8,
    sweep=7,
)
# It chooses the group otherwise, and concludes something else when f does not show.
SPLITTING = replace(
    PROBDD,
    lines=tuple(
        {
            1: (1, "while a model of E, far to near, is undecided"),
            2: (2, " group ← farthest undecided, or half the suspects"),
            6: (6, " else: suspects ← group; a single one is needed"),
        }.get(number, (number, code))
        for number, code in PROBDD.lines
    ),
)
# What all algorithms share, for those of other packages.
ANY = Listing(
    (
        FIX_F,
        (1, "while the algorithm makes a round do"),
        (2, " for s in its candidates do"),
        (3, "   result ← R(s, f, timeout)"),
        (4, "   if not similar: deflake(s, R, iterations)"),
        (5, "   if similar: E ← s; break"),
        (6, "return E'"),
    ),
    split=1,
    next=2,
    test=3,
    rerun=4,
    waiting=5,
    reduced=5,
    nothing=1,
    returned=6,
)
# With the scenario's `growth: steady`.
STEADY = replace(
    DDENV, lines=tuple((15, " if none similar: n_partitions + 1") if line[0] == 15 else line for line in DDENV.lines)
)
LISTINGS = {"ddenv": DDENV, "ddmin": DDMIN, "probdd": PROBDD, "splitting": SPLITTING}


def listing(algorithm: str, growth: str = "paper") -> Listing:
    """The listing of an algorithm, or the general one; `growth` is when ddenv's n grows."""
    if algorithm == "ddenv" and growth == "steady":
        return STEADY
    return LISTINGS.get(algorithm, ANY)


KINDS: tuple[Kind, ...] = ("algorithm", "partitioning", "prioritization")


def chosen(algorithm: str, pair: str) -> dict[Kind, str]:
    """The three names by kind."""
    partitioning, _, prioritization = pair.partition("/")
    return {"algorithm": algorithm, "partitioning": partitioning, "prioritization": prioritization}


def labels(algorithm: str, pair: str) -> tuple[str, ...]:
    """The method in short, without what the algorithm does not use, from the longest form to the shortest."""
    if algorithm == "ddenv":
        return (pair,)
    used = uses(algorithm)
    if not used:
        return (algorithm,)
    rest = pair if len(used) > 1 else chosen(algorithm, pair)[used[0]]
    return (f"{algorithm} · {rest}", algorithm)


def paragraph(kind: Kind, name: str) -> str:
    """The explanation of a name, or why there is none."""
    if name not in names(kind):
        return "It comes with a package that is not installed here."
    return plain(explanation(kind, name)) or "It has no explanation."


def note(kind: Kind, algorithm: str) -> str:
    """A sentence on what the algorithm does not use, as far as it concerns this kind, or ""."""
    unused = [part for part in BOTH if part not in uses(algorithm)]
    if kind in unused:
        return f"Not used by {plain(algorithm)}."
    if kind != "algorithm" or not unused:
        return ""
    if len(unused) == 1:
        return f"It does not use the {unused[0]}."
    return "It uses neither the partitioning nor the prioritization."


# These leave out one group of models per round, and each model in turn at the end.
GROUPS = ("probdd", "splitting")


def beginning(options: Settings, models: int) -> str:
    """How the next round is made; E has this many `models`."""
    kept = f"the {count(models, 'model')} of E"
    names = chosen(options.algorithm, options.pair)
    match options.algorithm:
        case "ddenv":
            return f"{kept} are split by {names['partitioning']}, then put in order by {names['prioritization']}."
        case "ddmin":
            return f"{kept} are cut into parts of equal size, in the order of the world file."
        case "probdd":
            return f"of {kept}, the group with the greatest expected gain is left out."
        case "splitting":
            return f"of {kept}, the farthest undecided ones are left out; {names['prioritization']} says what is far."
    return f"{plain(options.algorithm)} chooses candidates from {kept}."


def follows(options: Settings, last: Round) -> str:
    """What the last round means for the next one, or ""."""
    if last.winner is None:
        # The user changed something in the middle of the round.
        if not all(one.verdict for one in last.candidates):
            return ""
        reason = "Nothing showed f in the last round"
        if options.algorithm not in SMALLER:
            return f"{reason}."
        return f"{reason}, so {_smaller(options.algorithm, last)}."
    if options.algorithm != "ddmin":
        return ""
    if last.candidates[last.winner].kind == "partition":
        return "One part alone showed f, so it is cut in two next."
    return "One part was removed: the others stay as they are, and n is one less."


def fruitless(options: Settings, current: Round, models: int) -> str:
    """What follows if no candidate of the round `current` showed f; E has this many `models`."""
    if options.algorithm in GROUPS and is_sweep(current):
        return "Each model was left out once: nothing more can be removed."
    if options.algorithm not in SMALLER:
        return "E stays as it is."
    if options.algorithm not in GROUPS and current.n_partitions >= models:
        return "The parts were single models already: nothing more can be removed."
    return f"E stays as it is; {_smaller(options.algorithm, current)}."


# What that means for the next round.
SMALLER = {
    "ddenv": "the next round splits E into smaller parts",
    "ddmin": "n doubles, and the parts get smaller",
    "probdd": "each model that was left out is more likely to be needed",
    "splitting": "at least one of the models left out is needed; half of them are left out next",
}


def _smaller(algorithm: str, last: Round) -> str:
    only = algorithm in GROUPS and last.candidates and len(last.environment) - last.candidates[0].size == 1
    return "the model that was left out is needed" if only else SMALLER[algorithm]
