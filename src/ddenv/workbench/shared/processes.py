"""The programs beside the workbench: the engine it started, and the scene."""

from __future__ import annotations

import json
import os
import subprocess
from contextlib import suppress
from pathlib import Path
from threading import Thread

from ddenv.errors import UserError
from ddenv.runfile import reading
from ddenv.runfile.tested import Wanted
from ddenv.runs.engine_job import EngineOptions, Job, Reduce
from ddenv.text import plain

# Maximum time that the screen waits for a program to end, s.
A_MOMENT = 0.3
# Exit codes of an engine that has finished or was stopped.
GOOD_ENDS = (0, 1)


class Engine:
    """The engine of one run, if this workbench started it. It goes on when the screen closes."""

    def __init__(self, run: Path) -> None:
        self.run = run
        self._process: subprocess.Popen[bytes] | None = None
        self._worked = False
        self._last_words = ""

    def start(self, jobs: int, accept_mode: str, job: Job | None = None) -> None:
        """Starts it on a `job`, by default on the reduction. Raises UserError if it cannot be
        started.
        """
        from ddenv.runs.programs import start_engine

        options = EngineOptions(jobs=max(1, jobs), accept_mode=accept_mode, attended=True)
        try:
            self._process = start_engine(self.run, options, job or Reduce())
        except OSError as error:
            raise UserError(f"{self.run}: the engine cannot be started: {error.strerror}") from None
        self._worked = False
        self._last_words = ""

    def seen_at_work(self) -> None:
        """It has the run's lock: from now on the lock shows whether it is alive."""
        self._worked = True

    @property
    def starting(self) -> bool:
        return self._process is not None and not self._worked and self._process.poll() is None

    @property
    def trouble(self) -> str:
        code = None if self._process is None else self._process.poll()
        if code in (None, *GOOD_ENDS):
            return ""
        from ddenv.runs.programs import last_words

        # Read once: this is called at each look, and the log can be long.
        self._last_words = self._last_words or plain(last_words(self.run))
        return f"The engine ended: {self._last_words}"


class Scene:
    """The scene program of one run. `url` is known as soon as it serves; `trouble` says why it does
    not.
    """

    def __init__(self, run: Path) -> None:
        self.run = run
        self.url = ""
        self.trouble = ""
        self._process: subprocess.Popen[str] | None = None
        self._wanted = Wanted()

    @property
    def on(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Starts the program; `wait` for its URL then."""
        from ddenv.runs.programs import start_scene

        self.url = self.trouble = ""
        try:
            self._process = start_scene(self.run)
            self._ask()
        except OSError as error:
            self.trouble = f"the scene cannot be started: {error.strerror}"

    def show(self, wanted: Wanted) -> None:
        if wanted != self._wanted:
            self._wanted = wanted
            self._ask()

    def _ask(self) -> None:
        if self._process is None or self._process.stdin is None:
            return
        # A scene that hangs must not stop the screen, and one that has ended needs nothing.
        with suppress(OSError):
            os.set_blocking(self._process.stdin.fileno(), False)
            os.write(
                self._process.stdin.fileno(),
                f"{json.dumps(reading.plain(self._wanted))}\n".encode(),
            )

    def wait(self) -> None:
        """Blocks until the program has printed its URL or has ended: not for the screen's
        thread.
        """
        process = self._process
        if process is None or process.stdout is None:
            return
        url = plain(process.stdout.readline())
        if url.startswith("http://"):
            self.url = url
        else:
            log = self.run.with_name(f"{self.run.name}.scene.log")
            self.trouble = f"the scene did not start: {last_line(log) or f'see {log}'}"

    def stop(self) -> None:
        process = self._process
        self._process = None
        self.url = ""
        if process is None:
            return
        process.terminate()
        # The screen waits no longer.
        with suppress(subprocess.TimeoutExpired):
            process.wait(A_MOMENT)

        def end() -> None:
            with process:
                try:
                    process.wait(timeout=2.0)
                except subprocess.TimeoutExpired:
                    process.kill()

        Thread(target=end, name="scene").start()


def last_line(log: Path) -> str:
    try:
        lines = log.read_text(errors="replace").splitlines()
    except OSError:
        return ""
    return next((plain(line) for line in reversed(lines) if line.strip()), "")
