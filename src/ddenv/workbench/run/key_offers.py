"""What the keys that guide the run do now, what the footer says of them, and why one does nothing."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import Any

from textual.screen import Screen

from ddenv.guiding.offers import Offer, Pointed, offer
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.asking import Asking
from ddenv.workbench.run.browsing import NOT_NOW, Browsing
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.opening import Opening
from ddenv.workbench.run.run_keys import GUIDES, GUIDING
from ddenv.workbench.shared.poll import Poll

# These ask for models if none are selected. A pin always asks: it ends the search.
TITLES = {
    "pin": "Pin or unpin models (+): pinned ones stay; a new search begins",
    "without": "Try without these models",
    "only": "Try only these models",
}


class KeyOffers:
    """The keys by the names in `ddenv.guiding.offers.ACTIONS`, for what the user points at in `table` and `world`."""

    def __init__(
        self, browsing: Browsing, poll: Poll, table: Candidates, world: WorldMap, asking: Asking, opening: Opening
    ) -> None:
        self._browsing = browsing
        self._poll, self._table, self._world, self._asking, self._opening = poll, table, world, asking, opening

    def offer(self, name: str) -> Offer:
        """What a key does now."""
        return Offer(why_not=NOT_NOW) if self._browsing.is_past else offer(name, self._asking.situation, self.pointed)

    @property
    def pointed(self) -> Pointed:
        """The row under the cursor, if it is in sight, and the selected models in the order of the world."""
        names, elements = self._selection(), self._poll.snapshot.state.elements
        known = tuple(name for name in elements if name in names) if names else ()
        models = (*known, *sorted(names.difference(known)))
        row = self._table.under_cursor if self._table.is_attached and self._table.is_on_screen else None
        return Pointed(row, self._table.following, models)

    def _selection(self) -> frozenset[str]:
        """The models that were selected by hand, or the one that the crosshair is on."""
        if self._world.selection:
            return frozenset(self._world.selection)
        name = self._world.model_at_cursor if self._world.has_focus else None
        return frozenset() if name is None else frozenset((name,))

    def show(self, footer: KeyFooter) -> None:
        """Shows in the footer what is possible."""
        now, pointed = self._asking.situation, self.pointed
        for name, binding in GUIDING.items():
            offered = offer(name, now, pointed)
            footer.say(binding.id or "", "" if offered.why_not else offered.words or binding.description)

    def pressed(self, screen: Screen[Any], key: str) -> None:
        """Shows why a key does nothing, if it guides the run on `screen` and is not possible now."""
        # To list what all keys do now takes longer than most keys take.
        if any(each.action in GUIDES for each in screen._bindings.key_to_bindings.get(key, ())):
            active = screen.active_bindings.get(key)
            if active is not None and not active.enabled and active.node is screen:
                self._asking.refuse(self.offer(GUIDES[active.binding.action]).why_not)

    def use(self, name: str) -> None:
        """Does what a key means now; it asks for models if none are selected but some are needed, and always for pins."""
        if self._browsing.is_past:
            self._asking.refuse(NOT_NOW)
            return
        command = self.offer(name).command
        if command is not None and name != "pin":
            self._asking.ask(command)
        elif name == "change":
            self._opening.change()
        elif name in TITLES:
            environment = self._poll.snapshot.state.environment
            self._opening.choose(TITLES[name], environment, True, partial(self._chosen, name), self.pointed.models)

    def _chosen(self, name: str, models: Collection[str]) -> None:
        now = offer(name, self._asking.situation, Pointed(models=tuple(models)))
        if now.command is None:
            self._asking.refuse(now.why_not)
        else:
            self._asking.ask(now.command)
