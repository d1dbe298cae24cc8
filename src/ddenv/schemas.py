"""Partitionings, prioritizations and algorithms by name: where each is implemented, and its
explanation.

Listing and explaining them imports nothing, so views can show all of them without scikit-learn.
Other packages add their own through entry points in the groups `ddenv.partitionings`,
`ddenv.prioritizations` and `ddenv.algorithms`.
"""

from __future__ import annotations

import ast
import difflib
import importlib.util
import warnings
from collections.abc import Callable, Iterable
from functools import cache
from importlib.machinery import PathFinder
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ddenv.errors import UserError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Kind = Literal["partitioning", "prioritization", "algorithm"]

OURS: dict[str, dict[str, str]] = {
    "partitioning": {
        "model2model": "ddenv.reduction.partitionings:model2model",
        "timeseg": "ddenv.reduction.partitionings:timeseg",
        "trajectoryseg": "ddenv.reduction.partitionings:trajectoryseg",
        "learner": "ddenv.reduction.learner:Learner",
    },
    "prioritization": {
        "failure-proximal": "ddenv.reduction.prioritizations:failure_proximal",
        "avg-trajectory-proximal": "ddenv.reduction.prioritizations:avg_trajectory_proximal",
        "min-trajectory-proximal": "ddenv.reduction.prioritizations:min_trajectory_proximal",
        "timestep": "ddenv.reduction.prioritizations:timestep",
        "sequential": "ddenv.reduction.prioritizations:sequential",
        "random": "ddenv.reduction.prioritizations:random",
    },
    "algorithm": {
        "ddenv": "ddenv.reduction.algorithms:ddenv",
        "ddmin": "ddenv.reduction.algorithms:ddmin",
        "probdd": "ddenv.reduction.algorithms:probdd",
        "splitting": "ddenv.reduction.algorithms:splitting",
    },
}

# Algorithms of other packages are assumed to use both parts of the pair.
BOTH: tuple[Kind, ...] = ("partitioning", "prioritization")
_USES: dict[str, tuple[Kind, ...]] = {"ddmin": (), "probdd": (), "splitting": ("prioritization",)}


def names(kind: Kind) -> tuple[str, ...]:
    """All known names, ours first."""
    return tuple(_known(kind))


def pairs() -> tuple[str, ...]:
    """All pairs of a partitioning with a prioritization, written `model2model/failure-proximal`."""
    orders = names("prioritization")
    return tuple(
        f"{partitioning}/{order}" for partitioning in names("partitioning") for order in orders
    )


def uses(algorithm: str) -> tuple[Kind, ...]:
    """The parts of the pair that the algorithm uses."""
    return _USES.get(algorithm, BOTH)


def split_pair(pair: str) -> tuple[str, str]:
    """The partitioning and the prioritization of a pair, both known. Raises UserError."""
    partitioning, slash, prioritization = pair.partition("/")
    if not slash:
        raise UserError(
            f"'{pair}' is not a pair{nearest(pair, pairs())}; write partitioning/prioritization"
        )
    check("partitioning", partitioning)
    check("prioritization", prioritization)
    return partitioning, prioritization


def check(kind: Kind, name: str) -> None:
    """Raises UserError for an unknown name, suggesting the nearest one."""
    known = names(kind)
    if not isinstance(name, str):
        raise UserError(f"{kind}: expected a name, found {name!r}; use one of {', '.join(known)}")
    if name not in known:
        raise UserError(f"no {kind} '{name}'{nearest(name, known)}; use one of {', '.join(known)}")


def load(kind: Kind, name: str) -> Callable[..., Any]:
    """The function itself. Raises UserError for an unknown name, and if another package's function
    cannot be loaded.
    """
    check(kind, name)
    entry = _known(kind)[name]
    try:
        found: object = entry.load()
    # Importing another package may raise anything.
    except (Exception, SystemExit) as error:
        raise UserError(f"{kind} '{name}': {entry.value} cannot be loaded: {error}") from error
    if not callable(found):
        raise UserError(f"{kind} '{name}': {entry.value} is not a function")
    return found


@cache
def explanation(kind: Kind, name: str) -> str:
    """The first paragraph of its docstring, as one line; "" if there is none."""
    entry = _known(kind).get(name)
    if entry is None:
        return ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(_source(entry.module).read_bytes())
    except Exception:
        # Another package may be half removed, or not written in Python.
        return ""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == entry.attr:
            return " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())
    return ""


def _source(module: str) -> Path:
    """The file of a module, found without importing the packages around it, as Python would. Raises
    ImportError.
    """
    top, *inside = module.split(".")
    spec = importlib.util.find_spec(top)
    for name in inside:
        spec = PathFinder.find_spec(name, spec.submodule_search_locations or ()) if spec else None
    if spec is None or spec.origin is None:
        raise ImportError(module)
    return Path(spec.origin)


# Words are compared by so many characters, and with so many known ones: more would take seconds.
LONGEST_COMPARED = 80
MOST_COMPARED = 1000


def nearest(word: str, known: Iterable[str]) -> str:
    """ " (did you mean ...?)" with the known word nearest to `word`, or ""."""
    words = [each[:LONGEST_COMPARED] for each in islice(known, MOST_COMPARED)]
    match = difflib.get_close_matches(word[:LONGEST_COMPARED], words, n=1, cutoff=0.5)
    if match:
        return f" (did you mean {match[0]}?)"
    return ""


@cache
def _installed() -> dict[str, list[EntryPoint]]:
    """Those of all packages, by their kinds. They stand in many files, which are read once."""
    from importlib.metadata import entry_points

    found = entry_points()
    return {kind: list(found.select(group=f"ddenv.{kind}s")) for kind in OURS}


@cache
def _known(kind: Kind) -> dict[str, EntryPoint]:
    from importlib.metadata import EntryPoint

    group = f"ddenv.{kind}s"
    ours = {name: EntryPoint(name, value, group) for name, value in OURS[kind].items()}
    # A name with a slash would look like a pair.
    others = {
        each.name: each
        for each in _installed()[kind]
        if each.name not in ours and "/" not in each.name
    }
    return ours | others
