"""What the user decides of a run by keys: candidates, models, tries by hand, and the way back."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from ddenv.errors import UserError
from ddenv.runfile.state import Candidate, Trial
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run import guiding
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.controls import Controls
from ddenv.workbench.run.guiding import Ask
from ddenv.workbench.run.poll import Snapshot
from ddenv.workbench.wording import count


class Steering(Controls):
    """The part of the run screen that knows what is selected, and asks for something to be done with it."""

    def row(self) -> Candidate | Trial | None:
        """What is under the table's cursor, None where the table is not shown."""
        table = self.query_one(Candidates)
        return table.under_cursor if table.is_on_screen else None

    def selection(self) -> frozenset[str]:
        """The models that were selected by hand, or the one that the crosshair is on."""
        world = self.query_one(WorldMap)
        if world.selection:
            return frozenset(world.selection)
        name = world.model_at_cursor if world.has_focus else None
        return frozenset() if name is None else frozenset((name,))

    # What waits, and what is under the cursor.

    def action_accept(self) -> None:
        row = self.row()
        self.ask(lambda: guiding.accept(self.snapshot.state, row))

    def action_reject(self) -> None:
        self.ask(lambda: guiding.decide(self.snapshot.state, "reject"))

    def action_veto(self) -> None:
        if not self.query_one(Candidates).is_on_screen:
            self.refuse("the table of candidates is not in sight: 2 shows it")
            return
        row = self.row()
        self.ask(lambda: guiding.veto(self.snapshot.state, row))

    # Models.

    def action_pin(self) -> None:
        names = self.query_one(WorldMap).selection or self.selection()
        self._with_models(names, "Pin (or unpin) models: they always stay", guiding.pin)

    def action_without(self) -> None:
        self._with_models(self.selection(), "Try without these models", guiding.try_without)

    def action_only(self) -> None:
        self._with_models(self.selection(), "Try only these models", guiding.try_only)

    def _with_models(self, names: Collection[str], title: str, make: Callable[..., Ask]) -> None:
        """Does it with the selected models, or asks for some."""
        if names:
            self.ask(lambda: make(self.snapshot.state, self._in_order(names)))
        elif self.can_send():
            self._choose(
                title,
                self.snapshot.state.environment,
                True,
                lambda chosen: self.ask(lambda: make(self.snapshot.state, chosen)),
            )

    def _in_order(self, names: Collection[str]) -> tuple[str, ...]:
        elements = self.snapshot.state.elements
        known = tuple(name for name in elements if name in names)
        return (*known, *sorted(set(names).difference(known)))

    def _choose(self, title: str, names: Sequence[str], several: bool, then: Callable[[tuple[str, ...]], None]) -> None:
        from ddenv.workbench.run.choose import ChooseModels

        if not names:
            self.refuse("there are no models to choose from")
            return
        dialog = ChooseModels(title, names, several=several, pinned=self.snapshot.state.pinned)
        self.app.push_screen(dialog, lambda chosen: then(chosen) if chosen else None)

    def action_find(self) -> None:
        names = [each.name for each in self.query_one(WorldMap).place.prints]
        self._choose("Find a model on the map", names, False, lambda chosen: self.find(chosen[0]))

    def find(self, name: str) -> None:
        """Brings a model into sight, with the crosshair on it."""
        self.show_pane("map")
        world = self.query_one(WorldMap)
        world.go_to(name)
        world.focus()

    def show_pane(self, pane: str) -> None:
        """Brings a pane into sight."""
        raise NotImplementedError

    # The way back, and other settings.

    def action_undo(self) -> None:
        if self.waiting_for().startswith("undo"):
            self.refuse("the last undo is still on its way")
        else:
            self.ask(lambda: guiding.undo(self.snapshot.state))

    def action_history(self) -> None:
        from ddenv.workbench.history.history_screen import History

        place = self.query_one(WorldMap).place
        history = History(lambda: self.snapshot, place, may_go=not self.watch)
        self.app.push_screen(history, lambda node: None if node is None else self.go_back(node))

    def go_back(self, node: int) -> None:
        """Goes on from a place in the history: it was asked there whether that is meant."""
        if not self.can_send():
            return
        try:
            self._send_asked(guiding.go_back(self.snapshot.state, node))
        except UserError as error:
            self.refuse(str(error))

    def action_change(self) -> None:
        if not self.can_send():
            return
        from ddenv.workbench.run.change import Change

        dialog = Change(self.snapshot.state)
        self.app.push_screen(
            dialog,
            lambda asked: self.ask(lambda: guiding.change(self.snapshot.state, asked)) if asked is not None else None,
        )

    # What became of it.

    def tell_trials(self, before: Snapshot) -> None:
        """Says how the user's own selections were judged since `before`."""
        if before.state.trials == self.snapshot.state.trials:
            return
        judged = {trial.number for trial in before.state.trials if trial.verdict}
        for trial in self.snapshot.state.trials:
            if trial.verdict and trial.number not in judged:
                self.say(_judged(trial, self.watch))


def _judged(trial: Trial, watch: bool) -> str:
    if trial.verdict == "similar":
        return f"{trial.label} shows f with {count(trial.size, 'model')}" + (
            "" if watch else ": a on its row adopts it"
        )
    known = ", known from before" if trial.known and trial.known == len(trial.tests) else ""
    return f"{trial.label} does not show f in {count(len(trial.tests), 'test')}{known}"
