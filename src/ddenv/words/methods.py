"""How a run reduces its world: the algorithm's listing, what it uses of the pair, and the
explanations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from ddenv.runfile.run_settings import Settings
from ddenv.runfile.state import Round
from ddenv.schemas import BOTH, Kind, explanation, names, uses
from ddenv.text import count, plain

Step = Literal[
    "baseline", "split", "next", "test", "rerun", "waiting", "reduced", "nothing", "returned"
]
Lines = tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class Listing:
    """`lines` with their numbers, and the number of the line at each of the `steps`.

    At "sweep" each model is left out in turn at the end, whatever the step.
    """

    lines: Lines
    steps: dict[str, int]

    def line(self, step: Step, current: Round | None) -> int:
        """The line of a step in the round `current`."""
        if "sweep" in self.steps and step not in ("baseline", "returned") and is_sweep(current):
            return self.steps["sweep"]
        return self.steps[step]

    def but(self, lines: dict[int, str]) -> Listing:
        """The same with other `lines`, by their numbers."""
        return replace(
            self, lines=tuple((number, lines.get(number, code)) for number, code in self.lines)
        )


def _listing(*lines: tuple[int, str, str]) -> Listing:
    """From (number, code, steps) of the lines after the first one, which is at work before any
    algorithm begins.
    """
    lines = ((0, "f ← failure of R(E, goal, timeout), several runs", "baseline"), *lines)
    steps = {step: number for number, _, steps in lines for step in steps.split()}
    return Listing(tuple((number, code) for number, code, _ in lines), steps)


def is_sweep(current: Round | None) -> bool:
    """Whether the round leaves out each model in turn."""
    if (
        current is None
        or not current.candidates
        or len(current.candidates) != len(current.environment)
    ):
        return False
    return current.candidates[0].kind == "complement"


# The paper's Algorithm 1 with the paper's numbers.
DDENV = _listing(
    (1, "while E' not reached do", ""),
    (2, " subenvironments ← partition(E, f, n_partitions)", "split"),
    (3, " subenvironments ← prioritize(subenvironments)", ""),
    (4, " for s in subenvironments do", "next"),
    (5, "   result ← R(s, f, timeout)", "test"),
    (6, "   if is_new_failure or is_success then", ""),
    (7, "     results ← deflake(s, R, iterations, timeout)", "rerun"),
    (8, "     result ← find_similar_failure(results, f)", ""),
    (10, "   if is_similar_failure(result, f) then", "waiting"),
    (11, "     E ← s; break", "reduced"),
    (15, " n_partitions ← n_partitions + 1", "nothing"),
    (16, " if none similar and n_partitions = E.size then", ""),
    (17, "   E' ← E; break", ""),
    (21, "return E'", "returned"),
)
DDMIN = _listing(
    (1, "while E' not reached do", ""),
    (2, " parts ← cut(E, n), in the order of the file", "split"),
    (3, " for s in parts, then in their complements do", "next"),
    (4, "   result ← R(s, f, timeout)", "test"),
    (5, "   if not similar: deflake(s, R, iterations)", "rerun"),
    (6, "   if similar: E ← s; n ← 2, or n - 1; break", "waiting reduced"),
    (7, " nothing similar: n ← 2 n; at E.size: E' ← E", "nothing"),
    (8, "return E'", "returned"),
)
PROBDD = _listing(
    (1, "while some model's chance p of being needed < 1", ""),
    (2, " group ← models with the greatest expected gain", "split"),
    (3, " result ← R(E without group, f, timeout)", "next test"),
    (4, " if not similar: deflake(E without group, ...)", "rerun"),
    (5, " if similar: E ← E without group", "waiting reduced"),
    (6, " else: p rises for each model of the group", "nothing"),
    (7, "for m in E: if similar without m, remove m", "sweep"),
    (8, "return E'", "returned"),
)
# It chooses the group otherwise, and concludes something else when f does not show.
SPLITTING = PROBDD.but(
    {
        1: "while a model of E, far to near, is undecided",
        2: " group ← farthest undecided, or half the suspects",
        6: " else: suspects ← group; a single one is needed",
    }
)
# What all algorithms share, for those of other packages.
ANY = _listing(
    (1, "while the algorithm makes a round do", "split nothing"),
    (2, " for s in its candidates do", "next"),
    (3, "   result ← R(s, f, timeout)", "test"),
    (4, "   if not similar: deflake(s, R, iterations)", "rerun"),
    (5, "   if similar: E ← s; break", "waiting reduced"),
    (6, "return E'", "returned"),
)
# With the scenario's `growth: steady`.
STEADY = DDENV.but({15: " if none similar: n_partitions + 1, or splitting"})
LISTINGS = {"ddenv": DDENV, "ddmin": DDMIN, "probdd": PROBDD, "splitting": SPLITTING}


def listing(algorithm: str, growth: str = "paper") -> Listing:
    """The listing of an algorithm, or the general one; `growth` is when ddenv's n grows."""
    if algorithm == "ddenv" and growth == "steady":
        return STEADY
    return LISTINGS.get(algorithm, ANY)


KINDS: tuple[Kind, ...] = ("algorithm", "partitioning", "prioritization")


def chosen(algorithm: str, pair: str) -> dict[Kind, str]:
    partitioning, _, prioritization = pair.partition("/")
    return {"algorithm": algorithm, "partitioning": partitioning, "prioritization": prioritization}


def labels(algorithm: str, pair: str) -> tuple[str, ...]:
    """The method in short, without what the algorithm does not use, from the longest form to the
    shortest.
    """
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
    kept = f"the {count(models, 'model')} of E"
    names = chosen(options.algorithm, options.pair)
    match options.algorithm:
        case "ddenv":
            return (
                f"{kept} are split by {names['partitioning']}, then ordered by "
                f"{names['prioritization']}."
            )
        case "ddmin":
            return f"{kept} are cut into parts of equal size, in the order of the world file."
        case "probdd":
            return f"of {kept}, the group with the greatest expected gain is left out."
        case "splitting":
            return (
                f"of {kept}, the farthest undecided ones are left out; {names['prioritization']} "
                "defines how far."
            )
    return f"{plain(options.algorithm)} chooses candidates from {kept}."


def follows(options: Settings, last: Round) -> str:
    """What the last round means for the next one, or ""."""
    # The user may have changed something in the middle of the round, perhaps while a reduction
    # waited.
    if last.winner is not None or any(one.verdict in ("", "similar") for one in last.candidates):
        return ""
    reason = "No candidate showed f in the last round"
    if options.algorithm in SMALLER:
        return f"{reason}, so {SMALLER[options.algorithm]}."
    return f"{reason}."


def fruitless(options: Settings, current: Round, models: int) -> str:
    """What follows if no candidate of the round `current` showed f; E has this many `models`."""
    if options.algorithm in GROUPS and is_sweep(current):
        return "Each model was left out once: nothing more can be removed."
    if options.algorithm not in SMALLER:
        return "E stays as it is."
    if options.algorithm not in GROUPS and current.n_partitions >= models:
        return "The parts were single models already: nothing more can be removed."
    return f"E stays as it is; {SMALLER[options.algorithm]}."


# What that means for the next round.
SMALLER = {
    "ddenv": "the next round splits E into smaller parts",
    "ddmin": "n doubles, and the parts get smaller",
    "probdd": "each model left out is now more likely to be needed",
    "splitting": (
        "at least one of the models left out is needed; of several, half are left out next"
    ),
}
