"""Stacks stay whole in every test of every search, and what is left needs each of them."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.reduction.evidence import Trial
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.reduction.round import Stacks
from ddenv.runfile.supports import stacks
from tests.reduction.test_algorithms import any_oracle, every_search
from tests.reduction.worlds import evidence, tried
from tests.tiers import examples

COUNTS = st.integers(1, 12)
# Pairs of numbers, some of which are no models: those were removed before.
PAIRS = st.lists(st.tuples(st.integers(0, 14), st.integers(0, 14)), max_size=12)


def stacks_of(count, pairs):
    """The stacks of models 0 to `count` - 1, where the first of each pair rests on the second."""
    names = tuple(f"m{index}" for index in range(count))
    groups = stacks(names, tuple((f"m{upper}", f"m{lower}") for upper, lower in pairs))
    return Stacks.of(Environment.of(map(names.index, group)) for group in groups)


@given(COUNTS, PAIRS)
def test_stacks_are_the_connected_parts_of_the_environment(count, pairs):
    found = stacks_of(count, pairs)
    groups = list(found.by_first.values())
    assert sorted(model for group in groups for model in group) == list(range(count))
    stack_of = {model: group for group in groups for model in group}
    joined = [(upper, lower) for upper, lower in pairs if upper in stack_of and lower in stack_of]
    assert all(stack_of[upper] == stack_of[lower] for upper, lower in joined)
    # No pairs are missing in between: each stack holds together.
    for group in groups:
        reached = {next(iter(group))}
        for _ in group:
            reached |= {model for pair in joined if reached & set(pair) for model in pair}
        assert reached == set(group)
    assert found.representatives == tuple(sorted(min(group) for group in groups))


@given(COUNTS, PAIRS, st.sets(st.integers(0, 11)))
def test_what_holds_any_of_a_stack_is_completed_to_whole_stacks(count, pairs, chosen):
    found = stacks_of(count, pairs)
    models = Environment.of(model for model in chosen if model < count)
    whole = found.of_any(models)
    assert models <= whole
    inside = [first for first, stack in found.by_first.items() if stack <= whole]
    assert whole == Environment.of(found.expanded(inside))
    # No stack is added without reason.
    assert not any(found.by_first[first].isdisjoint(models) for first in inside)


@every_search
@given(count=COUNTS, pairs=PAIRS, seed=st.integers(0, 1000))
@examples(0.2)
def test_no_candidate_breaks_a_stack_and_no_stack_can_be_left_out(
    algorithm, pair, count, pairs, seed
):
    known = evidence(count, seed)
    found = stacks_of(count, pairs)
    is_similar, trials, winner = any_oracle(seed), [], None
    guide = make_guide(
        *pair, lambda: replace(known, trials=trials), growth="steady", skip="implied"
    )
    searching = found.expand(begin_search(algorithm, found.representatives, guide))
    environment = Environment.whole(count)
    while True:
        try:
            round = searching.send(winner)
        except StopIteration as end:
            kept = end.value
            break
        assert Environment.of(round.environment) == environment
        models = [model for part in round.partitions for model in part]
        assert sorted(models) == sorted(round.environment)
        for one in round.candidates:
            assert found.of_any(one.models) == one.models
            assert one.models | one.lacks == environment
        winner = next((one for one in round.candidates if is_similar(one.models)), None)
        environment = environment if winner is None else winner.models
        trials += [Trial(one.models, one is winner, known.elements) for one in tried(round, winner)]
    assert kept == environment
    assert not any(is_similar(kept - stack) for stack in found.by_first.values() if stack <= kept)
