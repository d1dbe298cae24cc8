"""Scripts of piles: used again, bounded in memory, and the same when they are made again."""

from __future__ import annotations

import pytest

from ddenv.robot.piles import rehearsal
from ddenv.robot.piles.rehearsal import Rehearsals
from ddenv.robot.simulation.template import Template
from tests.robot.conftest import bits, cube, run
from tests.robot.piles.test_sleep import SECTIONS
from tests.tiers import slow


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
