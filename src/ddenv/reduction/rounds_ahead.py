"""The rounds that a search may come to: what it would yield next if a candidate of this round won, or none did."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from ddenv import schemas
from ddenv.arrays import Floats
from ddenv.reduction.evidence import Partition
from ddenv.reduction.forecast import Memory
from ddenv.reduction.guide import Guide, Search
from ddenv.reduction.round import Round

# The winners of rounds, by their places among the candidates; None where there was none.
Path = tuple[int | None, ...]


class Unforeseen(Exception):
    """A schema that learns, or one of another package, is not asked before its time: it might then answer differently."""


@dataclass
class Place:
    """A round that may come, after the rounds of `path`; or, without a round, an end of the search with `left`.

    `keeps` are the models of its candidates, as far as they were looked at.
    """

    path: Path
    round: Round | None
    left: frozenset[str] = frozenset()
    search: Search | None = field(default=None, repr=False)
    keeps: dict[int, frozenset[str]] = field(default_factory=dict, repr=False)
    after: dict[int | None, Place | None] = field(default_factory=dict, repr=False)

    def judged(self, number: int) -> None:
        """Forgets the first `number` candidates, of which thousands take gigabytes, but not the last: it may have won."""
        for index in [index for index in self.keeps if index < number - 1]:
            del self.keeps[index]
        for winner in [winner for winner in self.after if winner is not None and winner < number - 1]:
            del self.after[winner]


class RoundsAhead:
    """The tree of rounds from the current one on. `begin()` starts the search anew, with a guide that answers as `foreseeing`.

    A search cannot be copied, so that all but one of the ways out of a round play it again from its beginning.
    """

    def __init__(self, begin: Callable[[], Search]) -> None:
        self._begin = begin
        self._here: Place | None = None

    def at(self, path: Path, round: Round) -> Place:
        """The current round, in the tree so far if it was foreseen."""
        here = self._here
        if here is None or here.path != path:
            here = None if here is None or here.path != path[:-1] else here.after.get(path[-1])
        if here is None or here.round is None or not _same(here.round, round):
            here = Place(path, round)
        self._here = here
        return here

    def after(self, place: Place, winner: int | None) -> Place | None:
        """The round that comes if candidate number `winner` wins, or none; None where that cannot be foreseen."""
        if winner not in place.after:
            place.after[winner] = self._next(place, winner)
        return place.after[winner]

    def _next(self, place: Place, winner: int | None) -> Place | None:
        path = (*place.path, winner)
        search, place.search = place.search, None
        try:
            if search is None:
                search = self._begin()
                round = next(search)
                for won in place.path:
                    round = search.send(None if won is None else round.candidates[won])
            else:
                assert place.round is not None
                round = place.round
            return Place(path, search.send(None if winner is None else round.candidates[winner]), search=search)
        except StopIteration as end:
            return Place(path, None, end.value)
        except Exception:
            # An algorithm of another package may not bear a past that is told once more.
            return None


def _same(one: Round, other: Round) -> bool:
    return (one.partitions, one.runs, len(one.candidates)) == (other.partitions, other.runs, len(other.candidates))


def foreseeing(guide: Guide, memory: Memory, foreseen: Memory, pair: str) -> Guide:
    """A guide that answers as `guide` did, where `memory` has that; else as it would now, which `foreseen` remembers.

    Raises `Unforeseen` where `guide` might not forget that it was asked.
    """
    partitioning, prioritization = schemas.split_pair(pair)
    splits_again, ranks_again = _forgets("partitioning", partitioning), _forgets("prioritization", prioritization)
    now = foreseen.of(guide)

    def split(environment: Partition, n: int) -> list[Partition]:
        asked = environment, n
        known = memory.splits.get(asked) or foreseen.splits.get(asked)
        if known is None and not splits_again:
            raise Unforeseen
        return known or now.split(environment, n)

    def rank(partitions: Sequence[Partition]) -> list[float]:
        asked = tuple(partitions)
        known = memory.scores.get(asked) or foreseen.scores.get(asked)
        if known is None and not ranks_again:
            raise Unforeseen
        return known or now.rank(partitions)

    def chances(environment: Partition) -> Floats:
        known = memory.chances.get(environment)
        return now.chances(environment) if known is None else known

    return replace(guide, split=split, rank=rank, chances=chances)


def _forgets(kind: schemas.Kind, name: str) -> bool:
    found = schemas.load(kind, name)
    return not isinstance(found, type) and str(getattr(found, "__module__", "")).startswith("ddenv.")
