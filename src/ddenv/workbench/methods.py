"""How a run reduces its world: what its algorithm uses of the pair, the words for it, and the explanations. Pure."""

from __future__ import annotations

from ddenv.schemas import BOTH, Kind, explanation, names, uses
from ddenv.workbench.wording import plain

KINDS: tuple[Kind, ...] = ("algorithm", "partitioning", "prioritization")


def chosen(algorithm: str, pair: str) -> dict[Kind, str]:
    """The three names by kind."""
    partitioning, _, prioritization = pair.partition("/")
    return {"algorithm": algorithm, "partitioning": partitioning, "prioritization": prioritization}


def labels(algorithm: str, pair: str) -> tuple[str, ...]:
    """The method in short, without what the algorithm does not use: from the longest to the shortest way to say it."""
    if algorithm == "ddenv":
        return (pair,)
    used = uses(algorithm)
    if not used:
        return (algorithm,)
    rest = pair if len(used) > 1 else chosen(algorithm, pair)[used[0]]
    return (f"{algorithm} · {rest}", algorithm)


def paragraph(kind: Kind, name: str) -> str:
    """What is said of a name, or why nothing is."""
    if name not in names(kind):
        return "It comes with a package that is not installed here."
    return plain(explanation(kind, name)) or "Nothing is said of it."


def note(kind: Kind, algorithm: str) -> str:
    """A sentence on what is not used, where it matters for this kind, or ""."""
    unused = [part for part in BOTH if part not in uses(algorithm)]
    if kind in unused:
        return f"Not used: {plain(algorithm)} does not look at the {kind}."
    if kind != "algorithm" or not unused:
        return ""
    if len(unused) == 1:
        return f"It does not use the {unused[0]}."
    return "It uses neither the partitioning nor the prioritization."
