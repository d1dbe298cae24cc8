"""Records what algorithms do in a lesson's world, so that lessons show it without the algorithms
themselves.

python -m docs.lessons.record_plays FILE.yaml   adds it to the oracle of the lesson
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ddenv import schemas
from ddenv.engine.judging import traits_of, trajectory_of
from ddenv.errors import UserError
from ddenv.learn.attempt import Oracle, read_oracle
from ddenv.learn.lesson import Lesson
from ddenv.learn.reading import Places, read_lesson
from ddenv.reduction.reduce import NamedRound, reduce
from ddenv.runfile.fold import fold
from ddenv.runfile.position import position_in
from ddenv.runfile.state import partition_letter
from ddenv.runfile.store import COLUMNS, RunFile
from ddenv.runs.experiment import read_parts
from ddenv.world.access import write_file
from ddenv.world.extent import center


def record_plays(file: Path) -> tuple[Path, tuple[str, ...]]:
    """Writes into the oracle of a lesson what the algorithms did that it compares; returns its path
    and their names.

    All algorithms, if students search on their own. Raises UserError.
    """
    lesson = read_lesson(file, _places)
    if lesson.oracle is None:
        raise UserError(f"{file}: has no oracle, so there is nothing to record")
    oracle = read_oracle(lesson.oracle)
    alone = any(step.budget for step in lesson.steps)
    wanted = dict.fromkeys(schemas.names("algorithm") if alone else ())
    wanted |= dict.fromkeys(name for step in lesson.steps for name in step.race)
    if not wanted:
        raise UserError(f"{file}: no step has 'try' or 'race', so there is nothing to record")
    known = _evidence(lesson)
    # Lessons may share an oracle.
    names = tuple(dict.fromkeys((*oracle.rounds, *wanted)))
    plays = {name: _play(name, oracle, known) for name in names}
    content = json.loads(lesson.oracle.read_bytes()) | {"plays": plays}
    write_file(lesson.oracle, (json.dumps(content, indent=0) + "\n").encode())
    return lesson.oracle, names


def _places(run: Path) -> Callable[[str], int]:
    with RunFile(run) as content:
        events = content.events()
    return Places(position_in(events), events).event


def _evidence(lesson: Lesson) -> dict[str, Any]:
    """What the schemas look at, from the lesson's run: the oracle knows no trajectories, so that of
    f has to do.
    """
    with RunFile(lesson.run) as content:
        _, world, _ = read_parts(content)
        state = fold(content.events())
        f = state.f_test
        if f is None or state.f_position is None:
            raise UserError(f"{lesson.run}: has no finished baseline")
        path = trajectory_of(np.array(content.motion(f.id)).reshape(-1, COLUMNS))
    models = [model for model in world.models if model.name in state.elements]
    return {
        "positions": {model.name: center(model) for model in models},
        "traits": {model.name: traits_of(model) for model in models},
        "trajectory": path,
        "failure_pose": state.f_position,
        "first_sensed": dict(f.first_sensed),
        "touched": [name for name, _ in f.first_touched],
    }


def _play(name: str, oracle: Oracle, known: dict[str, Any]) -> list[dict[str, Any]]:
    rounds: list[tuple[NamedRound, list[frozenset[str]]]] = []

    def test(models: frozenset[str]) -> bool:
        rounds[-1][1].append(models)
        return oracle.outcome(models) == "similar"

    chosen: dict[str, Any] = {"algorithm": name}
    if "/" in name:
        partitioning, prioritization = schemas.split_pair(name)
        chosen = {
            "algorithm": "ddenv",
            "partitioning": partitioning,
            "prioritization": prioritization,
        }
    # The oracle is steady: no call is repeated.
    steady: dict[str, Any] = {"iterations": 0, "check": False}
    reduce(
        oracle.models,
        test,
        **chosen,
        **known,
        **steady,
        on_round=lambda round: rounds.append((round, [])),
    )
    return [_recorded(round, tested) for round, tested in rounds if tested]


def _recorded(round: NamedRound, tested: list[frozenset[str]]) -> dict[str, Any]:
    whole, labels = frozenset(round.environment), dict[frozenset[str], str]()
    for kind, number in round.candidates:
        part, letter = frozenset(round.partitions[number]), partition_letter(number)
        models, label = (
            (part, f"part {letter}") if kind == "partition" else (whole - part, f"without {letter}")
        )
        labels[models] = label
    return {
        "parts": [" ".join(part) for part in round.partitions],
        "tested": [labels[models] for models in tested],
    }


if __name__ == "__main__":
    for file in sys.argv[1:]:
        oracle, names = record_plays(Path(file))
        print(f"{oracle}: has what {', '.join(names)} did")
