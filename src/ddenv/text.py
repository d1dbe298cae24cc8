"""Text for people: numbers as they are worded, what is safe to print, how wide it is, and as much
of it as fits.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

# Names in their order, such as those of the models in a world.
Names = tuple[str, ...]
# Plain data by name, as JSON and YAML have it.
Data = dict[str, Any]
# Sentences, or short pieces of text, one after the other.
Sentences = tuple[str, ...]

# 100 * 0.29 is a bit less than 29.
ROUNDING = 1e-9


def printable(text: str) -> str:
    """`text` with control characters replaced, since parts of it may come from untrusted files."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)


def plain(text: object) -> str:
    """`text` on one line without control characters: names come from files, and must not control
    the terminal.
    """
    return printable(" ".join(str(text).split()))


def width(text: str) -> int:
    """The number of terminal columns that `text` takes."""
    return sum(_width(char) for char in text)


def _width(char: str) -> int:
    if unicodedata.category(char) in ("Mn", "Me", "Cf"):
        return 0
    if unicodedata.east_asian_width(char) in "WF":
        return 2
    return 1


def shortened(name: str, columns: int, head: int | None = None) -> str:
    """`name` without control characters, cut to `columns`. `head` of them come before the ellipsis;
    by default about half, since names of copies differ at their ends.
    """
    name = printable(name)
    if width(name) <= columns:
        return name
    first = ""
    last = ""
    while True:
        take_first = width(first) <= width(last) if head is None else width(first) < head
        char = name[len(first)] if take_first else name[-1 - len(last)]
        if width(first) + width(last) + _width(char) + 1 > columns:
            if columns > 0:
                return f"{first}…{last}"
            return ""
        first, last = (first + char, last) if take_first else (first, char + last)


@lru_cache(maxsize=64)
def told_apart(names: tuple[str, ...], columns: int) -> dict[str, str]:
    """Each name as it is shortened to `columns`, with the ellipsis nearest to the middle where no
    two look the same.
    """
    for head in (None, *sorted(range(columns), key=lambda place: abs(place - columns // 2))):
        texts = {name: shortened(name, columns, head) for name in names}
        if len(set(texts.values())) == len(texts):
            return texts
    return {name: shortened(name, columns) for name in names}


def truncated(line: str, columns: int) -> str:
    """A maximum of `columns` characters of a line, with an ellipsis at its end if it is longer."""
    if len(line) <= columns:
        return line
    return f"{line[: max(0, columns - 1)]}…"


def padded(text: str, columns: int) -> str:
    """`text` filled with spaces to `columns`."""
    return text + " " * (columns - width(text))


def count(number: int, word: str) -> str:
    """1 model, 2 models."""
    if number == 1:
        return f"{number} {word}"
    return f"{number} {word}s"


def as_sentence(words: str) -> str:
    """`words` with a capital letter and a full stop."""
    return words[:1].upper() + words[1:] + ("" if words.endswith(".") else ".")


def snake_case(name: str) -> str:
    """The name of a class as kinds are named in run files: "go_back" for GoBack."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def first_of(names: Sequence[str], most: int) -> str:
    """a, b and 3 more: at most `most` of them by name."""
    left = len(names) - most
    return ", ".join(names[:most]) + (f" and {left} more" if left > 0 else "")


def duration(seconds: float) -> str:
    """`seconds` as 7 s, 1 min 40 s or 2 h 05 min."""
    whole = max(0, round(seconds)) if math.isfinite(seconds) else 0
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02} min"


def rounded(number: float) -> int:
    """An estimate as it is said: no more exact than to a tenth, and only up to 10 to a single one;
    1 at least.
    """
    if not 10 <= number < math.inf:
        if math.isfinite(number):
            return max(1, round(number))
        return 1
    digits: int = 10 ** math.floor(math.log10(number))
    step = digits // 2 if number < 5 * digits else digits
    return step * round(number / step)


def between(low: float, high: float) -> str:
    """An estimate's range as it is said: "50 to 1,000", or "20" where it is known."""
    if low < high:
        return f"{rounded(low):,} to {rounded(high):,}"
    return f"{rounded(high):,}"


def about(middle: float, low: float = 0.0, high: float = 0.0) -> str:
    """An estimated time in s, with its interval if there is one: 2 min (1 to 5)."""
    name = "s"
    unit = 1.0
    if middle >= 5400:
        name = "h"
        unit = 3600.0
    elif middle >= 90:
        name = "min"
        unit = 60.0
    words = f"{rounded(middle / unit):,} {name}"
    if rounded(low / unit) < rounded(high / unit):
        return f"{words} ({between(low / unit, high / unit)})"
    return words


def coordinates(place: Sequence[float]) -> str:
    """A place, m, as it is said: 5.42, -0.56."""
    return ", ".join(f"{value:z.2f}" for value in place)


def percent(part: float) -> str:
    """A fraction as a whole percentage that is never rounded to certainty."""
    value = round(100 * part)
    if value == 0 and part > 0:
        return "<1 %"
    if value == 100 and part < 1:
        return ">99 %"
    return f"{value} %"


def percent_at_least(bound: float) -> str:
    """A lower bound as a whole percentage, rounded to the side on which it still holds."""
    return f"{math.floor(100.0 * bound + ROUNDING)} %"


def percent_at_most(bound: float) -> str:
    """An upper bound as a whole percentage, rounded to the side on which it still holds."""
    return f"{math.ceil(100.0 * bound - ROUNDING)} %"
