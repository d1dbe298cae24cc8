"""`ddenv open RUN --lines`: a line for each thing that happens; what the user types is answered, or
done.
"""

from __future__ import annotations

import os
import select
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

from ddenv.errors import UserError
from ddenv.evidence.claims import fresh_runs
from ddenv.guiding.commands import (
    Command,
    Context,
    Isolate,
    Row,
    StartEngine,
    question,
    said,
    send,
    starts_engine,
)
from ddenv.guiding.key_offers import KeyOffer, Pointed, offer
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, RunState, Trial
from ddenv.runs import engine_job, processor
from ddenv.runs.tests_left import left_said
from ddenv.text import count, first_of, plain, printable
from ddenv.words.claims import drift, what_ran
from ddenv.words.explain import explain
from ddenv.words.news import headline, news
from ddenv.workbench.shared.poll import Poll
from ddenv.workbench.shared.processes import Engine

# The maximum number of models that a line names.
NAMED = 50
# The tries that are listed, the latest ones.
TRIES = 5
# By the words that are typed: the action of `ddenv.guiding.key_offers`, the screen's key for it,
# and what it does.
GUIDES = {
    "pause": ("pause", "space", "start no new test; again to resume"),
    "step": ("step", "s", "run one test, then pause"),
    "round": ("step_round", "S", "run to the end of the round, then pause"),
    "accept": (
        "accept",
        "a",
        "accept the reduction that waits; 'accept try 1' adopts a try that shows f",
    ),
    "reject": ("reject", "x", "reject the reduction that waits"),
    "veto": ("veto", "v", "leave out a candidate: 'veto part B'; again takes that back"),
    "pin": ("pin", "p", "keep models: 'pin crate_01, crate_02'; again unpins them"),
    "without": ("without", "w", "try the environment without models: 'without crate_01'"),
    "only": ("only", "o", "try models alone: 'only crate_01, crate_02'"),
    "drop": ("leave_out", "H", "leave out the model that only helps, as certified"),
    "undo": ("undo", "u", "take back the last reduction"),
    "isolate": ("isolate", "i", "find a nearest world that passes; again stops that"),
    "ask": ("mode", "t", "accept reductions automatically, or ask before each one"),
    "resume": ("resume", "r", "start the engine again"),
}
_KEYS = {key: words for words, (_, key, _) in GUIDES.items()}
# How often the run file is read, s, and how many lines of what happened before are said first.
PERIOD = 0.2
BEFORE = 10
YES = ("y", "yes")
WATCHING = "watching only: nothing that you type changes the run"


def status(snapshot: Snapshot) -> Iterator[str]:
    state = snapshot.state
    yield headline(state)
    if forms := drift(state):
        yield forms[0]
    if left := left_said(state, snapshot.engine == "alive"):
        yield left[0]
    engines = {"alive": "an engine is running", "starting": "the engine starts"}
    yield engines.get(snapshot.engine, "no engine is running")


def table(snapshot: Snapshot) -> Iterator[str]:
    state = snapshot.state
    for trial in state.trials[-TRIES:]:
        yield _said_of(state, trial)
    if state.certificate is not None:
        for fresh in fresh_runs(state):
            runs = count(fresh.claim.runs, "run")
            yield f"{plain(what_ran(fresh))}: f in {fresh.claim.shown} of {runs}"
    elif state.round is not None:
        yield from (_said_of(state, candidate) for candidate in state.round.candidates)
    else:
        yield "there is no round yet"


def _said_of(state: RunState, row: Candidate | Trial) -> str:
    running = any(test.outcome == "running" for test in state.tests_of(row.tests))
    verdict = row.verdict or ("in test" if running else "not judged yet")
    distance = row.distance if isinstance(row, Candidate) else None
    away = "" if distance is None else f", ranked by {distance:.1f}"
    return (
        f"{row.label}: {count(row.size, 'model')}, {verdict}, {count(len(row.tests), 'test')}{away}"
    )


def models(snapshot: Snapshot) -> Iterator[str]:
    state = snapshot.state
    names = [
        f"{plain(name)}{' (pinned)' if name in state.pinned else ''}" for name in state.environment
    ]
    yield f"{count(len(names), 'model')} left: {first_of(names, NAMED) or 'none'}"


QUESTIONS: dict[str, tuple[Callable[[Snapshot], Iterator[str]], str]] = {
    "status": (status, "where the run is"),
    "why": (lambda snapshot: iter(explain(snapshot).sentences), "what is happening, and why"),
    "table": (table, "the candidates of this round with their verdicts"),
    "models": (models, "the models that are left"),
}


def meaning(line: str, now: Context) -> KeyOffer | None:
    """What a line asks for now; None if it guides nothing. Raises UserError for a row or a model
    that there is not.
    """
    first, _, rest = line.strip().partition(" ")
    word = first if first in GUIDES else _KEYS.get(first, "")
    rest = rest.strip()
    if not word:
        return None
    action = GUIDES[word][0]
    state = now.state
    if action in ("pin", "without", "only"):
        names = tuple(name.strip() for name in rest.split(",") if name.strip())
        if not names:
            raise UserError(f"{word}: which models? Type their names after it, separated by commas")
        if unknown := [name for name in names if name not in state.environment]:
            raise UserError(
                f"there is no model '{unknown[0]}' in what is left; 'models' lists them"
            )
        return offer(action, now, Pointed(models=names))
    rows: list[Row] = [*state.trials, *(state.round.candidates if state.round is not None else ())]
    row = next((row for row in rows if row.label.casefold() == rest.casefold()), None)
    if rest and row is None:
        raise UserError(
            f"there is no '{rest}' in this round; 'table' lists the candidates and tries"
        )
    return offer(action, now, Pointed(row))


