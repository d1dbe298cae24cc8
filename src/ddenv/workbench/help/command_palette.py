"""The list of ctrl+p: every action of the screen, the themes, and the models on its map by name."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from itertools import islice

from textual.command import DiscoveryHit, Hit, Hits, Provider
from textual.content import Content

from ddenv.text import plain, shortened
from ddenv.workbench.help.shortcuts import Shortcut, commands
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.terminal.themes import theme_names

# The maximum number of models that are offered: typing more letters finds others.
MOST_MODELS = 12
LONGEST_NAME = 60
# How well a command has to match the typed text, 0 to 1.
ENOUGH = 0.1


class Commands(Provider):
    """Reads the screen's bindings again for each search, so that it is never out of date."""

    async def discover(self) -> Hits:
        for shortcut in commands(self.screen):
            yield DiscoveryHit(
                Content(shortcut.words),
                self._run(shortcut),
                shortcut.words,
                f"key: {shortcut.keys}",
            )

    async def search(self, query: str) -> Hits:
        matcher = self.matcher(query)
        for shortcut in commands(self.screen):
            score = matcher.match(shortcut.words)
            if score > ENOUGH:
                yield Hit(
                    score,
                    Content(shortcut.words),
                    self._run(shortcut),
                    shortcut.words,
                    f"key: {shortcut.keys}",
                )
        for name in theme_names():
            score = matcher.match(f"theme {name}")
            if score > ENOUGH:
                yield Hit(
                    score,
                    Content(f"theme: {name}"),
                    partial(setattr, self.app, "theme", name),
                    f"theme {name}",
                )
        names = dict.fromkeys(
            each.name for world in self.screen.query(WorldMap) for each in world.place.prints
        )
        wanted = query.strip().casefold()
        for name in islice(
            (name for name in names if wanted and wanted in name.casefold()), MOST_MODELS
        ):
            words = f"go to {shortened(plain(name), LONGEST_NAME)} on the map"
            yield Hit(1.0, Content(words), partial(self._go_to, name), words)

    def _run(self, shortcut: Shortcut) -> Callable[[], Awaitable[bool]]:
        return partial(self.app.run_action, shortcut.action, shortcut.node)

    def _go_to(self, name: str) -> None:
        # Where the screen shows one pane at a time, the map may be hidden.
        show_pane = getattr(self.screen, "action_pane", None)
        if show_pane is not None:
            show_pane("map")
        for world in self.screen.query(WorldMap):
            world.call_after_refresh(world.go_to, name)
