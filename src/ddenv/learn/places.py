"""Places in a run by words: `start`, `baseline`, `round 2`, `test 5`, `result 5`, `reduction 1`, `end`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runfile.store import Event

EXPECTED = "expected start, baseline, round N, test N, result N, reduction N or end"


class Places:
    """Finds the events of a run by the words of a lesson."""

    def __init__(self, position: Position, events: Sequence[Event]) -> None:
        """`events` are all of those that the position was made of."""
        found: dict[tuple[str, int], int] = {}
        tests = 0
        for event in events:
            if event.kind in ("test_started", "implied"):
                tests += 1
                found["test", tests] = event.id
            if event.kind == "implied":
                found["result", tests] = event.id
            elif event.kind == "test_finished":
                found["result", int(event.data["test"])] = event.id
            elif event.kind == "baseline_finished":
                found["baseline", 0] = event.id
            elif event.kind == "engine_started":
                found.setdefault(("start", 0), event.id)
        for chapter in position.chapters:
            if chapter.kind == "round":
                found["round", chapter.number] = chapter.first
        for number, id in enumerate(position.stops("reduction"), 1):
            found["reduction", number] = id
        found["end", 0] = position.end.revision
        self._found = found

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
