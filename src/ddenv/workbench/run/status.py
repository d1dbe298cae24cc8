"""The lines above and below the panels: what is reduced and how far it is; the engine, the tests
and the time.
"""

from __future__ import annotations

from rich.style import Style
from rich.text import Text
from textual.widget import Widget

from ddenv import __version__
from ddenv.evidence.claims import has_dropped
from ddenv.runfile.progress import path
from ddenv.runfile.run_settings import settings
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState
from ddenv.runs.tests_left import left_said, remaining
from ddenv.text import Sentences, count, duration, percent, plain, shortened, truncated
from ddenv.words.claims import drift, ended
from ddenv.words.methods import GROUPS, labels
from ddenv.words.signs import STATUS
from ddenv.workbench.terminal.themes import ink

OUTCOME_ORDER = ("similar", "pass", "other", "failed", "timeout", "error")
# What is shortened or left out until the rest fits, the least important first.
SHRINK = (
    *(
        "cut",
        "time",
        "left",
        "engine",
        "scene",
        "tests",
        "drift",
        "left",
        "mode",
        "drift",
        "left",
        "tests",
    ),
    *("asked", "engine", "tests", "drift", "state"),
)
# Which states end with a notification: the first one of these that follows another state.
WORTH = ("finished", "failed", "lost", "waiting", "stopped")
# The title goes in steps of so many per cent: each change is sent to the terminal.
STEP = 5


# What the status line says, by name, from the longest form to the shortest.
Facts = dict[str, Sentences]
# From left to right.
ORDER = (
    "state",
    "way back",
    "asked",
    "tests",
    "drift",
    "cut",
    "time",
    "left",
    "mode",
    "engine",
    "scene",
)


class Header(Widget):
    """What is reduced, and how far it is."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._heading: tuple[Sentences, Sentences] = ("",), ("",)

    def show(self, snapshot: Snapshot) -> None:
        now = heading(snapshot.state)
        if now != self._heading:
            self._heading = now
            self.refresh()

    def render(self) -> Text:
        (lefts, rights) = self._heading
        room = self.size.width - 9
        shortest = min(map(len, lefts))
        right = next((each for each in rights if shortest + len(each) + 2 <= room), rights[-1])
        room = max(0, room - len(right) - 2)
        left = next((each for each in lefts if len(each) <= room), truncated(lefts[-1], room))
        text = Text(" ", no_wrap=True).append(
            "ddenv", ink(self.app.theme_variables, "primary", bold=True)
        )
        return text.append(f"  {left:<{room}}  ", "bold").append(right)


class Status(Widget):
    """State, tests by outcome, time, engine and scene."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._facts: Facts = {}
        self._snapshot: Snapshot | None = None
        self._besides: tuple[str, str, tuple[int, int] | None] = ("", "", None)

    def show(
        self,
        snapshot: Snapshot,
        scene: str = "",
        asked: str = "",
        place: tuple[int, int] | None = None,
    ) -> None:
        """`scene` is the URL of the 3-D scene while it is on, `asked` the command that waits for
        its answer.

        At an earlier moment of the run, `place` is its number, and the number of moments.
        """
        if (scene, asked, place) == self._besides and snapshot is self._snapshot:
            # Counting the tests of a long run takes longer than answering a key.
            return
        self._snapshot = snapshot
        self._besides = (scene, asked, place)
        if place is None:
            now = facts(snapshot, scene, asked)
        else:
            now = facts_of_past(snapshot, scene, *place)
        if now != self._facts:
            self._facts = now
            self.refresh()

    def render(self) -> Text:
        text = Text(" ", no_wrap=True, overflow="ellipsis")
        for name, words in fitted(self._facts, self.size.width):
            text.append(words, self._style(name)).append("   ")
        return text

    def _style(self, name: str) -> Style:
        if name == "state":
            colors = {
                "waiting": "text-warning",
                "lost": "text-error",
                "failed": "text-error",
                "paused": "text-warning",
            }
            status = self._snapshot.status if self._snapshot else ""
            variable = "text-warning" if self._besides[2] else colors.get(status, "text-success")
            return ink(self.app.theme_variables, variable, bold=True)
        if name == "scene":
            # An OSC 8 link: terminals that know it open the page with a click.
            return Style(link=self._besides[0], underline=True)
        if name == "drift" and self._snapshot is not None and has_dropped(self._snapshot.state):
            return ink(self.app.theme_variables, "text-warning", bold=True)
        return Style(dim=name in ("time", "left", "mode", "way back", "cut"))


