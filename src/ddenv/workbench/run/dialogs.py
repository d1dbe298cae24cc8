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
from textual.binding import Binding
from textual.containers import Horizontal, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Button, OptionList, Static
from textual.widgets.option_list import Option

from ddenv.runfile.position import Chapter
from ddenv.schemas import Kind
from ddenv.text import count, plain
from ddenv.words.methods import chosen, note, paragraph
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.processes import Scene

NAME, MODELS, LEFT, TESTS = 16, 8, 10, 14


class Method(ModalScreen[None]):
    """Algorithm, partitioning and prioritization of a run, each with its explanation."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("escape,e,q,enter", "dismiss", "close", id="method.close", tooltip="close this dialog"),
    ]

    def __init__(self, algorithm: str, pair: str) -> None:
        super().__init__()
        self._algorithm, self._pair = algorithm, pair

    def compose(self) -> ComposeResult:
        with Framed("How this run is reduced", "escape closes", classes="dialog reading"), VerticalScroll():
            yield Static(self._words(), markup=False)

    def _words(self) -> Text:
        return Text("\n\n").join(self._paragraph(*each) for each in chosen(self._algorithm, self._pair).items())

    def _paragraph(self, kind: Kind, name: str) -> Text:
        text = Text(f"{kind} ").append(plain(name), "bold").append("\n")
        if unused := note(kind, self._algorithm):
            text.append(unused, "bold").append(" ")
        return text.append(paragraph(kind, name))


class Choice(ModalScreen[str]):
    """Returns the answer that was chosen, by its id."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("left", "app.focus_previous", show=False, id="choice.previous", tooltip="previous button"),
        Binding("right", "app.focus_next", show=False, id="choice.next", tooltip="next button"),
    ]

    def __init__(self, title: str, keys: str, text: str, buttons: Sequence[Button]) -> None:
        """`text` may contain names from files, so it is never markup. The first button has the focus."""
        super().__init__()
        self._title, self._keys, self._text, self._buttons = title, keys, text, buttons

    def compose(self) -> ComposeResult:
        with Framed(self._title, self._keys):
            yield Static(Text(self._text), markup=False)
            with Horizontal(classes="buttons"):
                yield from self._buttons

    def on_button_pressed(self, event: Button.Pressed) -> None:
        self.dismiss(event.button.id or "cancel")

    def action_answer(self, answer: str) -> None:
        self.dismiss(answer)


class Quit(Choice):
    """Asks whether to stop the engine: returns "stop", "leave" or "cancel"."""

    BINDINGS: ClassVar = [
        Binding("s", "answer('stop')", "stop the engine", id="quit.stop", tooltip="stop the engine and leave"),
        Binding("l", "answer('leave')", "let it run on", id="quit.leave", tooltip="leave; the engine goes on"),
        Binding("escape,c", "answer('cancel')", "cancel", id="quit.cancel", tooltip="stay here"),
    ]

    def __init__(self) -> None:
        leave = Button("Let it run on", id="leave", variant="primary")
        buttons = (leave, Button("Stop the engine", id="stop", variant="warning"), Button("Cancel", id="cancel"))
        words = "The engine is a separate process; it can go on without this screen."
        super().__init__("Quit", "l let it run on   s stop   c cancel", words, buttons)


class ReductionWaits(Choice):
    """Asks what becomes of a reduction that waits: returns "accept", "reject", "drop" or "cancel"."""

    BINDINGS: ClassVar = [
        Binding("a", "answer('accept')", "accept", id="waits.accept", tooltip="make the reduction, then go on"),
        Binding("x", "answer('reject')", "reject", id="waits.reject", tooltip="reject the reduction, then go on"),
        Binding("d", "answer('drop')", "drop", id="waits.drop", tooltip="go on without deciding: it may come again"),
        Binding("escape,c", "answer('cancel')", "cancel", id="waits.cancel", tooltip="change nothing"),
    ]

    def __init__(self, text: str) -> None:
        accept = Button("Accept it", id="accept", variant="primary")
        others = (
            Button(words, id=id) for words, id in (("Reject it", "reject"), ("Drop it", "drop"), ("Cancel", "cancel"))
        )
        super().__init__("A reduction waits", "a accept   x reject   d drop   c cancel", text, (accept, *others))


