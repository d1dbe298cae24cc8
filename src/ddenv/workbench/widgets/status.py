"""The lines above and below the panels: what is reduced and how far it is; the engine, the tests and the time."""

from __future__ import annotations

from rich.style import Style
from rich.text import Text
from textual.widget import Widget

from ddenv.workbench.methods import labels
from ddenv.workbench.poll import Snapshot
from ddenv.workbench.rounds import GROUPS
from ddenv.workbench.settings import settings
from ddenv.workbench.wording import STATUS, count, duration, shorten

OUTCOME_ORDER = ("similar", "pass", "other", "failed", "timeout", "error")


class Line(Widget):
    """One line of text that is drawn again only when it changed."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._shown: tuple = ()
        self._snapshot = Snapshot()
        self.scene = ""
        self.asked = ""

    def show(self, snapshot: Snapshot, scene: str = "", asked: str = "") -> None:
        """`scene` is the URL of the 3-D scene while it is on, `asked` what the engine has been asked but not done yet."""
        self._snapshot, self.scene, self.asked = snapshot, scene, asked
        facts = self.facts(200)
        if facts != self._shown:
            self._shown = facts
            self.refresh()

    def facts(self, width: int) -> tuple:
        raise NotImplementedError


class Header(Line):
    """Scenario and method on the left, how far the reduction is on the right."""

    def facts(self, width: int) -> tuple[str, str, str]:
        """The program's name, the left and the right text; the method in the longest words that fit."""
        options = settings(self._snapshot.state)
        name, right = "ddenv", self._progress()
        room = max(0, width - 2 - len(name) - len(right) - 4)
        lefts = [f"{options.name} · {label}" for label in labels(options.algorithm, options.pair)]
        left = next((left for left in lefts if len(left) <= room), lefts[-1])
        return name, shorten(left, room), right

    def _progress(self) -> str:
        state = self._snapshot.state
        total, kept = len(state.elements), len(state.environment)
        progress = [f"{kept} of {count(total, 'model')}"]
        if state.round is not None:
            n = "" if settings(state).algorithm in GROUPS else f" · n {state.round.n_partitions}"
            progress.insert(0, f"round {state.round.number}{n}")
        if kept < total:
            progress.append(f"{round(100 * (1 - kept / total))} % smaller")
        return " · ".join(progress)

    def render(self) -> Text:
        name, left, right = self.facts(self.size.width)
        space = max(1, self.size.width - 4 - len(name) - len(left) - len(right))
        primary = self.app.theme_variables["primary"]
        text = Text(" ", no_wrap=True).append(name, f"bold {primary}").append(f"  {left}", "bold")
        return text.append(" " * space).append(right)


class Status(Line):
    """State, tests by outcome, time, engine and scene; what does not fit is left out from the least important on."""

    def facts(self, width: int) -> tuple[tuple[str, str], ...]:
        """(name, text) in the order of the screen."""
        snapshot = self._snapshot
        status = "confirming" if snapshot.status == "running" and snapshot.state.confirming else snapshot.status
        sign, word = STATUS.get(status, ("·", status))
        mode = "accept: ask" if snapshot.state.accept_mode == "ask" else ""
        facts = (
            ("state", f"{sign} {word}"),
            ("asked", f"… {self.asked}" if self.asked else ""),
            ("tests", _tests(snapshot)),
            ("time", duration(snapshot.spent) if snapshot.spent else ""),
            ("left", time_left(snapshot)),
            ("mode", "" if snapshot.state.ended else mode),
            ("engine", _engine(snapshot)),
            ("scene", f"scene {self.scene}" if self.scene else ""),
        )
        return tuple((name, text) for name, text in facts if text)

    def render(self) -> Text:
        facts = list(self.facts(self.size.width))
        for name in ("mode", "left", "time", "engine", "scene"):
            if sum(len(text) + 3 for _, text in facts) <= self.size.width:
                break
            facts = [fact for fact in facts if fact[0] != name]
        text = Text(" ", no_wrap=True, overflow="ellipsis")
        for name, words in facts:
            text.append(words, self._style(name)).append("   ")
        return text

    def _style(self, name: str) -> Style:
        if name == "state":
            colors = {"waiting": "warning", "lost": "error", "failed": "error", "paused": "warning"}
            variable = colors.get(self._snapshot.status, "success")
            return Style.parse(f"bold {self.app.theme_variables[variable]}")
        if name == "scene":
            # An OSC 8 link: terminals that know it open the page with a click.
            return Style(link=self.scene, underline=True)
        return Style(dim=name in ("time", "left", "mode"))


def time_left(snapshot: Snapshot) -> str:
    """The most that this round can still take; more cannot be known before the next one is made."""
    state, current = snapshot.state, snapshot.state.round
    if snapshot.engine != "alive" or state.paused or current is None or current.done or current.winner is not None:
        return ""
    times = [test.wall_seconds for test in state.finished_tests]
    seconds = [each for each in times if isinstance(each, (int, float)) and each > 0]
    if not seconds or state.waiting_candidate is not None:
        return ""
    full = 1 + settings(state).iterations
    running = {test.id for test in snapshot.running}
    tests = sum(full - len(set(each.tests) - running) for each in current.candidates if not each.verdict)
    return f"round: ≤ {duration(tests * sum(seconds) / len(seconds) / max(1, state.jobs))} left"


def _tests(snapshot: Snapshot) -> str:
    counts = snapshot.state.outcomes()
    total = sum(counts.values())
    parts = " ".join(f"{counts[name]} {name}" for name in OUTCOME_ORDER if counts.get(name))
    return f"{count(total, 'test')}: {parts}" if parts else count(total, "test")


def _engine(snapshot: Snapshot) -> str:
    if snapshot.engine == "alive":
        return "engine ●"
    if snapshot.engine == "starting":
        return "engine ◌"
    return "" if snapshot.state.status == "finished" else "engine ○ off, r resumes"
