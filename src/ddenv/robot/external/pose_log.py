"""The pose log of another simulator: the poses of its robot, as CSV."""

from __future__ import annotations

import math

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.result import RECORD_PERIOD, Progress
from ddenv.text import printable

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
EXPECTED = f"expected {','.join(COLUMNS)} (s, m, a quaternion)"
MOST_BYTES = 64_000_000
TOO_LARGE = f"the pose log is larger than {MOST_BYTES / 1e6:.0f} MB; a row every 0.1 s is enough"
# Longer than any row of eight numbers, and larger than any number of seconds or metres.
LONGEST_LINE = 1000
GREATEST = 1e9
SHORTEST_QUATERNION = 1e-6
SHORTEST_GAP = 0.001  # s
# How many characters of a wrong line are reported.
SHOWN = 60

# t (s), x, y, z (m), qw, qx, qy, qz.
Row = tuple[float, float, float, float, float, float, float, float]


class BadLog(Exception):
    """What is wrong with a pose log, in one line."""


class PoseLog:
    """Reads a log piece by piece. It keeps the first row, a row every 0.1 s, and the last one.

    Blank lines and lines that begin with # are skipped; the first line may be a header. `progress` gets each row that is kept,
    except for the last. `size` is the number of bytes so far.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._rest = b""
        self._number = 0
        self._began = False
        self._rows: list[Row] = []
        self._last: Row | None = None
        self.size = 0
        self._problem = ""

    def add(self, piece: bytes) -> None:
        """Reads the next bytes. After a mistake, which `finish` reports, nothing more is read."""
        self.size += len(piece)
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

    def rows(self) -> Floats:
        """The rows so far: t (s), x, y, z (m), qw, qx, qy, qz, shape (N, 8)."""
        rows = list(self._rows)
        if self._last is not None and self._last is not rows[-1]:
            # Two rows at nearly the same time would be a robot of infinite speed.
            if self._last[0] - rows[-1][0] < SHORTEST_GAP:
                rows.pop()
            rows.append(self._last)
        return np.array(rows, dtype=float).reshape(-1, 8)

    def finish(self) -> Floats:
        """All rows, shape (N, 8) with N > 0. Raises BadLog."""
        rest, self._rest = self._rest, b""
        if rest:
            self.add(rest + b"\n")
        if self._problem:
            raise BadLog(self._problem)
        if self.size > MOST_BYTES:
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
        """Checks a header: it may name eight columns as it likes, but must not name the quaternion's in another order."""
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
        # Times that are sums of steps deviate a little.
        if self._rows and row[0] < self._rows[-1][0] + 0.999 * RECORD_PERIOD:
            return
        self._rows.append(row)
        if self._progress is not None:
            self._progress(row[0], row[1:], {})

    def _wrong(self, text: str) -> BadLog:
        shown = printable(text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}...")
        return BadLog(f"the pose log, line {self._number}: {EXPECTED}, found '{shown}'")


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
