"""`ddenv open RUN --lines`: what happens in a run, a line for each thing, and what the user types is done."""

from __future__ import annotations

import os
import select
import sys
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from ddenv.errors import UserError, printable
from ddenv.guiding.commands import Command, data_of, question, said, starts_engine
from ddenv.guiding.course import StartEngine
from ddenv.guiding.situation import Situation
from ddenv.runfile.state import RunState
from ddenv.runs import processor
from ddenv.words.news import news
from ddenv.workbench.lines.said import QUESTIONS
from ddenv.workbench.lines.typed import GUIDES, meaning
from ddenv.workbench.run.poll import Poll
from ddenv.workbench.run.processes import Engine
from ddenv.workbench.wording import plain

# How often the run file is read, s, and how many lines of what happened before are said first.
PERIOD, BEFORE = 0.2, 10
YES = ("y", "yes")
WATCHING = "watching only: nothing that you type changes the run"


def follow_in_lines(path: Path, watch: bool, typed: TextIO, out: TextIO) -> None:
    """Follows a run until the user quits, or until its engine has ended and nothing more can be typed.

    Raises UserError for a file that is no run file.
    """
    LineMode(path, watch, out).follow(_lines(typed))


class LineMode:
    """Says what is new at each turn, and does what was typed meanwhile."""

    def __init__(self, path: Path, watch: bool, out: TextIO) -> None:
        self._out = out
        self._news: deque[str] = deque(maxlen=BEFORE)
        self._engine = Engine(path)
        self._poll = Poll(path, starting=lambda: self._engine.starting, watch=watch, on_event=self._happened)
        self._revision, self._error = 0, ""
        # What a yes would send.
        self._asked: Command | None = None

    def follow(self, lines: Iterator[str | None]) -> None:
        """`lines` gives what was typed, "" for nothing yet, None once nothing more can come."""
        self._look()
        self._say(f"{plain(self._poll.path.stem)}: type help for what you can do; quit leaves, and the engine goes on")
        self._tell_news()
        self._answer("status")
        self._news = deque()
        for line in lines:
            self._look()
            self._tell_news()
            if line is None and self._poll.snapshot.engine == "absent":
                break
            if line and not self._do(line.strip()):
                break
        self._poll.close()

    def _happened(self, kind: str, before: RunState, after: RunState) -> None:
        if after.revision <= self._revision:
            return
        self._revision = after.revision
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

    def _tell_news(self) -> None:
        while self._news:
            self._say(self._news.popleft())

    def _say(self, words: str) -> None:
        print(printable(words), file=self._out, flush=True)

    # What is typed.

    @property
    def _situation(self) -> Situation:
        snapshot = self._poll.snapshot
        barred = WATCHING if self._poll.watch else "this run file cannot be read" if snapshot.error else ""
        return Situation(snapshot.state, snapshot.engine, barred)

    def _do(self, line: str) -> bool:
        """Does what a line asks for; False to leave."""
        asked, self._asked = self._asked, None
        if line in ("quit", "q"):
            return False
        if asked is not None and line.casefold() in YES:
            self._send(asked)
        elif line in ("help", "?"):
            self._help()
        elif line in QUESTIONS:
            self._answer(line)
        else:
            self._guide(line)
        return True

    def _answer(self, question: str) -> None:
        for words in QUESTIONS[question][0](self._poll.snapshot):
            self._say(words)

    def _help(self) -> None:
        for word, (_, what) in QUESTIONS.items():
            self._say(f"{word}: {what}")
        for word, (_, key, what) in GUIDES.items():
            self._say(f"{word} or {key}: {what}")
        self._say("quit or q: leave; the engine goes on")

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
        elif words := question(offered.command, self._poll.snapshot.state):
            self._asked = offered.command
            self._say(f"{words} Type yes to do it.")
        else:
            self._send(offered.command)

    def _send(self, command: Command) -> None:
        now = self._situation
        try:
            self._poll.file.send(command.kind, **data_of(command))
        except UserError as error:
            self._say(str(error))
            return
        self._say(said(command, now) or f"asked: {command.words(now.state).brief}")
        if starts_engine(command, now.state) and now.engine == "absent":
            self._start()

    def _start(self) -> None:
        state = self._poll.snapshot.state
        try:
            self._engine.start(state.jobs or processor.usable_cores(), state.accept_mode)
        except UserError as error:
            self._say(str(error))
        else:
            self._say("the engine starts")


def _lines(typed: TextIO) -> Iterator[str | None]:
    """Lines as they are typed, "" when there was none for `PERIOD`, and None from the end of the input on."""
    handle, waiting = typed.fileno(), b""
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
