"""Scripts of piles: used again, bounded in memory, and the same when they are made again."""

from __future__ import annotations

import numpy as np
import pytest

from ddenv.robot.piles import rehearsal
from ddenv.robot.piles.motion import Motion
from ddenv.robot.piles.rehearsal import Rehearsals, Repertoire, Script
from ddenv.robot.simulation.template import Template
from tests.robot.conftest import bits, cube, run
from tests.robot.piles.test_sleep import SECTIONS
from tests.tiers import slow

ROWS = 10


def script(*names: str) -> Script:
    links = len(names)
    return Script(
        names,
        np.zeros((ROWS, 13 * links)),
        (Motion.still(links),) * ROWS,
        (np.zeros(links),) * ROWS,
        np.ones(links, dtype=bool),
    )


def test_scripts_are_held_in_a_bounded_memory(world_of, monkeypatch):
    repertoire = Repertoire(world_of(), moving=0)
    everything = frozenset({"ground"})
    first = repertoire.add(("a",), everything, script("a"), 0.1)
    assert first.script
    monkeypatch.setattr(rehearsal, "MEMORY", 3.5 * first.script.size)
    for name in ("b", "c"):
        repertoire.add((name,), everything, script(name), 0.1)
    assert repertoire.find(("a",), everything) is first
    assert repertoire.add(("d",), everything, script("d"), 0.1).script
    assert not any(repertoire.find((name,), everything) for name in "abcd")
    # One that is larger than the memory is used once and not held.
    heap = tuple(f"box_{number}" for number in range(40))
    for _ in range(2):
        assert repertoire.add(heap, everything, script(*heap), 0.1).script
        assert not repertoire.find(heap, everything)
    # What cannot be simulated takes memory, too: the names of the models that stay.
    monkeypatch.setattr(rehearsal, "MEMORY", 0)
    repertoire.add(("e",), everything, None, 0.1)
    assert repertoire.find(("e",), everything) is None


@pytest.mark.rates
@pytest.mark.parametrize("memory", slow(pytest.mark.examples, [0.0, 3e5], but=[3e5]))
def test_a_small_memory_changes_no_bit(world_of, add, husky, scenario_of, monkeypatch, memory):
    world = add(
        world_of(), cube("a", 1.2, 0.0, 0.15), cube("b", 1, 3, 0.5), cube("c", 1.1, 3.1, 0.9), cube("d", 5, -9, 0.3)
    )
    parts = ["abcd", "bc", "abd", "cd", "abcd"]
    large = Template(world, husky, scenario_of(**SECTIONS))
    expected = [bits(run(large, *part)) for part in parts]
    rehearsed = []
    simulate = Rehearsals._rows
    monkeypatch.setattr(Rehearsals, "_rows", lambda self, *pile: rehearsed.append(pile) or simulate(self, *pile))
    monkeypatch.setattr(rehearsal, "MEMORY", memory)
    small = Template(world, husky, scenario_of(**SECTIONS))
    assert [bits(run(small, *part)) for part in parts] == expected
    # Of the piles b c, d, b, c one at least was made twice.
    assert len(rehearsed) > 4