class LineMode:
    """Follows a run: says what is new at each turn, and does what was typed meanwhile. Raises
    UserError for what is no run file.
    """

    def __init__(self, path: Path, watch: bool, out: TextIO) -> None:
        self._out = out
        self._news: deque[str] = deque(maxlen=BEFORE)
        self._engine = Engine(path)
        self._poll = Poll(
            path, starting=lambda: self._engine.starting, watch=watch, on_event=self._happened
        )
        self._error = ""
        # What a yes would send.
        self._asked: Command | None = None

    def follow(self, lines: Iterator[str | None]) -> None:
        """Until the user quits, or until the engine has ended and nothing more can be typed.

        `lines` gives what was typed, "" for nothing yet, None once nothing more can come.
        """
        self._look()
        self._say(
            f"{plain(self._poll.path.stem)}: type help for what you can do; quit leaves, and the "
            "engine goes on"
        )
        self._say(*self._news, *status(self._poll.snapshot))
        self._news = deque()
        for line in lines:
            self._look()
            self._say(*self._news)
            self._news.clear()
            if line is None and self._poll.snapshot.engine == "absent":
                break
            if line and not self._do(line.strip()):
                break
        self._poll.close()

    def _happened(self, kind: str, before: RunState, after: RunState) -> None:
        if words := news(kind, before, after, attached=True):
            self._news.append(words)

    def _look(self) -> None:
        self._poll.look()
        while self._poll.catching_up:
            self._poll.look()
        snapshot = self._poll.snapshot
        if snapshot.engine == "alive":
            self._engine.seen_at_work()
        error = snapshot.error or ("" if snapshot.engine == "alive" else self._engine.trouble)
        if error and error != self._error:
            self._say(error)
        self._error = error

    def _say(self, *lines: str) -> None:
        for words in lines:
            print(printable(words), file=self._out, flush=True)

    @property
    def _situation(self) -> Context:
        snapshot = self._poll.snapshot
        if self._poll.watch:
            barred = WATCHING
        elif snapshot.error:
            barred = "this run file cannot be read"
        else:
            barred = ""
        return Context(snapshot.state, snapshot.engine, barred)

    def _do(self, line: str) -> bool:
        """Does what a line asks for; False to leave."""
        asked = self._asked
        self._asked = None
        if line in ("quit", "q"):
            return False
        if asked is not None and line.casefold() in YES:
            self._send(asked)
        elif line in ("help", "?"):
            self._say(*(f"{word}: {what}" for word, (_, what) in QUESTIONS.items()))
            self._say(*(f"{word} or {key}: {what}" for word, (_, key, what) in GUIDES.items()))
            self._say("quit or q: leave; the engine goes on")
        elif line in QUESTIONS:
            self._say(*QUESTIONS[line][0](self._poll.snapshot))
        else:
            self._guide(line)
        return True

    def _guide(self, line: str) -> None:
        try:
            offered = meaning(line, self._situation)
        except UserError as error:
            self._say(str(error))
            return
        if offered is None:
            self._say(f"there is no command '{line[:60]}'; help lists them")
        elif offered.why_not or offered.command is None:
            self._say(f"not possible: {offered.why_not}")
        elif isinstance(offered.command, StartEngine):
            self._start()
        elif isinstance(offered.command, Isolate):
            self._start(engine_job.Isolate())
        elif words := question(offered.command, self._poll.snapshot.state):
            self._asked = offered.command
            self._say(f"{words} Type yes to do it.")
        else:
            self._send(offered.command)

    def _send(self, command: Command) -> None:
        now = self._situation
        try:
            send(self._poll.file, command)
        except UserError as error:
            self._say(str(error))
            return
        self._say(said(command, now) or f"asked: {command.words(now.state).brief}")
        if starts_engine(command, now.state) and now.engine == "absent":
            self._start()

    def _start(self, job: engine_job.Job | None = None) -> None:
        state = self._poll.snapshot.state
        try:
            self._engine.start(state.jobs or processor.usable_cores(), state.accept_mode, job)
        except UserError as error:
            self._say(str(error))
        else:
            self._say("the engine starts")


def typed_lines(typed: TextIO) -> Iterator[str | None]:
    """Lines as they are typed, "" when there was none for `PERIOD`, and None from the end of the
    input on.
    """
    handle = typed.fileno()
    waiting = b""
    while True:
        if not select.select([handle], [], [], PERIOD)[0]:
            yield ""
            continue
        piece = os.read(handle, 4096)
        if not piece:
            break
        *whole, waiting = (waiting + piece).split(b"\n")
        yield from (line.decode(sys.stdin.encoding or "utf-8", "replace") for line in whole)
    if waiting:
        yield waiting.decode(errors="replace")
    while True:
        yield None
        time.sleep(PERIOD)
