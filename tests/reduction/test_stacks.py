"""Stacks stay whole in every test of every search, and what is left needs each of them."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from ddenv.reduction.evidence import Trial
from ddenv.reduction.guide import make_guide, search
from ddenv.reduction.stacks import Stacks
from ddenv.runfile.supports import stacks
from tests.reduction.test_algorithms import any_oracle, every_search
from tests.reduction.worlds import evidence, tried
from tests.tiers import examples

COUNTS = st.integers(1, 12)
# Pairs of numbers, some of which are no models: those were removed before.
PAIRS = st.lists(st.tuples(st.integers(0, 14), st.integers(0, 14)), max_size=12)


def named(pairs):
    return tuple((f"m{upper}", f"m{lower}") for upper, lower in pairs)


@given(COUNTS, PAIRS)
def test_stacks_are_the_connected_parts_of_the_environment(count, pairs):
    environment = tuple(f"m{index}" for index in range(count))
    found = Stacks.of(stacks(environment, named(pairs)))
    groups = list(found.by_first.values())
    assert sorted(name for group in groups for name in group) == sorted(environment)
    stack_of = {name: group for group in groups for name in group}
    joined = [(upper, lower) for upper, lower in named(pairs) if upper in stack_of and lower in stack_of]
    assert all(stack_of[upper] == stack_of[lower] for upper, lower in joined)
    # No pairs are missing in between: each stack holds together.
    for group in groups:
        reached = {group[0]}
        for _ in group:
            reached |= {name for pair in joined if reached & set(pair) for name in pair}
        assert reached == set(group)
        assert list(group) == sorted(group, key=environment.index)
    assert found.representatives == tuple(sorted((group[0] for group in groups), key=environment.index))


@given(COUNTS, PAIRS, st.sets(st.integers(0, 11)))
def test_what_is_expanded_collapses_to_the_same(count, pairs, chosen):
    environment = tuple(f"m{index}" for index in range(count))
    found = Stacks.of(stacks(environment, named(pairs)))
    some = tuple(name for name in found.representatives if environment.index(name) in chosen)
    assert found.collapsed(found.expanded(some)) == some
    models = frozenset(environment[index] for index in chosen if index < count)
    whole = found.of_any(models)
    assert models <= whole
    assert whole == frozenset(found.expanded(found.collapsed(whole)))


@every_search
@given(count=COUNTS, pairs=PAIRS, seed=st.integers(0, 1000))
@examples(0.2)
def test_no_candidate_breaks_a_stack_and_no_stack_can_be_left_out(algorithm, pair, count, pairs, seed):
    known = evidence(count, seed)
    found = Stacks.of(stacks(known.elements, named(pairs)))
    is_similar, trials, winner = any_oracle(seed), [], None
    guide = make_guide(*pair, lambda: replace(known, trials=trials), growth="steady", skip="implied")
    searching = found.expand(search(algorithm, found.representatives, guide))
    environment = frozenset(known.elements)
    while True:
        try:
            round = searching.send(winner)
        except StopIteration as end:
            kept = end.value
            break
        assert frozenset(round.environment) == environment
        models = [name for part in round.partitions for name in part]
        assert sorted(models) == sorted(round.environment)
        for one in round.candidates:
            assert found.of_any(one.models) == one.models
            assert one.models | one.lacks == environment
        winner = next((one for one in round.candidates if is_similar(one.models)), None)
        environment = environment if winner is None else winner.models
        trials += [Trial(one.models, one is winner) for one in tried(round, winner)]
    assert kept == environment
    assert not any(is_similar(kept - frozenset(stack)) for stack in found.by_first.values() if kept.issuperset(stack))
