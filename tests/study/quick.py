"""Engines in threads of this process, on a simulator that costs nothing: what a study starts as
programs.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from ddenv.engine import __main__ as program
from ddenv.errors import UserError
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import RunFile
from ddenv.runs.engine_job import EngineOptions, Order, Reduce
from ddenv.runs.programs import ENGINE_SAYS
from ddenv.study import conduct
from tests.engine.fake import FakePool

Oracle = Callable[[str, frozenset[str], int], str]


class Killed(BaseException):
    """Ends an engine without a word."""


class Engine:
    """An engine that begins to work on `run` at once, as far as a study looks at its process."""

    def __init__(self, lab: Lab, run: Path, options: EngineOptions) -> None:
        self._lab, self._run = lab, run
        with RunFile(run) as file:
            last = file.last_command()
        self._order = Order(job=Reduce(), options=options, last_command=last)
        self._terminated = threading.Event()
        self._code: int | None = None
        threading.Thread(target=self._work, daemon=True).start()

    def poll(self) -> int | None:
        return self._code

    def terminate(self) -> None:
        self._terminated.set()

    def _work(self) -> None:
        log = self._run.with_name(f"{self._run.name}.log")
        try:
            with RunFile(self._run) as file, engine_lock(self._run):
                self._code = program.work(file, self._order, self._terminated)
        except UserError as error:
            log.write_text(f"{ENGINE_SAYS} {error}\n")
            self._code = 2
        except BaseException as error:
            # Whatever it is, nobody waits for it in vain.
            self._code = -9
            if not isinstance(error, Killed):
                raise


class Lab:
    """Stands for all programs of a study. `oracle(scenario's name, models, seed)` says how a test
    ends.

    `before(run, made)` is called in the engine's thread before a test of `run` ends, with how many
    it has made since it was started.
    """

    def __init__(self, monkeypatch, oracle: Oracle) -> None:
        self.oracle = oracle
        self.before: Callable[[Path, int], None] = lambda run, made: None
        self.started: list[tuple[str, int]] = []
        self.made = 0
        monkeypatch.setattr(conduct, "POLL", 0.002)
        monkeypatch.setattr(conduct, "start_engine", self.start_engine)
        monkeypatch.setattr(program, "Pool", self._pool)
        monkeypatch.setattr(program, "read_parts", self._parts)
        # No program starts.
        monkeypatch.setattr(program, "check_trusted", lambda *_: None)

    def start_engine(self, run: Path, options: EngineOptions) -> Engine:
        self.started.append((run.stem, options.jobs))
        return Engine(self, run, options)

    def _parts(self, file: RunFile):
        scenario, world, robot = _read_parts(file)
        return scenario.model_copy(update={"folder": file.path}), world, robot

    def _pool(self, scenario, world, robot, jobs: int) -> FakePool:
        return _Pool(self, scenario.name, scenario.folder, jobs)


_read_parts = program.read_parts


class _Pool(FakePool):
    def __init__(self, lab: Lab, name: str, run: Path, jobs: int) -> None:
        super().__init__(lambda keep, seed: lab.oracle(name, keep, seed), jobs)
        self._lab, self._run = lab, run

    def finished(self, seconds: float) -> list:
        if self.running:
            self._lab.before(self._run, len(self.made))
            self._lab.made += 1
        return super().finished(seconds)

    def close(self) -> None:
        pass
