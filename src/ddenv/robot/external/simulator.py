"""A simulator of your own: each run writes the reduced world to a file and starts the scenario's
command on it.

The command writes a pose log: the poses of its robot, as CSV.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import signal
import tempfile
import time
import uuid
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import yaml

from ddenv.arrays import Floats
from ddenv.errors import UserError
from ddenv.robot.controllers import WrongAnswer
from ddenv.robot.external.process import BEGIN, Ended, running, signal_name, watch
from ddenv.robot.oracle import kind_of
from ddenv.robot.result import RECORD_PERIOD, Ends, Progress, RunResult
from ddenv.text import printable
from ddenv.world.access import is_folder
from ddenv.world.command import command_words, filled, has_placeholder, start_folder
from ddenv.world.files.roots import PLACES, VARIABLES, around
from ddenv.world.model import World
from ddenv.world.placement import spawn_pose
from ddenv.world.scenario import Scenario, Whole
from ddenv.world.whole import whole_of
from ddenv.world.write import without

OUTCOMES = {
    0: "pass",
    1: "failed",
}  # the meaning of the command's exit codes; all others are errors


class ExternalSimulator:
    """Runs a command as `Plant` runs Drake. docs/any-simulator.md says what the command has to
    do.
    """

    def __init__(self, world: World, scenario: Scenario) -> None:
        """Raises UserError if the command cannot be started."""
        self._world = world
        self._scenario = scenario
        self._whole = whole_of(world, scenario)
        self._words = command_words(scenario)
        self._names = frozenset(world.names)
        # What a test may take in real time, s.
        self.limit = scenario.simulation.wall_timeout or math.inf
        self._removable = frozenset(world.elements(scenario.protected))

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        ends: Ends | None = None,
    ) -> RunResult:
        """As `Simulator.run`, with the robot's pose alone for `progress`, of each row that the
        command prints.

        `ends` has no effect: a command ends its runs itself. Whatever the command does becomes a
        result. Raises UserError if no temporary file can be written.
        """
        unknown = keep - self._names
        if unknown:
            raise ValueError(f"no such model: {min(unknown)}")
        started = time.perf_counter()
        with temporary_folder() as folder:
            ended, log = self._execute(folder, keep, seed, progress)
        outcome, failure, trajectory = self._judged(ended, log)
        return RunResult(
            outcome=outcome,
            failure=failure,
            trajectory=trajectory,
            motions={},
            simulated_seconds=float(trajectory[-1, 0]),
            wall_seconds=time.perf_counter() - started,
            seed=seed,
        )

    def _execute(
        self, folder: Path, keep: frozenset[str], seed: int, progress: Progress | None
    ) -> tuple[Ended, PoseLog]:
        """Runs the command on the world with the models `keep` to its end, and reads its pose log;
        all its files are in the new folder `folder`. Raises UserError if no file can be written.
        """
        world = folder / self._scenario.world.name
        if has_placeholder(self._words, "log"):
            file = world.with_name(f"{world.name}.poses.csv")
        else:
            file = None
        log = PoseLog(progress if file is None else None)
        whole = world.with_name(f"{world.name}.scenario.yaml")
        values = {
            "world": str(world),
            "scenario": str(whole),
            "seed": str(seed),
            "log": str(file or "/dev/stdout"),
        }
        words = filled(self._words, values)
        environment = self._environment(values)

        def too_much() -> str:
            size = log.size
            if file is not None:
                with contextlib.suppress(OSError):
                    size = file.stat().st_size
            if size > MOST_BYTES:
                return TOO_LARGE
            return ""

        try:
            with running(words, start_folder(self._scenario), environment, folder) as command:
                scenario = scenario_in(self._scenario, self._whole, world)
                write_files(
                    folder, {world: without(self._world, self._removable - keep), whole: scenario}
                )
                command.say(BEGIN)
                ended = watch(
                    command, self.limit, log.add if file is None else lambda _: None, too_much
                )
                # Reading a log that is too large would take longer than writing it did.
                if file is not None and ended.reason != TOO_LARGE and file.is_file():
                    with contextlib.suppress(OSError), file.open("rb") as content:
                        while log.size <= MOST_BYTES and (piece := content.read(1_000_000)):
                            log.add(piece)
        except OSError as error:
            ended = Ended(
                None, f"the command cannot be started: {error.strerror}: {error.filename}", ""
            )
        return ended, log

    def _environment(self, values: dict[str, str]) -> dict[str, str]:
        """Our own environment, and what the command needs to know about the scenario."""
        spawn = self._scenario.robot.spawn
        goal = self._scenario.goal
        known = {f"DDENV_{name.upper()}": value for name, value in values.items()}
        known["DDENV_TIMEOUT"] = f"{self._scenario.failure.timeout:.12g}"
        known["DDENV_SPAWN"] = _numbers(spawn.x, spawn.y, spawn.z, spawn.yaw)
        known["DDENV_GOAL"] = _numbers(goal.x, goal.y, goal.tolerance)
        # The folders that are searched for the world's models without any variable.
        beside = [folder for folder, _ in around(self._scenario.world.parent) if is_folder(folder)]
        folders = [*beside, *self._scenario.reading.model_path]
        for name in (variable for variable in VARIABLES if not PLACES[variable]):
            before = os.environ.get(name)
            known[name] = os.pathsep.join([*map(str, folders), *([before] if before else [])])
        return {**os.environ, **known}

    def _judged(self, ended: Ended, log: PoseLog) -> tuple[str, str, Floats]:
        said = f": {ended.complaint}" if ended.complaint else ""
        if ended.code is None or ended.code not in OUTCOMES:
            why = ended.reason or (
                f"the command's exit code is {ended.code}, neither 0 nor 1{_of_a_shell(ended.code)}"
            )
            return "error", why + said, self._rows(log)
        if ended.code == 1 and ended.raised:
            return "error", f"the command ended with an exception{said}", self._rows(log)
        try:
            outcome = OUTCOMES[ended.code]
            rows = log.finish()
            timeout = self._scenario.failure.timeout
            if rows[-1, 0] > MUCH_LATER * timeout:
                raise BadLog(
                    f"the pose log ends at {rows[-1, 0]:g} s, and the timeout is {timeout:g} s: "
                    "times are in s"
                )
            return (
                outcome,
                kind_of(rows, fell=False, arrived=None) if outcome == "failed" else "",
                rows,
            )
        except BadLog as error:
            return "error", f"{error}{said}", self._rows(log)

    def _rows(self, log: PoseLog) -> Floats:
        """The rows (N, 8) of a run that broke: at least the robot's start."""
        rows = log.rows()
        if len(rows):
            return rows
        start = spawn_pose(self._scenario.robot.spawn)
        return np.array([[0.0, *start.position, *start.quaternion]])


