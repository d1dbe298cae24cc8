"""Reads a lesson from its YAML file: plain data, checked key by key, with the line of what is
wrong. Nothing in it is ever run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

import yaml

from ddenv.errors import UserError
from ddenv.learn import lesson_figures
from ddenv.learn.lesson import MISCONCEPTIONS, Answer, Foretold, Lesson, Question, Step
from ddenv.learn.race import RACERS
from ddenv.runfile.events import (
    BaselineFinished,
    CandidateJudged,
    CertificateFinished,
    EngineStarted,
    Event,
    Implied,
    RateLost,
    TestFinished,
    TestStarted,
)
from ddenv.runfile.position import Position
from ddenv.runfile.store import Recorded
from ddenv.schemas import names, nearest, pairs
from ddenv.world.access import not_yaml, read_bytes

LONGEST = 1_000_000  # bytes of a lesson's file
ANSWERS = (2, 6)
_KEYS = ("title", "aim", "minutes", "run", "beside", "oracle", "steps")
_STEP = ("text", "at", "ask", "hint", "answers", "foretell", "try", "race")
# A step has at most one of these.
_DOES = ("ask", "foretell", "try", "race")
_ANSWER = ("say", "why", "right", "misconception")
# The places in a run, alone or with a number.
ALONE = ("start", "baseline", "end")
COUNTED = ("round", "test", "result", "verdict", "reduction", "certificate", "claims", "back")
EXPECTED = f"expected {', '.join((*ALONE[:-1], *(f'{word} N' for word in COUNTED)))} or {ALONE[-1]}"
_WORDS = re.compile(rf"({'|'.join(ALONE)})|({'|'.join(COUNTED)}) (\d{{1,6}})")


# Says which event of a run the words of a lesson name, such as `Places.event`. Raises UserError for
# other words.
Find = Callable[[str], int]


def read_lesson(file: Path, places: Callable[[Path], Find]) -> Lesson:
    """The lesson in `file`; `places` opens its run. Raises UserError: file, line, key, what is
    wrong.
    """
    content = read_bytes(file)
    if len(content) > LONGEST:
        raise UserError(f"{file}: is larger than {LONGEST // 1000} kB")
    try:
        root = yaml.compose(content, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise not_yaml(file, error) from None
    top = _Node(file, root, "").keys(_KEYS, "title", "aim", "run", "steps")
    run = _beside(top["run"])
    oracle = _beside(top["oracle"]) if "oracle" in top else None
    found = top["run"].tried(lambda: places(run))
    return Lesson(
        file=file,
        title=top["title"].words(),
        aim=top["aim"].words(),
        minutes=top["minutes"].whole() if "minutes" in top else 10,
        run=run,
        oracle=oracle,
        steps=tuple(_step(each, found, oracle is not None) for each in top["steps"].entries()),
        beside=_others(top["beside"]) if "beside" in top else {},
    )


@dataclass(frozen=True, slots=True)
class _Node:
    """A value of the file, with the key that leads to it."""

    file: Path
    node: Any
    key: str

    @property
    def line(self) -> int:
        if self.node is None:
            return 1
        return int(self.node.start_mark.line) + 1

    def wrong(self, why: str) -> UserError:
        key = f" {self.key}:" if self.key else ""
        return UserError(f"{self.file}:{self.line}:{key} {why}")

    def tried(self, call: Callable[[], Any]) -> Any:
        """What `call` returns; an error gets the file, the line and the key."""
        try:
            return call()
        except UserError as error:
            raise self.wrong(str(error)) from None

    def keys(self, known: tuple[str, ...], *needed: str) -> dict[str, _Node]:
        """The values of a mapping, which has the keys `needed` and maybe others of those that are
        `known`.
        """
        if not isinstance(self.node, yaml.MappingNode):
            raise self.wrong(f"expected keys such as {', '.join(known[:3])}")
        found: dict[str, _Node] = {}
        for key, value in self.node.value:
            name = str(key.value)
            path = f"{self.key}.{name}" if self.key else name
            one = _Node(self.file, value, path)
            if name not in known:
                mine = _Node(self.file, key, path[:80])
                raise mine.wrong(
                    f"unknown key{nearest(name, known)}; allowed are {', '.join(known)}"
                )
            if name in found:
                raise _Node(self.file, key, path).wrong("appears twice")
            found[name] = one
        for key in needed:
            if key not in found:
                raise self.wrong(f"the key '{key}' is missing")
        return found

    def entries(self) -> list[_Node]:
        if not isinstance(self.node, yaml.SequenceNode) or not self.node.value:
            raise self.wrong("expected a list with at least one entry")
        return [
            _Node(self.file, each, f"{self.key}[{place}]")
            for place, each in enumerate(self.node.value, 1)
        ]

    def raw(self) -> str:
        if not isinstance(self.node, yaml.ScalarNode) or not self.node.value.strip():
            raise self.wrong("expected a text")
        return str(self.node.value)

    def words(self) -> str:
        text = self.raw()
        self.tried(lambda: lesson_figures.check(text))
        return text

    def whole(self) -> int:
        text = self.raw()
        if not text.isascii() or not text.isdigit() or not 0 < int(text[:9]) <= 600:
            raise self.wrong(f"expected a number from 1 to 600, found {text[:20]!r}")
        return int(text)

    def one_of(self, known: tuple[str, ...]) -> str:
        text = self.raw()
        if text not in known:
            raise self.wrong(
                f"{text[:40]!r} is not allowed{nearest(text, known)}; use one of {', '.join(known)}"
            )
        return text


def _beside(node: _Node) -> Path:
    """A file in the lesson's own folder."""
    name = node.raw()
    if Path(name).name != name or name in (".", ".."):
        raise node.wrong(
            f"{name[:60]!r} is not in the lesson's folder; give the name of a file beside the "
            "lesson"
        )
    path = node.file.parent / name
    if not path.is_file():
        raise node.wrong(f"there is no file {name[:60]!r} beside the lesson")
    return path


