"""Run files with values that mean harm: well-formed, but with numbers, names and samples that
nobody would write.
"""

from __future__ import annotations

import copy
import json
import math
import random
import re
import shutil
import sqlite3
from array import array
from collections.abc import Iterator
from pathlib import Path

from tests.workbench import fake_moments, fake_run

SCENES = (
    fake_moments.mid_round,
    fake_moments.waiting,
    fake_moments.guided,
    fake_moments.certifying,
    fake_moments.finished,
    fake_moments.isolated,
    fake_moments.piled,
)
NUMBERS = (
    *(1e300, -1e300, 1e18, -1e18, 1e9, 1e-300, -0.0, 0, -1, 2, 2**31, 2**63, 10**30, 10**400),
    *(math.nan, math.inf, -math.inf),
)
OTHERS = (
    None,
    True,
    "",
    "0",
    "1e300",
    "\x1b]0;x\x07\u202e[red]",
    "n" * 5000,
    [],
    [1e300],
    {},
    {"a": 1},
)


def templates(folder: Path) -> list[Path]:
    """A run of each scene."""
    made = []
    for number, scene in enumerate(SCENES):
        run = scene(fake_run.FakeRun(folder / f"scene-{number}.ddenv"))
        run.live((1, 0.5))
        run.file.settle()
        run.close()
        made.append(run.path)
    return made


def hostile_run(scenes: list[Path], path: Path, seed: int) -> Path:
    """One of the runs, with a few of its values replaced. The same seed gives the same file."""
    chance = random.Random(f"hostile {seed}")
    shutil.copy(chance.choice(scenes), path)
    with sqlite3.connect(path) as database:
        for _ in range(chance.choice((1, 1, 1, 2, 5))):
            chance.choice(
                (
                    _event,
                    _event,
                    _event,
                    _order,
                    _scenario,
                    _scenario,
                    _samples,
                    _live,
                    _world,
                    _time,
                )
            )(database, chance)
    database.close()
    return path


def _value(chance: random.Random) -> object:
    return copy.deepcopy(chance.choice(NUMBERS if chance.random() < 0.8 else OTHERS))


def _leaves(value: object, way: tuple = ()) -> Iterator[tuple]:
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    empty = True
    for key, inner in items:
        empty = False
        yield from _leaves(inner, (*way, key))
    if empty:
        yield way


def _put(value: object, chance: random.Random) -> None:
    """Replaces one leaf, most often a number."""
    ways = [way for way in _leaves(value) if way]
    numbers = [way for way in ways if isinstance(_at(value, way), int | float)]
    way = chance.choice(numbers if numbers and chance.random() < 0.85 else ways)
    _at(value, way[:-1])[way[-1]] = _value(chance)


def _at(value, way: tuple):
    for key in way:
        value = value[key]
    return value


def _event(database: sqlite3.Connection, chance: random.Random) -> None:
    rows = database.execute("SELECT id, data FROM event WHERE data != '{}' AND id > 1").fetchall()
    id, text = chance.choice(rows)
    data = json.loads(text)
    _put(data, chance)
    database.execute("UPDATE event SET data = ? WHERE id = ?", (json.dumps(data), id))


def _order(database: sqlite3.Connection, chance: random.Random) -> None:
    """An event is lost, or stands where another one stood."""
    rows = database.execute("SELECT id, kind, data FROM event WHERE id > 1").fetchall()
    (at, kind, data), (other, *_) = chance.sample(rows, 2)
    if chance.random() < 0.5:
        database.execute("DELETE FROM event WHERE id = ?", (at,))
    else:
        database.execute("UPDATE event SET kind = ?, data = ? WHERE id = ?", (kind, data, other))


def _scenario(database: sqlite3.Connection, chance: random.Random) -> None:
    """In the first event and in the document, or in one of them."""
    data = json.loads(
        database.execute("SELECT data FROM event WHERE kind = 'created'").fetchone()[0]
    )
    _put(data["scenario"], chance)
    if chance.random() < 0.8:
        database.execute("UPDATE event SET data = ? WHERE kind = 'created'", (json.dumps(data),))
    if chance.random() < 0.8:
        text = json.dumps(data["scenario"]).encode()
        database.execute("UPDATE document SET content = ? WHERE name = 'scenario'", (text,))


def _samples(database: sqlite3.Connection, chance: random.Random) -> None:
    for test, model, samples in database.execute(
        "SELECT test, model, samples FROM motion"
    ).fetchall():
        values = array("d", samples)
        for _ in range(chance.choice((1, 3, 50))):
            number = chance.choice((*NUMBERS[:-4], math.nan, math.inf))
            values[chance.randrange(len(values))] = (
                float(number) if abs(number) < 1e308 else math.inf
            )
        database.execute(
            "UPDATE motion SET samples = ? WHERE test = ? AND model = ?",
            (values.tobytes(), test, model),
        )


def _live(database: sqlite3.Connection, chance: random.Random) -> None:
    pose = [1.0, 2.0, 0.2, 1.0, 0.0, 0.0, 0.0]
    pose[chance.randrange(7)] = _value(chance)
    row = (0, chance.choice((1, 2, 10**6, -1)), chance.choice((1e300, -1.0, 3.0)), json.dumps(pose))
    database.execute("INSERT OR REPLACE INTO live VALUES (?, ?, ?, ?)", row)


def _world(database: sqlite3.Connection, chance: random.Random) -> None:
    text = (
        database.execute("SELECT content FROM document WHERE name = 'world'").fetchone()[0].decode()
    )
    found = chance.choice(list(re.finditer(r"(?<=[ >])-?[0-9][0-9.e-]*(?=[ <])", text)))
    value = chance.choice(("1e300", "-1e300", "nan", "inf", "0", "-1", "1e18", "9e5", "1e-300"))
    text = text[: found.start()] + value + text[found.end() :]
    database.execute("UPDATE document SET content = ? WHERE name = 'world'", (text.encode(),))


def _time(database: sqlite3.Connection, chance: random.Random) -> None:
    at = chance.choice((0.0, -1.0, 1e300, 1e18, 9e10, 1.7e9))
    ids = [row[0] for row in database.execute("SELECT id FROM event").fetchall()]
    database.execute("UPDATE event SET time = ? WHERE id = ?", (at, chance.choice(ids)))
