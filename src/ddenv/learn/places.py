"""Places in a run by words: `start`, `baseline`, `round 2`, `test 5`, `result 5`, `reduction 1`, `end`."""

from __future__ import annotations

import re

from ddenv.errors import UserError
from ddenv.runfile.position import Position

EXPECTED = "expected start, baseline, round N, test N, result N, reduction N or end"


class Places:
    """Finds the events of a run by the words of a lesson."""

    def __init__(self, position: Position) -> None:
        self._position = position
        self._found: dict[tuple[str, int], int] = {}
        self._note()

    def _note(self) -> None:
        """Goes through the run once."""
        position, reductions = self._position, 0
        for id in position.ids:
            moment = position.moment(id)
            if moment is None:
                continue
            kind, data = moment.event.kind, moment.event.data
            if kind in ("test_started", "implied"):
                self._found["test", len(moment.after.tests)] = id
            if kind == "implied":
                self._found["result", len(moment.after.tests)] = id
            if kind == "test_finished":
                self._found["result", int(data["test"])] = id
            if kind == "round_started" and moment.after.round is not None:
                self._found["round", moment.after.round.number] = id
            if kind == "baseline_finished":
                self._found["baseline", 0] = id
            if kind == "engine_started":
                self._found.setdefault(("start", 0), id)
            if len(moment.after.environment) < len(moment.before.environment):
                reductions += 1
                self._found["reduction", reductions] = id
            self._found["end", 0] = id

    def event(self, words: str) -> int:
        """The event that `words` name. Raises UserError."""
        found = re.fullmatch(r"(start|baseline|end)|(round|test|result|reduction) (\d{1,6})", words.strip())
        if found is None:
            raise UserError(f"'{words[:40]}' is no place in a run; {EXPECTED}")
        key = (found[1], 0) if found[1] else (found[2], int(found[3]))
        if key not in self._found:
            most = max((number for kind, number in self._found if kind == key[0]), default=0)
            raise UserError(f"the run has no {words.strip()}{f'; the last one is {key[0]} {most}' if most else ''}")
        return self._found[key]
