"""What ctrl+p offers: every action of the screen in its own words, the themes, and the models of a run by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from textual.command import DiscoveryHit, Hit, Hits, Provider
from textual.content import Content

from ddenv.workbench.help.shortcuts import Shortcut, commands
from ddenv.workbench.terminal.themes import theme_names
from ddenv.workbench.wording import plain, shorten

# So many models are offered at most: one goes on typing.
MOST_MODELS = 12
LONGEST_NAME = 60
# What is typed must be nearly what is said there, 0 to 1.
ENOUGH = 0.1


class Commands(Provider):
    """Made anew from the screen's bindings at each question, so that it is never stale."""

    async def discover(self) -> Hits:
        for shortcut in commands(self.screen):
            yield DiscoveryHit(Content(shortcut.words), self._run(shortcut), shortcut.words, f"key: {shortcut.keys}")

    async def search(self, query: str) -> Hits:
        matcher = self.matcher(query)
        for shortcut in commands(self.screen):
            score = matcher.match(shortcut.words)
            if score > ENOUGH:
                yield Hit(score, Content(shortcut.words), self._run(shortcut), shortcut.words, f"key: {shortcut.keys}")
        for name in theme_names():
            score = matcher.match(f"theme {name}")
            if score > ENOUGH:
                yield Hit(score, Content(f"theme: {name}"), partial(self._dress, name), f"theme {name}")
        for name in self._models(query):
            words = f"go to {shorten(plain(name), LONGEST_NAME)} on the map"
            yield Hit(1.0, Content(words), partial(self._go_to, name), words)

    def _run(self, shortcut: Shortcut) -> Callable:
        return partial(self.app.run_action, shortcut.action, shortcut.node)

    def _dress(self, theme: str) -> None:
        self.app.theme = theme

    def _models(self, query: str) -> list[str]:
        """The run's models whose names hold what was typed."""
        state = getattr(getattr(self.screen, "snapshot", None), "state", None)
        wanted = query.strip().casefold()
        found = (name for name in getattr(state, "elements", ()) if wanted and wanted in name.casefold())
        return list(_first(found, MOST_MODELS))

    def _go_to(self, name: str) -> None:
        from ddenv.workbench.map.world_map import WorldMap

        for world in self.screen.query(WorldMap):
            world.go_to(name)


def _first(names: Iterator[str], most: int) -> Iterator[str]:
    return (name for _, name in zip(range(most), names, strict=False))
