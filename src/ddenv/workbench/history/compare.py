"""Two environments of a run side by side: what they share, and how they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen
from textual.widgets import Static

from ddenv.guiding.course import place
from ddenv.runfile.state import Node, RunState
from ddenv.text import plain, shortened
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.map.place import Place
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared import branches
from ddenv.workbench.shared.poll import Snapshot
from ddenv.workbench.shared.wording import count
from ddenv.workbench.widgets.lines import Lines


@dataclass(frozen=True, slots=True)
class Comparison:
    """Models' names in the order of the world file."""

    common: tuple[str, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]


def compare(first: Node, second: Node) -> Comparison:
    """Both environments, model by model."""
    left, right = frozenset(first.environment), frozenset(second.environment)
    return Comparison(
        common=tuple(name for name in first.environment if name in right),
        only_first=tuple(name for name in first.environment if name not in right),
        only_second=tuple(name for name in second.environment if name not in left),
    )


class Compare(ModalScreen[None]):
    """Facts, maps if there is room, and the models: those in both, and those in only one."""

    CSS_PATH = "history.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-small"), (110, "-large")]
    AUTO_FOCUS = "Lines"
    BINDINGS: ClassVar = [
        Binding("escape,c,q,enter", "dismiss", "close", id="compare.close", tooltip="back to the history"),
    ]

    def __init__(self, first: Node, second: Node, state: RunState, place: Place) -> None:
        super().__init__()
        self._sides = (first, second)
        self._state, self._place = state, place

    def compose(self) -> ComposeResult:
        found = compare(*self._sides)
        with Framed("Two environments side by side", "tab to the lists   escape closes"):
            with Horizontal(classes="sides"):
                for name, node, alone in zip("AB", self._sides, (found.only_first, found.only_second), strict=True):
                    with Vertical(classes="side"):
                        yield Static(self._facts(name, node), classes="facts", markup=False)
                        yield WorldMap(id=f"map-{name}")
                        yield Static(_heading(f"only in {name}", alone), classes="facts", markup=False)
                        yield Lines(_name, nothing="none", id=f"only-{name}")
            yield Static(_heading("in both", found.common), classes="facts", markup=False)
            yield Lines(_name, nothing="none", id="common")

    def on_mount(self) -> None:
        found = compare(*self._sides)
        for name, node, alone in zip("AB", self._sides, (found.only_first, found.only_second), strict=True):
            self.query_one(f"#only-{name}", Lines).show(alone)
            world = self.query_one(f"#map-{name}", WorldMap)
            world.set_place(self._place)
            world.show(Snapshot(self._state.changed(environment=node.environment, round=None, trials=())), None)
        self.query_one("#common", Lines).show(found.common)

    def on_resize(self) -> None:
        # Of one size, so that both maps have one scale and one frame.
        both = self.query_one(".sides").content_size.width or self.size.width
        for side in self.query(".side"):
            side.styles.width = both // 2

    def _facts(self, name: str, node: Node) -> Text:
        words = branches.words(node, self._state.node)
        text = Text(f"{name}  {place(node)}", "bold").append(f"\n{plain(node.method)}", "not bold")
        after = f"\n{count(node.own_tests, 'own test')}"
        return text.append(after + (f"; {words}" if words else ""), "not bold dim")


def _heading(what: str, names: Sequence[str]) -> Text:
    return Text(f"{what}: {count(len(names), 'model')}", "bold")


def _name(name: str, width: int) -> Text:
    return Text(f"  {shortened(name, max(4, width - 2))}", no_wrap=True)