def _of_a_shell(code: int | None) -> str:
    """Which signal an exit code stands for, as shells have it, where a program under the command
    was ended by one.
    """
    number = 0 if code is None else code - 128
    if number in set(signal.Signals):
        return f" ({signal_name(number)})"
    return ""


def scenario_in(scenario: Scenario, whole: Whole, file: Path) -> bytes:
    """The scenario in the part of its world in `file`, as YAML: for simulators that run the same
    robot.
    """
    there = {"oracle": None, "whole": whole, "world": file}
    data = scenario.model_copy(update=there).model_dump(mode="json")
    # Files beside the original world are not beside the reduced one.
    data["reading"]["model_path"] = [str(scenario.world.parent), *data["reading"]["model_path"]]
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode()


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.12g}" for value in values)


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """The name of a folder that is made with its files, once a supervisor is there that removes it
    if this process is killed.
    """
    try:
        folder = Path(tempfile.gettempdir()) / f"ddenv-{uuid.uuid4().hex}"
    except OSError as error:
        raise _no_room(error) from None
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def write_files(folder: Path, files: dict[Path, bytes]) -> None:
    """Writes `files` into the folder, which is made if need be. Raises UserError."""
    try:
        folder.mkdir(0o700, exist_ok=True)
        for file, text in files.items():
            file.write_bytes(text)
    except OSError as error:
        raise _no_room(error) from None


