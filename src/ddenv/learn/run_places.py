"""Places in a run by words: `start`, `baseline`, `round 2`, `test 5`, `result 5`, `reduction 1`, `certificate 1` ..."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from ddenv.errors import UserError
from ddenv.runfile.events import (
    BaselineFinished,
    CandidateJudged,
    CertificateFinished,
    EngineStarted,
    Implied,
    RateLost,
    TestFinished,
    TestStarted,
)
from ddenv.runfile.position import Position
from ddenv.runfile.store import Recorded

ALONE = ("start", "baseline", "end")
COUNTED = ("round", "test", "result", "verdict", "reduction", "certificate", "claims", "back")
EXPECTED = f"expected {', '.join((*ALONE[:-1], *(f'{word} N' for word in COUNTED)))} or {ALONE[-1]}"
_WORDS = re.compile(rf"({'|'.join(ALONE)})|({'|'.join(COUNTED)}) (\d{{1,6}})")


class Places:
    """Finds the events of a run by the words of a lesson."""

    def __init__(self, position: Position, events: Sequence[Recorded]) -> None:
        """`events` are all of those that the position was made of."""
        found = _of_events(events)
        for chapter in position.chapters:
            if chapter.kind != "baseline":
                found[chapter.kind, chapter.number] = chapter.first
        for number, id in enumerate(position.stops("reduction"), 1):
            found["reduction", number] = id
        found["end", 0] = position.end.revision
        self._found = found

    def event(self, words: str) -> int:
        """The event that `words` name. Raises UserError."""
        found = _WORDS.fullmatch(words.strip())
        if found is None:
            raise UserError(f"'{words[:40]}' is no place in a run; {EXPECTED}")
        key = (found[1], 0) if found[1] else (found[2], int(found[3]))
        if key not in self._found:
            most = max((number for kind, number in self._found if kind == key[0]), default=0)
            raise UserError(f"the run has no {words.strip()}{f'; the last one is {key[0]} {most}' if most else ''}")
        return self._found[key]


def _of_events(events: Sequence[Recorded]) -> dict[tuple[str, int], int]:
    """The places that an event makes by itself."""
    found: dict[tuple[str, int], int] = {}
    numbers: Counter[str] = Counter()
    ended = 0
    for recorded in events:
        id = recorded.id
        match recorded.event:
            case EngineStarted():
                found.setdefault(("start", 0), id)
            case BaselineFinished():
                found["baseline", 0] = id
            case TestStarted(test):
                found["test", test] = id
            case TestFinished(test):
                ended = test
                found["result", test] = id
            case Implied(test):
                ended = test
                found["test", test] = found["result", test] = id
            case CandidateJudged():
                # A later candidate may be judged at once, by what is known.
                found.setdefault(("verdict", ended), id)
            case CertificateFinished() | RateLost() as event:
                word = "back" if isinstance(event, RateLost) else "claims"
                numbers[word] += 1
                found[word, numbers[word]] = id
    return found
