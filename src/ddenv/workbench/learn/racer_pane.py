"""One search of a race: its map where there is room, what it tested last, the models as a bar, and how its tests ended."""

from __future__ import annotations

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Static

from ddenv.learn.plays import Play, Turn
from ddenv.learn.race import Race
from ddenv.learn.variables import SIGNS
from ddenv.text import plain, shortened, truncated
from ddenv.workbench.learn.world_maps import snapshot_of
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.poll import Snapshot
from ddenv.workbench.shared.wording import count

IN, OUT, GONE = "■", "□", "·"


class RacerPane(Vertical):
    """The search `play`, drawn over the run of `base`."""

    def __init__(self, play: Play, base: Snapshot) -> None:
        super().__init__(classes="panel")
        self.play, self._base = play, base
        self.map = WorldMap()
        self.map.can_focus = False
        self._said = Static("", markup=False)

    def compose(self) -> ComposeResult:
        yield self.map
        yield self._said

    def show(self, race: Race) -> None:
        """The search as far as the race is."""
        play, turn, tests = self.play, race.now(self.play), min(race.at, self.play.tests)
        left, room = play.after(tests), max(8, self.size.width - 2)
        # The map says itself what a panel's lower border has, so the figures stand above.
        done = race.is_done(play)
        stopped, ended = done and not play.ended, done and play.ended
        figures = f" · {count(tests, 'test')}{', stopped' if stopped else ''} · {len(left)} left{' ✓' if ended else ''}"
        # As text: a name may look like markup.
        self.border_title = Text(shortened(plain(play.name), max(6, room - 4 - len(figures))) + figures)
        self.map.show(snapshot_of(self._base, left, turn), None if turn is None else turn.candidate)
        self._said.update(Text("\n").join(_lines(play, turn, tests, room)))


def _lines(play: Play, turn: Turn | None, tests: int, room: int) -> list[Text]:
    left = play.after(tests)
    there = frozenset(left if turn is None else turn.candidate.models)
    return [
        Text(truncated(_what(play, turn), room)),
        _bar(play.begins, frozenset(left), there, room),
        _signs(play.turns[:tests], room),
    ]


def _what(play: Play, turn: Turn | None) -> str:
    if turn is None:
        return plain(play.method) or f"{count(len(play.begins), 'model')}, no test yet"
    again = ", again" if turn.again else ""
    return f"{turn.candidate.label}{again}: {count(turn.candidate.size, 'model')} {SIGNS.get(turn.outcome, '?')}"


def _bar(models: tuple[str, ...], left: frozenset[str], there: frozenset[str], room: int) -> Text:
    """A cell for each model in the world's order; of more models than there is room, by their shares."""
    if len(models) <= room:
        return Text("".join(GONE if name not in left else IN if name in there else OUT for name in models))
    kept = max(bool(left), round(room * len(left) / len(models)))
    tested = min(kept, max(bool(there & left), round(room * len(there & left) / len(models))))
    return Text(IN * tested + OUT * (kept - tested) + GONE * (room - kept))


def _signs(turns: tuple[Turn, ...], room: int) -> Text:
    """How the tests ended, the last ones if there are many."""
    cut = len(turns) > room
    shown = turns[-(room - 1) :] if cut else turns
    return Text(("…" if cut else "") + "".join(SIGNS.get(turn.outcome, "?") for turn in shown), no_wrap=True)
