"""The partitionings, prioritizations and algorithms: as lines for people, as plain data for programs."""

from __future__ import annotations

from ddenv.console.wrap import wrapped
from ddenv.errors import printable
from ddenv.schemas import Kind, explanation, names

KINDS: tuple[Kind, ...] = ("partitioning", "prioritization", "algorithm")
TITLES: dict[Kind, str] = {
    "partitioning": "partitionings: how the environment is split",
    "prioritization": "prioritizations: in which order the parts are tried",
    "algorithm": "algorithms: how the environment is searched",
}


def report() -> dict[str, dict[str, str]]:
    """What `--json` prints: of each kind, the explanations by name."""
    return {f"{kind}s": {name: explanation(kind, name) for name in names(kind)} for kind in KINDS}


def lines(columns: int | None = None) -> list[str]:
    """A paragraph for each, no line wider than `columns`; each is one line if that is None."""
    told: list[str] = []
    for kind in KINDS:
        told += ["", *wrapped(TITLES[kind], columns)] if told else wrapped(TITLES[kind], columns)
        for name in names(kind):
            told += ["", *_paragraph(printable(name), printable(explanation(kind, name)), columns)]
    return told


def _paragraph(name: str, words: str, columns: int | None) -> list[str]:
    """The name, and below it the words."""
    return [*wrapped(name, columns, "  "), *wrapped(words or "(nothing is said of it)", columns, "    ")]
