"""A tuple with cheap changed copies: a copy shares all but one small part with the original."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar, overload

# Items in a chunk. A change copies one chunk and the list of chunks; for the longest runs (60,000 tests) both are about as long.
CHUNK = 256

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class PersistentTuple(Sequence[Item]):
    """An immutable sequence: `added` and `changed` return a new one that shares all unchanged chunks. A slice is a plain tuple. It
    equals other ones with equal items, but no plain tuple. All chunks but the last hold `CHUNK` items, so equal items are always in
    equal chunks.
    """

    chunks: tuple[tuple[Item, ...], ...] = ()

    @classmethod
    def of(cls, items: Iterable[Item]) -> PersistentTuple[Item]:
        """One that holds `items`, in order."""
        every = tuple(items)
        return cls(tuple(every[start : start + CHUNK] for start in range(0, len(every), CHUNK)))

    def added(self, item: Item) -> PersistentTuple[Item]:
        """One with `item` appended."""
        if not self.chunks or len(self.chunks[-1]) == CHUNK:
            return PersistentTuple((*self.chunks, (item,)))
        return PersistentTuple((*self.chunks[:-1], (*self.chunks[-1], item)))

    def changed(self, index: int, item: Item) -> PersistentTuple[Item]:
        """One with `item` at `index`, which may be negative. Raises IndexError if there is no such index."""
        number, place = divmod(range(len(self))[index], CHUNK)
        # Joined slices would be copied twice.
        chunk, chunks = list(self.chunks[number]), list(self.chunks)
        chunk[place] = item
        chunks[number] = tuple(chunk)
        return PersistentTuple(tuple(chunks))

    def changed_since(self, earlier: PersistentTuple[Item]) -> Iterator[Item]:
        """The items that differ from `earlier` at their index, in order; shared chunks cost nothing."""
        for number, chunk in enumerate(self.chunks):
            before = earlier.chunks[number] if number < len(earlier.chunks) else ()
            if chunk is not before:
                yield from (item for place, item in enumerate(chunk) if place >= len(before) or item != before[place])

    def __len__(self) -> int:
        return CHUNK * (len(self.chunks) - 1) + len(self.chunks[-1]) if self.chunks else 0

    @overload
    def __getitem__(self, index: int) -> Item: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Item, ...]: ...

    def __getitem__(self, index: int | slice) -> Item | tuple[Item, ...]:
        if isinstance(index, slice):
            return tuple(self[place] for place in range(*index.indices(len(self))))
        number, place = divmod(range(len(self))[index], CHUNK)
        return self.chunks[number][place]

    def __iter__(self) -> Iterator[Item]:
        return chain.from_iterable(self.chunks)

    def __reversed__(self) -> Iterator[Item]:
        return chain.from_iterable(map(reversed, reversed(self.chunks)))
