"""An environment: a set of models, each of them a number, as the bits of one integer.

Model number i is the i-th of the run's elements. Sets of names would take a thousand times as long
in a world of 5,000 models.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from ddenv.text import Names

# Numbers of models, runs or tests, one after the other.
Numbers = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Environment:
    """A set of models with the operators of `frozenset`; it iterates over their numbers in rising
    order.
    """

    bits: int = 0

    @classmethod
    def of(cls, models: Iterable[int]) -> Environment:
        """The models with these numbers."""
        bits = 0
        for model in models:
            bits |= 1 << model
        return cls(bits)

    @classmethod
    def whole(cls, count: int) -> Environment:
        """Models 0 to `count` - 1."""
        return cls((1 << count) - 1)

    def __or__(self, other: Environment) -> Environment:
        return Environment(self.bits | other.bits)

    def __and__(self, other: Environment) -> Environment:
        return Environment(self.bits & other.bits)

    def __sub__(self, other: Environment) -> Environment:
        return Environment(self.bits & ~other.bits)

    def __le__(self, other: Environment) -> bool:
        return not self.bits & ~other.bits

    def __lt__(self, other: Environment) -> bool:
        return self.bits != other.bits and self <= other

    def isdisjoint(self, other: Environment) -> bool:
        return not self.bits & other.bits

    def __contains__(self, model: int) -> bool:
        return bool(self.bits >> model & 1)

    def __bool__(self) -> bool:
        return self.bits != 0

    def __len__(self) -> int:
        return self.bits.bit_count()

    def __iter__(self) -> Iterator[int]:
        digits = f"{self.bits:b}"[::-1]
        model = digits.find("1")
        while model >= 0:
            yield model
            model = digits.find("1", model + 1)

    def names(self, elements: Sequence[str]) -> Names:
        """The names of its models, in the order of `elements`, the names of all models."""
        return tuple(elements[model] for model in self)


NOTHING = Environment()