def heading(state: RunState) -> tuple[Sentences, Sentences]:
    options = settings(state)
    lefts = tuple(f"{options.name} · {label}" for label in labels(options.algorithm, options.pair))
    total = len(state.elements)
    kept = len(state.environment)
    size = f"{kept} of {count(total, 'model')}"
    more = [f"{percent(1 - kept / total)} smaller"] if kept < total else []
    pinned = [f"{len(state.pinned)} pinned"] if state.pinned else []
    branch = [f"branch {number}"] if (number := branch_of(state)) else []
    step = []
    if state.round is not None:
        n = "" if options.algorithm in GROUPS else f" · n {state.round.n_partitions}"
        step = [f"round {state.round.number}{n}"]
    rights = (
        [*branch, *step, size, *pinned, *more],
        [*branch, *step, size, *pinned],
        [*branch, size],
        [size],
    )
    # Without branches and pins there is only one form.
    return lefts, tuple(" · ".join(words) for words in (rights if branch or pinned else rights[:1]))


def branch_of(state: RunState) -> int | None:
    """Which branch of the tree of reductions the current node is on, from 1, in the order in which
    the branches began.

    None on the newest one: that is where a run usually is.
    """
    nodes = state.nodes
    if not 0 <= state.node < len(nodes) or state.here in path(nodes, len(nodes) - 1):
        return None
    above = {node.parent for node in nodes if not node.rejected}
    leaves = [node.number for node in nodes if node.number not in above and not node.rejected]
    return next(
        (place for place, leaf in enumerate(leaves, start=1) if state.here in path(nodes, leaf)),
        None,
    )


def facts(snapshot: Snapshot, scene: str = "", asked: str = "") -> Facts:
    state = snapshot.state
    said: Facts = {
        "state": _state_said(snapshot),
        "tests": tests_said(state),
        "drift": drift_said(state),
        "left": left_said(state, snapshot.engine == "alive"),
        "engine": engine_said(snapshot),
    }
    if asked:
        said["asked"] = (f"… {asked}", "…")
    if state.cut_tests:
        said["cut"] = (f"{state.cut_tests} ended early", "")
    if snapshot.spent:
        said["time"] = (duration(snapshot.spent), "")
    if state.accept_mode == "ask" and not state.ended:
        said["mode"] = ("accept: ask", "")
    if scene:
        said["scene"] = (f"scene {scene}", "scene")
    return said


def _state_said(snapshot: Snapshot) -> tuple[str, ...]:
    if snapshot.gone:
        return ("✗ the run file is gone",)
    state = snapshot.state
    status = _status(snapshot)
    (sign, word) = STATUS.get(status, ("·", status))
    if status == "lost":
        return (f"{sign} {word}: r resumes", f"{sign} {word}")
    if state.needs_room and not state.ended:
        return ("! file too large" if state.file_is_full else "! out of disk space",)
    return (f"{sign} {word}",)


def _status(snapshot: Snapshot) -> str:
    """The status, with what is done in it."""
    state = snapshot.state
    match snapshot.status:
        case "running" if state.isolating is not None:
            return "isolating"
        case "running" if state.confirming:
            return "certifying"
        case "running" if state.margining is not None:
            return "margins"
        case "baseline" if state.settling:
            return "settling"
    return snapshot.status