def _others(node: _Node) -> dict[str, Path]:
    if not isinstance(node.node, yaml.MappingNode):
        raise node.wrong("expected names, each with a file")
    return {
        str(key.value): _beside(_Node(node.file, value, f"beside.{key.value}"))
        for key, value in node.node.value
    }


def _step(node: _Node, find: Find, has_oracle: bool) -> Step:
    keys = node.keys(_STEP, "text")
    at = keys.get("at")
    if len(does := [key for key in _DOES if key in keys]) > 1:
        raise keys[does[1]].wrong(
            f"a step has one of {', '.join(_DOES)}, found {' and '.join(does)}"
        )
    for key in ("try", "race"):
        if key in keys and not has_oracle:
            raise keys[key].wrong(
                "needs the outcome of every part of the world; give the lesson the key 'oracle'"
            )
    for key in ("answers", "hint"):
        if key in keys and "ask" not in keys:
            raise keys[key].wrong("belongs to a question; the key 'ask' is missing")
    foretell: Foretold | None = None
    if "foretell" in keys:
        foretell = cast(Foretold, keys["foretell"].one_of(get_args(Foretold)))
        if at is None:
            raise keys["foretell"].wrong("needs the key 'at': the place before it happens")
        wanted = "test" if foretell == "outcome" else "round"
        if not at.raw().startswith(wanted):
            raise at.wrong(f"to foretell the {foretell} it must be a {wanted}")
    return Step(
        text=keys["text"].words(),
        at=None if at is None else int(at.tried(lambda: find(at.raw()))),
        question=_question(node, keys) if "ask" in keys else None,
        foretell=foretell,
        budget=keys["try"].keys(("budget",), "budget")["budget"].whole() if "try" in keys else None,
        race=_racers(keys["race"]) if "race" in keys else (),
        line=node.line,
    )


