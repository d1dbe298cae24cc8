"""A tuple that a changed copy can be made of at the price of one small part of it, not of all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

# A change copies one chunk and the list of chunks: with 256 both are about as long for the longest runs (60,000 tests).
CHUNK = 256

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class PersistentTuple(Sequence[Item]):
    """Read like a tuple, and never changed: `added` and `changed` give a new one that shares all other chunks with it.

    A slice is a plain tuple. It equals another one with equal items, and no plain tuple. All chunks but the last hold
    `CHUNK` items, so that equal items are always in equal chunks.
    """

    chunks: tuple[tuple[Item, ...], ...] = ()

    @classmethod
    def of(cls, items: Iterable[Item]) -> PersistentTuple[Item]:
        """One that holds `items`, in their order."""
        every = tuple(items)
        return cls(tuple(every[start : start + CHUNK] for start in range(0, len(every), CHUNK)))

    def added(self, item: Item) -> PersistentTuple[Item]:
        """One that has `item` behind the last of this one."""
        if not self.chunks or len(self.chunks[-1]) == CHUNK:
            return PersistentTuple((*self.chunks, (item,)))
        return PersistentTuple((*self.chunks[:-1], (*self.chunks[-1], item)))

    def changed(self, index: int, item: Item) -> PersistentTuple[Item]:
        """One that has `item` at `index`; negative ones count from the end. Raises IndexError if nothing is there."""
        number, place = divmod(self._position(index), CHUNK)
        # Slices put together would be copied twice.
        chunk, chunks = list(self.chunks[number]), list(self.chunks)
        chunk[place] = item
        chunks[number] = tuple(chunk)
        return PersistentTuple(tuple(chunks))

    def changed_since(self, earlier: PersistentTuple[Item]) -> Iterator[Item]:
        """The items that `earlier` does not have at the same place, in order; chunks that both share cost nothing."""
        for number, chunk in enumerate(self.chunks):
            before = earlier.chunks[number] if number < len(earlier.chunks) else ()
            if chunk is not before:
                yield from (item for place, item in enumerate(chunk) if place >= len(before) or item != before[place])

    def __len__(self) -> int:
        return CHUNK * (len(self.chunks) - 1) + len(self.chunks[-1]) if self.chunks else 0

    def __getitem__(self, index):
        if isinstance(index, slice):
            return tuple(self[place] for place in range(*index.indices(len(self))))
        number, place = divmod(self._position(index), CHUNK)
        return self.chunks[number][place]

    def __iter__(self) -> Iterator[Item]:
        return chain.from_iterable(self.chunks)

    def __reversed__(self) -> Iterator[Item]:
        return chain.from_iterable(map(reversed, reversed(self.chunks)))

    def _position(self, index: int) -> int:
        """The place of `index` from the beginning. Raises IndexError if nothing is there."""
        length = len(self)
        position = index + length if index < 0 else index
        if not 0 <= position < length:
            raise IndexError(index)
        return position