def facts_of_past(snapshot: Snapshot, scene: str, moment: int, moments: int) -> Facts:
    said: Facts = {
        "state": (f"◂ moment {moment} of {moments}",),
        "way back": ("escape: now",),
        "tests": tests_said(snapshot.state),
    }
    if snapshot.spent:
        said["time"] = (duration(snapshot.spent), "")
    if scene:
        said["left"] = ("scene shows it", "")
    return said


def fitted(said: Facts, width: int) -> list[tuple[str, str]]:
    """(name, words) of what fits into `width` cells."""
    forms = {name: list(said[name]) for name in ORDER if said.get(name)}
    for name in SHRINK:
        if sum(len(each[0]) + 3 for each in forms.values() if each[0]) <= width:
            break
        if len(forms.get(name, ())) > 1:
            del forms[name][0]
    return [(name, each[0]) for name, each in forms.items() if each[0]]


def tests_said(state: RunState) -> Sentences:
    counts = state.outcomes()
    total = state.tests_done
    if state.budget is None:
        said = count(total, "test")
    else:
        said = f"{state.made} of {count(state.budget, 'test')}"
    said += f", {state.implied} implied" if state.implied else ""
    # Before its end, anything may still come to be needed.
    said += (
        f", {state.ahead} started early and not needed"
        if state.ahead and state.status == "finished"
        else ""
    )
    parts = " ".join(f"{counts[name]} {name}" for name in OUTCOME_ORDER if counts.get(name))
    return (f"{said}: {parts}" if parts else said, said, "")


def drift_said(state: RunState) -> Sentences:
    """How often f shows here, beside the whole world; marked where it has dropped, with the key
    that goes back.
    """
    forms = drift(state)
    if has_dropped(state):
        return tuple(f"▼ {form}: u goes back" for form in forms)
    if forms:
        return (*forms, "")
    return ()


def engine_said(snapshot: Snapshot) -> Sentences:
    """Whether the engine works, and whether it is of another version than this program."""
    state = snapshot.state
    if snapshot.engine == "starting":
        return ("engine ◌", "")
    if snapshot.engine != "alive":
        silent = state.status == "finished" or snapshot.status == "lost" or snapshot.gone
        if silent:
            return ()
        return ("engine ○ off: r resumes", "")
    version = plain(state.engine_version)
    if version in ("", __version__):
        return ("engine ●", "")
    return (f"engine ● {shortened(version, 12)}, not {__version__}", "engine of another version")


def title(snapshot: Snapshot) -> str:
    """The run, its state and how far it is, as short as a tab's title has to be."""
    state = snapshot.state
    name = shortened(plain(state.scenario.get("name", "")), 40)
    if not state.elements:
        return f"ddenv {name}"
    sign, word = STATUS.get(snapshot.status, ("·", snapshot.status))
    models = f"{len(state.environment)} of {count(len(state.elements), 'model')}"
    said = "" if snapshot.status in ("running", "baseline") else f", {word}"
    left = remaining(state, snapshot.engine == "alive")
    done = state.tests_done
    if left is None:
        part = ""
    else:
        part = f"{STEP * int(100 * done / max(1, done + left.tests[1]) / STEP)} % "
    return f"{sign} {part}{name}: {models}{said}"


def worth_a_look(before: Snapshot, now: Snapshot) -> str:
    """Why the user should look at the run now, if that is new since `before`; or ""."""
    status = now.status
    if status == before.status or status not in WORTH or before.behind or now.behind:
        return ""
    state = now.state
    if status == "waiting":
        return "a reduction waits for you: accept or reject it"
    if status == "finished":
        said = ended(state)
    else:
        said = ", ".join(filter(None, (STATUS[status][1], state.reason)))
    return f"{len(state.environment)} of {count(len(state.elements), 'model')} left; {plain(said)}"
