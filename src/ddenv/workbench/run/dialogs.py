"""Dialogs of the run screen: the method, quit, the scene, and the rounds so far."""

from __future__ import annotations

import getpass
import socket
from collections.abc import Sequence
from typing import ClassVar
from urllib.parse import urlsplit

from rich.style import Style
from rich.text import Text
from textual.app import ComposeResult
from textual.screen import ModalScreen
from textual.widgets import Static

from ddenv.runfile.failures import OtherFailure
from ddenv.runfile.position import Chapter
from ddenv.text import count, plain
from ddenv.words.methods import chosen, note, paragraph
from ddenv.workbench.help.dialogs import Pick, Reading
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys
from ddenv.workbench.shared.processes import Scene
from ddenv.workbench.widgets.question import Choice


class Method(Reading):
    """Algorithm, partitioning and prioritization of a run, each with its explanation."""

    BINDINGS: ClassVar = keys(
        "method", ("close", "escape,e,q,enter", "dismiss", "close", "close this dialog")
    )

    def __init__(self, algorithm: str, pair: str) -> None:
        groups = []
        for kind, name in chosen(algorithm, pair).items():
            said = (note(kind, algorithm), paragraph(kind, name))
            groups.append((f"{kind} {plain(name)}", [("", words) for words in said if words]))
        super().__init__("How this run is reduced", groups)


class Quit(Choice):
    """Asks whether to stop the engine: returns "stop", "leave" or "cancel"."""

    BINDINGS: ClassVar = keys(
        "quit",
        ("stop", "s", "answer('stop')", "stop the engine", "stop the engine and leave"),
        ("leave", "l", "answer('leave')", "keep it running", "leave; the engine goes on"),
        ("cancel", "escape,c", "answer('cancel')", "cancel", "stay here"),
    )

    def __init__(self) -> None:
        words = "The engine is a separate process; it can go on without this screen."
        answers = {"leave": "Keep it running", "stop": "Stop the engine", "cancel": "Cancel"}
        super().__init__("Quit", "l keep it running   s stop   c cancel", words, **answers)


class ReductionWaits(Choice):
    """Asks what becomes of a reduction that waits: returns "accept", "reject", "drop" or
    "cancel".
    """

    BINDINGS: ClassVar = keys(
        "waits",
        ("accept", "a", "answer('accept')", "accept", "make the reduction, then go on"),
        ("reject", "x", "answer('reject')", "reject", "reject the reduction, then go on"),
        ("drop", "d", "answer('drop')", "drop", "go on without deciding: it may come back"),
        ("cancel", "escape,c", "answer('cancel')", "cancel", "change nothing"),
    )

    def __init__(self, text: str) -> None:
        answers = {
            "accept": "Accept it",
            "reject": "Reject it",
            "drop": "Drop it",
            "cancel": "Cancel",
        }
        super().__init__(
            "A reduction waits", "a accept   x reject   d drop   c cancel", text, **answers
        )


class SceneDialog(ModalScreen[None]):
    """The scene's address, and how to reach it over SSH."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = keys(
        "scene",
        (
            "copy",
            "c",
            "copy('address')",
            "copy the address",
            "copy the address to the clipboard (OSC 52)",
        ),
        ("ssh", "s", "copy('ssh line')", "copy the ssh line", "copy the ssh line to the clipboard"),
        ("stop", "x", "stop", "stop the scene", "end the scene's process"),
        ("close", "escape,m,enter", "dismiss", "close", "close; the scene stays on"),
    )

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self._scene = scene

    def compose(self) -> ComposeResult:
        with Framed("Scene in 3-D", "c copy address   s copy ssh line   x stop   escape close"):
            yield Static("", id="address", markup=False)

    def on_mount(self) -> None:
        self.refresh_address()

    def refresh_address(self) -> None:
        text = Text("The scene starts ...", "dim")
        if self._scene.trouble:
            text = Text(self._scene.trouble, Style.parse(self.app.theme_variables["text-error"]))
        elif url := self._scene.url:
            text = Text("Open in a browser on this machine:\n\n  ")
            text.append(url, Style(bold=True, underline=True, link=url))
            text.append("\n\nFrom another machine, first type there:\n\n  ")
            text.append(ssh_line(url), "bold").append("\n\nand open the same address.")
        self.query_one("#address", Static).update(text)

    def action_copy(self, what: str) -> None:
        if url := self._scene.url:
            self.app.copy_to_clipboard(url if what == "address" else ssh_line(url))
        if url:
            said = f"{what} copied, if the terminal allows it"
        else:
            said = "the scene has no address yet"
        self.query_one(Framed).say(said)

    def action_stop(self) -> None:
        self._scene.stop()
        self.dismiss()


def ssh_line(url: str) -> str:
    """The command that makes the scene of this machine reachable from another one."""
    port = urlsplit(url).port
    return f"ssh -L {port}:127.0.0.1:{port} {getpass.getuser()}@{socket.gethostname()}"


def failures(found: Sequence[OtherFailure]) -> Pick:
    def line(failure: str, tests: str, smallest: str) -> Text:
        return Text(f"{failure:<36}{tests:>7}   {smallest}", no_wrap=True)

    lines = [
        line(one.name, str(len(one.tests)), f"{count(one.size, 'model')} (test {one.smallest})")
        for one in found
    ]
    head = line("failure", "tests", "smallest environment")
    return Pick("Other failures met", "reduces it in a branch", lines, head=head)


def rounds(chapters: Sequence[Chapter], at: int | None) -> Pick:
    """The list of rounds. The cursor starts on the chapter with the event `at`, or on the last
    one.
    """

    def line(name: str, models: str, left: str, tests: str) -> Text:
        return Text(f"{name:<16}{models:>8}{left:>10}{tests:>14}", no_wrap=True)

    lines = []
    for one in chapters:
        left = ""
        if one.kind == "round":
            left = f"{'○' if one.left == one.models else '●'} {one.left}"
        name = "baseline" if one.kind == "baseline" else f"{one.kind} {one.number}"
        lines.append(line(name, str(one.models), left, count(one.tests, "test")))
    start = next(
        (row for row, each in enumerate(chapters) if at and at <= each.last), len(chapters) - 1
    )
    head = line("", "models", "left", "after")
    return Pick("Rounds so far", "goes to its end", lines, head=head, at=start)
