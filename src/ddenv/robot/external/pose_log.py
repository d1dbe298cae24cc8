"""The pose log of another simulator: where its robot was, as CSV."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ddenv.errors import printable
from ddenv.robot.result import RECORD_PERIOD

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
EXPECTED = f"expected {','.join(COLUMNS)} (s, m, a quaternion)"
MOST_BYTES = 64_000_000
TOO_LARGE = f"the pose log is larger than {MOST_BYTES / 1e6:.0f} MB; a row every 0.1 s is enough"
# No row of eight numbers is as long as this, and none of s or m as large.
LONGEST_LINE = 1000
GREATEST = 1e9
SHORTEST_QUATERNION = 1e-6
SHORTEST_GAP = 0.001  # s
# How much of a wrong line is told, in characters.
SHOWN = 60

Row = tuple[float, ...]


class BadLog(Exception):
    """What is wrong with a pose log, in one line."""


class PoseLog:
    """Takes in a log piece by piece, and keeps a row every 0.1 s and the last one.

    Blank lines and those that begin with # do not count; the first line may be a header. `progress(time, pose)` is told each row
    that is kept: s, and x, y, z (m), qw, qx, qy, qz.
    """

    def __init__(self, progress: Callable[[float, Row], None] | None = None) -> None:
        self._progress = progress
        self._rest = b""
        self._number = 0
        self._began = False
        self._rows: list[Row] = []
        self._last: Row | None = None
        self._size = 0
        self._problem = ""

    @property
    def size(self) -> int:
        """How many bytes it has."""
        return self._size

    def add(self, piece: bytes) -> None:
        """The next bytes. What is wrong with them is told by `finish`; after it nothing is looked at any more."""
        self._size += len(piece)
        if self._problem:
            return
        *lines, self._rest = (self._rest + piece).split(b"\n")
        try:
            for line in lines:
                self._line(line)
            if len(self._rest) > LONGEST_LINE:
                self._line(self._rest)
        except BadLog as error:
            self._problem, self._rest = str(error), b""

    def rows(self) -> np.ndarray:
        """What could be read so far: t (s), x, y, z (m), qw, qx, qy, qz, shape (N, 8)."""
        rows = list(self._rows)
        if self._last is not None and self._last is not rows[-1]:
            # Two rows at one time would be a robot of endless speed.
            if self._last[0] - rows[-1][0] < SHORTEST_GAP:
                rows.pop()
            rows.append(self._last)
        return np.array(rows, dtype=float).reshape(-1, 8)

    def finish(self) -> np.ndarray:
        """All rows, at least one, as in `rows`. Raises BadLog."""
        rest, self._rest = self._rest, b""
        if rest:
            self.add(rest + b"\n")
        if self._problem:
            raise BadLog(self._problem)
        if self._size > MOST_BYTES:
            raise BadLog(TOO_LARGE)
        if not self._rows:
            raise BadLog(f"the pose log has no rows; {EXPECTED}")
        return self.rows()

    def _line(self, line: bytes) -> None:
        self._number += 1
        if len(line) > LONGEST_LINE:
            raise self._wrong(line.decode(errors="replace"))
        text = line.decode(errors="replace").strip().removeprefix("\ufeff")
        if not text or text.startswith("#"):
            return
        fields = [field.strip() for field in text.split(",")]
        header = not self._began and not any(map(_is_number, fields))
        self._began = True
        if header:
            self._header(text, fields)
        else:
            self._row(text, fields)

    def _header(self, text: str, fields: list[str]) -> None:
        """A header names eight columns as it likes, but those of the quaternion not in another order."""
        turned = [field.lower() for field in fields[4:]]
        known = list(COLUMNS[4:])
        if len(fields) != len(COLUMNS) or (sorted(turned) == sorted(known) and turned != known):
            raise self._wrong(text)

    def _row(self, text: str, fields: list[str]) -> None:
        try:
            numbers = [float(field) for field in fields]
        except ValueError:
            raise self._wrong(text) from None
        if len(numbers) != len(COLUMNS) or not all(map(math.isfinite, numbers)):
            raise self._wrong(text)
        if max(map(abs, numbers)) > GREATEST:
            raise BadLog(
                f"the pose log, line {self._number}: a number is above {GREATEST:g}: times are in s, places in m"
            )
        t, x, y, z, *turn = numbers
        before = 0.0 if self._last is None else self._last[0]
        if t < before:
            raise BadLog(f"the pose log, line {self._number}: time goes back from {before:g} to {t:g} s")
        length = math.hypot(*turn)
        if length < SHORTEST_QUATERNION:
            raise BadLog(f"the pose log, line {self._number}: the quaternion {','.join(fields[4:])} has no length")
        qx, qy, qz, qw = (part / length for part in turn)
        self._keep((t, x, y, z, qw, qx, qy, qz))

    def _keep(self, row: Row) -> None:
        self._last = row
        # Times that were added up are a little off.
        if self._rows and row[0] < self._rows[-1][0] + 0.999 * RECORD_PERIOD:
            return
        self._rows.append(row)
        if self._progress is not None:
            self._progress(row[0], row[1:])

    def _wrong(self, text: str) -> BadLog:
        shown = printable(text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}...")
        return BadLog(f"the pose log, line {self._number}: {EXPECTED}, found '{shown}'")


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