def _racers(node: _Node) -> tuple[str, ...]:
    entries = node.entries()
    if not RACERS[0] <= len(entries) <= RACERS[1]:
        raise node.wrong(
            f"expected {RACERS[0]} to {RACERS[1]} algorithms or pairs, found {len(entries)}"
        )
    found: list[str] = []
    for each in entries:
        found.append(each.one_of((*names("algorithm"), *pairs())))
        if found[-1] in found[:-1]:
            raise each.wrong(f"{found[-1]!r} appears twice")
    return tuple(found)


def _question(node: _Node, keys: dict[str, _Node]) -> Question:
    if "answers" not in keys:
        raise node.wrong("the key 'answers' is missing")
    answers = tuple(map(_answer, keys["answers"].entries()))
    if not ANSWERS[0] <= len(answers) <= ANSWERS[1]:
        raise keys["answers"].wrong(
            f"expected {ANSWERS[0]} to {ANSWERS[1]} answers, found {len(answers)}"
        )
    if (right := sum(answer.right for answer in answers)) != 1:
        raise keys["answers"].wrong(f"expected exactly one answer that is right, found {right}")
    return Question(keys["ask"].words(), answers, keys["hint"].words() if "hint" in keys else "")


def _answer(node: _Node) -> Answer:
    keys = node.keys(_ANSWER, "say", "why")
    right = "right" in keys and keys["right"].raw().lower() == "true"
    if "right" in keys and keys["right"].raw().lower() not in ("true", "false"):
        raise keys["right"].wrong(f"expected true or false, found {keys['right'].raw()[:20]!r}")
    belief = keys["misconception"].one_of(tuple(MISCONCEPTIONS)) if "misconception" in keys else ""
    if right and belief:
        raise keys["misconception"].wrong("the right answer has none")
    return Answer(keys["say"].words(), right, keys["why"].words(), belief)


class Places:
    """Finds the events of a run by words: `start`, `baseline`, `round 2`, `result 5`, `reduction
    1`, `certificate 1` ...
    """

    def __init__(self, position: Position, events: Sequence[Recorded]) -> None:
        """`events` are all of those that the position was made of."""
        self._found: dict[tuple[str, int], int] = {}
        self._ended = 0
        for recorded in events:
            self._note(recorded.event, recorded.id)
        for chapter in position.chapters:
            if chapter.kind != "baseline":
                self._found[chapter.kind, chapter.number] = chapter.first
        for number, id in enumerate(position.stops("reduction"), 1):
            self._found["reduction", number] = id
        self._found["end", 0] = position.end.revision

    def _note(self, event: Event, id: int) -> None:
        """The places that an event makes by itself."""
        found = self._found
        match event:
            case EngineStarted():
                found.setdefault(("start", 0), id)
            case BaselineFinished():
                found["baseline", 0] = id
            case TestStarted(test=test):
                found["test", test] = id
            case TestFinished(test=test) | Implied(test=test):
                self._ended = test
                found["result", test] = id
                # One that follows from another test never started.
                found.setdefault(("test", test), id)
            case CandidateJudged():
                # A later candidate may be judged at once, by what is known.
                found.setdefault(("verdict", self._ended), id)
            case CertificateFinished():
                found["claims", self._most("claims") + 1] = id
            case RateLost():
                found["back", self._most("back") + 1] = id

    def _most(self, word: str) -> int:
        return max((number for kind, number in self._found if kind == word), default=0)

    def event(self, words: str) -> int:
        """The event that `words` name. Raises UserError."""
        found = _WORDS.fullmatch(words.strip())
        if found is None:
            raise UserError(f"'{words[:40]}' is not a place in a run; {EXPECTED}")
        key = (found[1], 0) if found[1] else (found[2], int(found[3]))
        if key not in self._found:
            most = self._most(key[0])
            raise UserError(
                "the run has no "
                f"{words.strip()}{f'; the last one is {key[0]} {most}' if most else ''}"
            )
        return self._found[key]