def _no_room(error: OSError) -> UserError:
    why = f"{error.strerror}: {error.filename}" if error.filename else error.strerror
    return UserError(f"no temporary file can be written ({why}); set TMPDIR to a folder with room")


COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
EXPECTED = f"expected {','.join(COLUMNS)} (s, m, a quaternion)"
# A log that ends after so many times the timeout has other units.
MUCH_LATER = 10.0
MOST_BYTES = 64_000_000
TOO_LARGE = f"the pose log is larger than {MOST_BYTES / 1e6:.0f} MB; a row every 0.1 s is enough"
# Longer than any row of eight numbers, and larger than any number of seconds or metres.
LONGEST_LINE = 1000
GREATEST = 1e9
SHORTEST_QUATERNION = 1e-6
SHORTEST_GAP = 0.001  # s
SHOWN = 60  # how many characters of a wrong line are reported

# t (s), x, y, z (m), qw, qx, qy, qz.
Row = tuple[float, float, float, float, float, float, float, float]


class BadLog(WrongAnswer):
    """What is wrong with a pose log, in one line."""


class PoseLog:
    """Reads a log piece by piece. It keeps the first row, a row every 0.1 s, and the last one.

    Blank lines and lines that begin with # are skipped; the first line may be a header. `progress`
    gets each row that is kept, except for the last. `size` is the number of bytes so far.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._rest = b""
        self._problem = ""
        self._number = 0
        self._began = False
        self._rows: list[Row] = []
        self._last: Row | None = None
        self.size = 0

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
            self._problem = str(error)
            self._rest = b""

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
        rest = self._rest
        self._rest = b""
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
        numbers = [number for field in fields if (number := _number(field)) is not None]
        began = self._began
        self._began = True
        if not began and not numbers:
            # A header may name eight columns as it likes, but must not name the quaternion's in
            # another order.
            turned = [field.lower() for field in fields[4:]]
            known = list(COLUMNS[4:])
            if len(fields) != len(COLUMNS) or (sorted(turned) == sorted(known) and turned != known):
                raise self._wrong(text)
            return
        if not len(fields) == len(numbers) == len(COLUMNS) or not all(map(math.isfinite, numbers)):
            raise self._wrong(text)
        kept = self.take(numbers, f"the pose log, line {self._number}")
        if kept is not None and self._progress is not None:
            self._progress(kept[0], kept[1:], {})

    def take(self, numbers: Sequence[float], where: str) -> Row | None:
        """Adds t, x, y, z, qx, qy, qz, qw, finite numbers; returns the row if it is kept. Raises
        BadLog, which says `where`.
        """
        if max(map(abs, numbers)) > GREATEST:
            raise BadLog(f"{where}: a number is above {GREATEST:g}: times are in s, places in m")
        t, x, y, z, *turn = numbers
        before = 0.0 if self._last is None else self._last[0]
        if t < before:
            raise BadLog(f"{where}: time goes back from {before:g} to {t:g} s")
        length = math.hypot(*turn)
        if length < SHORTEST_QUATERNION:
            raise BadLog(
                f"{where}: the quaternion {','.join(f'{part:g}' for part in turn)} has no length"
            )
        qx, qy, qz, qw = (part / length for part in turn)
        self._last = row = (t, x, y, z, qw, qx, qy, qz)
        # Times that are sums of steps deviate a little.
        if self._rows and t < self._rows[-1][0] + 0.999 * RECORD_PERIOD:
            return None
        self._rows.append(row)
        return row

    def _wrong(self, text: str) -> BadLog:
        shown = printable(text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}...")
        commas = ";" in text or text.count(",") + 1 == 2 * len(COLUMNS)
        hint = "; write decimal points, and commas between the numbers" if commas else ""
        numbers = [number for field in text.split(",") if (number := _number(field)) is not None]
        if not all(map(math.isfinite, numbers)):
            hint = "; a number is not finite"
        return BadLog(f"the pose log, line {self._number}: {EXPECTED}, found '{shown}'{hint}")


def _number(field: str) -> float | None:
    try:
        return float(field)
    except ValueError:
        return None