class SceneDialog(ModalScreen[None]):
    """The scene's address, and how to reach it over SSH."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("c", "copy", "copy the address", id="scene.copy", tooltip="copy the address to the clipboard (OSC 52)"),
        Binding("s", "copy_ssh", "copy the ssh line", id="scene.ssh", tooltip="copy the ssh line to the clipboard"),
        Binding("x", "stop", "stop the scene", id="scene.stop", tooltip="end the scene's process"),
        Binding("escape,m,enter", "dismiss", "close", id="scene.close", tooltip="close; the scene stays on"),
    ]

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self._scene = scene

    def compose(self) -> ComposeResult:
        with Framed("Scene in 3-D", "c copy address   s copy ssh line   x stop   escape close"):
            yield Static("", id="address", markup=False)

    def on_mount(self) -> None:
        self.refresh_address()

    def refresh_address(self) -> None:
        """Shows what is known of the scene now."""
        self.query_one("#address", Static).update(self._words())

    def _words(self) -> Text:
        if self._scene.trouble:
            return Text(self._scene.trouble, Style.parse(self.app.theme_variables["text-error"]))
        url = self._scene.url
        if not url:
            return Text("The scene starts ...", "dim")
        text = Text("Open in a browser on this machine:\n\n  ")
        text.append(url, Style(bold=True, underline=True, link=url))
        text.append("\n\nFrom another machine, first type there:\n\n  ")
        return text.append(ssh_line(url), "bold").append("\n\nand open the same address.")

    def action_copy(self) -> None:
        self._copy(self._scene.url, "address")

    def action_copy_ssh(self) -> None:
        self._copy(ssh_line(self._scene.url) if self._scene.url else "", "ssh line")

    def _copy(self, text: str, what: str) -> None:
        if text:
            self.app.copy_to_clipboard(text)
            self.query_one(Framed).say(f"{what} copied, if the terminal allows it")
        else:
            self.query_one(Framed).say("the scene has no address yet")

    def action_stop(self) -> None:
        self._scene.stop()
        self.dismiss()


def ssh_line(url: str) -> str:
    """The command that makes the scene of this machine reachable from another one."""
    port = urlsplit(url).port
    return f"ssh -L {port}:127.0.0.1:{port} {getpass.getuser()}@{socket.gethostname()}"


class Rounds(ModalScreen[Chapter | None]):
    """Returns the chapter to go to, or None."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("escape,b,q", "dismiss", "close", id="rounds.close", tooltip="back to the run"),
    ]

    def __init__(self, chapters: Sequence[Chapter], at: int | None) -> None:
        """The cursor starts on the chapter with the event `at`, or on the last one."""
        super().__init__()
        self._chapters = chapters
        self._start = next((row for row, each in enumerate(chapters) if at and at <= each.last), len(chapters) - 1)

    def compose(self) -> ComposeResult:
        with Framed("Rounds so far", "enter goes to its end   escape closes"):
            yield Static(_line("", "models", "left", "after"), id="head", markup=False)
            yield OptionList(*map(_option, self._chapters), id="rounds", compact=True, markup=False)

    def on_mount(self) -> None:
        options = self.query_one(OptionList)
        options.focus()
        options.highlighted = self._start

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        self.dismiss(self._chapters[event.option_index])


def _option(chapter: Chapter) -> Option:
    less = chapter.left != chapter.models
    left = f"{'●' if less else '○'} {chapter.left}" if chapter.kind == "round" else ""
    return Option(_line(title(chapter), str(chapter.models), left, count(chapter.tests, "test")))


def title(chapter: Chapter) -> str:
    """What a chapter is."""
    return "baseline" if chapter.kind == "baseline" else f"{chapter.kind} {chapter.number}"


def _line(name: str, models: str, left: str, tests: str) -> Text:
    return Text(f"{name:<{NAME}}{models:>{MODELS}}{left:>{LEFT}}{tests:>{TESTS}}", no_wrap=True)
