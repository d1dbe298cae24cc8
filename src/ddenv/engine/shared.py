"""Reuses tests that other runs have made of the same models, with the same seed, in the same
simulator: they have the same bits. The user's own simulators and controllers may not repeat, so
their tests are not reused.
"""

from __future__ import annotations

import platform
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.robot.result import RunResult
from ddenv.runfile.events import Created, EngineStarted
from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import ROBOT, RunFile
from ddenv.runs import processor
from ddenv.runs.folder import SUFFIX
from ddenv.runs.playback import table
from ddenv.text import Names
from ddenv.world.scenario import Scenario

OURS = ("straight", "costmap")

# Models and seed.
Key = tuple[frozenset[str], int]


@dataclass(frozen=True, slots=True)
class Place:
    """A finished test of a run file."""

    path: Path
    test: Test
    elements: Names


def simulator() -> str:
    """The versions of everything that the bits of a test may depend on: physics, noise and
    navigation.
    """
    return processor.versions("drake", "numpy", "scipy")


def machine() -> str:
    """What else they may depend on: Python and the processor."""
    return f"Python {platform.python_version()}, {processor.name().replace(',', '')}"


def tests_of_others(run: RunFile, scenario: Scenario, folder: Path) -> dict[Key, Place]:
    """The tests of the other runs in `folder` that ran to their end, by models and seed."""
    if scenario.oracle is not None or scenario.controller.use not in OURS:
        return {}
    known: dict[Key, Place] = {}
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        if path.resolve() == run.path.resolve():
            continue
        # Files that cannot be read are skipped.
        with suppress(UserError, KeyError, TypeError), RunFile(path) as other:
            ours, theirs = (
                next((each.event for each in file.events(most=1)), None) for file in (run, other)
            )
            # Both are asked for tests of the same models in the same world.
            alike = (
                isinstance(ours, Created)
                and isinstance(theirs, Created)
                and _asked(ours) == _asked(theirs)
            )
            documents = alike and all(
                run.documents(n) == other.documents(n) for n in ("world", "robot", "resource ")
            )
            written = other.events() if documents else []
            engines = (each.event for each in written if isinstance(each.event, EngineStarted))
            made_by = {(one.version, one.simulator, one.machine) for one in engines}
            if made_by == {(__version__, simulator(), machine())}:
                known |= dict(_tests_of(path, fold(written)))
    return known


def _tests_of(path: Path, state: RunState) -> Iterator[tuple[Key, Place]]:
    for test in state.tests:
        # Another run implies for itself. What ended early there was decided by where f ended there.
        if (
            test.outcome in ("pass", "similar", "other", "failed")
            and test.implied_by is None
            and not test.cut
        ):
            yield (frozenset(state.models_of(test)), test.seed), Place(path, test, state.elements)


def _asked(created: Created) -> Any:
    """The elements, and the scenario without its paths, and of how it is reduced only whether tests
    end early: contents of files are compared.
    """
    scenario = created.scenario
    paths = dict.fromkeys(("name", "description", "world", "folder"))
    robot = scenario["robot"] | {"model": None}
    reduction = scenario["reduction"]["early_stop"]
    return created.elements, scenario | paths | {"robot": robot, "reduction": reduction}


def result_of(place: Place) -> RunResult | None:
    """The result of a test; None if it can no longer be read."""
    test = place.test
    try:
        with RunFile(place.path) as other:
            motions = {name: table(rows) for name, rows in other.motions(test.id).items()}
    except UserError:
        return None
    trajectory = motions.pop(ROBOT, None)
    if trajectory is None or not len(trajectory):
        return None
    same = ("failure", "simulated_seconds", "wall_seconds", "seed", "cut")
    return RunResult(
        outcome="pass" if test.outcome == "pass" else "failed",
        trajectory=trajectory,
        motions=motions,
        first_sensed=dict(test.first_sensed),
        first_touched=dict(test.first_touched),
        took_part=None
        if test.took_part is None
        else frozenset(test.took_part.names(place.elements)),
        taken=place.path.stem,
        **{name: getattr(test, name) for name in same},
    )
