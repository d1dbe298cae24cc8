"""Starts and stops the programs beside a view, the engine and the 3-D scene, and says how to
install what is missing.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from ddenv.errors import UserError
from ddenv.runfile.lock import engine_is_alive, mode_beside
from ddenv.runfile.store import RunFile
from ddenv.runs.engine_job import EngineOptions, Job, Order, Reduce

# Prefix of the engine's own lines in its log, where libraries print too; and its first line.
ENGINE_SAYS = "ddenv engine:"
ENGINE_STARTED = "started"
# The scene takes the first free port from here on.
FIRST_PORT = 7000
# Maximum time for engines to stop, s.
STOP_WAIT = 15.0
# How often a program is asked whether it has ended, s.
LOOK = 0.1
# Matches the last line of a traceback.
PYTHON_SAYS = re.compile(r"[\w.]*(Error|Exception)(:|$)")


def log_of(run: Path) -> Path:
    """Where the engines of a run write what they print."""
    return run.with_name(f"{run.name}.log")


def start_engine(
    run: Path, options: EngineOptions, job: Job | None = None
) -> subprocess.Popen[bytes]:
    """Starts the engine on a run in its own session, so that it outlives this terminal. Without a
    `job` it reduces.

    Its output goes to a log beside the run file. Raises UserError.
    """
    with RunFile(run) as file:
        order = Order(job=job or Reduce(), options=options, last_command=file.last_command())
    # After `--`, a name that begins with a dash is no option.
    words = [sys.executable, "-m", "ddenv.engine", "--", str(run), order.to_json()]
    try:
        log = _log(log_of(run), run)
    except OSError as error:
        raise UserError(
            f"{run}: cannot run an engine here: its log cannot be written: {error.strerror}"
        ) from None
    with log:
        return subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
        )


def _log(place: Path, run: Path) -> BinaryIO:
    return os.fdopen(os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, mode_beside(run)), "ab")


def export_mcap(run: Path, file: Path, stopped: Callable[[], bool]) -> None:
    """Writes what the robot sensed and did; the runs are made again by Drake in a process of their
    own.

    Raises UserError, also once it is `stopped`; then nothing is written.
    """
    words = [sys.executable, "-m", "ddenv", "export", "--mcap", str(file), "--", str(run)]
    with subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as program:
        said = None
        while said is None:
            with suppress(subprocess.TimeoutExpired):
                _, said = program.communicate(timeout=LOOK)
            if said is None and stopped():
                program.kill()
                raise UserError(f"{file}: stopped; nothing was written")
    if program.returncode:
        raise UserError(
            (said.strip().splitlines() or ["the program ended"])[-1].removeprefix("ddenv: ")
        )


def stop_engines(engines: Sequence[tuple[RunFile, subprocess.Popen[bytes]]]) -> None:
    """Asks all engines to stop, and waits for them; finished tests stay in their runs."""
    for file, engine in engines:
        try:
            file.send("stop")
        except UserError:
            engine.terminate()
    deadline = time.monotonic() + STOP_WAIT
    for file, engine in engines:
        while engine.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        if engine.poll() is None and engine_is_alive(file.path):
            engine.terminate()


def last_words(run: Path) -> str:
    """Why the last engine of a run is gone, from its log."""
    log = log_of(run)
    said = crashed = ""
    for line in log.read_text(errors="replace").splitlines() if log.exists() else []:
        if line.startswith(ENGINE_SAYS):
            said = line.removeprefix(ENGINE_SAYS).strip()
            crashed = ""
        elif PYTHON_SAYS.match(line):
            crashed = f": {line.strip()}"
    if said and said != ENGINE_STARTED:
        return said
    return (
        f"{run}: the engine was killed or crashed{crashed} (see {log}); go on with 'ddenv resume "
        f"{run}'"
    )


def start_scene(run: Path) -> subprocess.Popen[str]:
    """Starts the scene program on a run; its first line of output is the URL it serves on
    127.0.0.1.

    It shows what its standard input asks for (`Wanted`), and ends with its parent. An empty first
    line means that it could not start; its log says why.
    """
    try:
        log = _log(run.with_name(f"{run.name}.scene.log"), run)
    except OSError:
        # A run in a folder that cannot be written can be seen all the same.
        log = Path(os.devnull).open("wb")  # noqa: SIM115  (closed below)
    with log:
        words = [sys.executable, "-m", "ddenv.scene", str(run)]
        pipe = subprocess.PIPE
        return subprocess.Popen(
            words, stdin=pipe, stdout=pipe, stderr=log, text=True, start_new_session=True
        )


def how_to_install(extra: str = "") -> str:
    """What to type for ddenv, or for one of its extras, in words."""
    what = f"'.[{extra}]'" if extra else "."
    return f"pip install {what} in a checkout of ddenv-workbench (PyPI's ddenv is another program)"
