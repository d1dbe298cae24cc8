"""What every algorithm promises, for any world and any oracle."""

from contextlib import suppress
from dataclasses import replace
from random import Random
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ddenv
from ddenv.environment import NOTHING, Environment
from ddenv.reduction.algorithms import sweep
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.schemas import uses
from tests.reduction.worlds import ALGORITHMS, PAIRS, carried_through, evidence, run, worlds
from tests.tiers import examples

OPTIONS = st.fixed_dictionaries(
    {
        "n_partitions": st.integers(2, 6),
        "complement_order": st.sampled_from(["paper", "far-first"]),
        "growth": st.sampled_from(["paper", "steady"]),
        "skip": st.sampled_from(["known", "implied"]),
        "prior": st.sampled_from(["spatial", "uniform"]),
    }
)
# Every pair with the paper's algorithm; the others look at less of it.
SEARCHES = [("ddenv", pair) for pair in PAIRS] + [
    (algorithm, pair)
    for algorithm in ALGORITHMS
    if algorithm != "ddenv"
    for pair in (PAIRS[0], PAIRS[-1])
]
every_search = pytest.mark.parametrize(
    ("algorithm", "pair"),
    SEARCHES,
    ids=[f"{algorithm}-{'/'.join(pair)}" for algorithm, pair in SEARCHES],
)


def any_oracle(salt):
    """Shows the failure in a third of all environments, without any order in it."""
    return lambda models: crc32(f"{salt} {list(models)}".encode()) % 3 == 0


@every_search
@given(world=worlds, options=OPTIONS)
@examples(0.2)
def test_a_monotone_oracle_leaves_exactly_the_needed_models(algorithm, pair, world, options):
    count, needed, seed = world
    kept, _ = run(evidence(count, seed), needed.__le__, pair, algorithm, **options)
    assert kept == needed


@every_search
@given(world=worlds, salt=st.integers(0, 10**6), options=OPTIONS)
@examples(0.2)
def test_any_deterministic_oracle_leaves_a_one_minimal_environment(
    algorithm, pair, world, salt, options
):
    count, _, seed = world
    is_similar = any_oracle(salt)
    kept, _ = run(evidence(count, seed), is_similar, pair, algorithm, **options)
    assert not any(is_similar(kept - Environment.of((model,))) for model in kept)


@every_search
@given(world=worlds, salt=st.integers(0, 10**6), options=OPTIONS)
@examples(0.1)
def test_partitions_are_disjoint_not_empty_and_cover_the_environment(
    algorithm, pair, world, salt, options
):
    count, _, seed = world
    for round, _ in run(evidence(count, seed), any_oracle(salt), pair, algorithm, **options)[1]:
        models = [model for partition in round.partitions for model in partition]
        assert sorted(models) == sorted(round.environment)
        assert all(round.partitions)
        assert len(round.partitions) <= round.n_partitions or round.exhaustive
        keeps = [one.models for one in round.candidates]
        assert keeps
        assert len(set(keeps)) == len(keeps)
        there = Environment.of(round.environment)
        assert there not in keeps
        assert NOTHING not in keeps or len(round.environment) == 1
        for one in round.candidates:
            part = Environment.of(one.part)
            assert one.part == round.partitions[one.partition]
            assert (one.models, one.lacks) == (
                (part, there - part) if one.kind == "partition" else (there - part, part)
            )


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_world_that_f_does_not_need_is_left_empty(algorithm):
    assert run(evidence(9, 1), lambda _: True, algorithm=algorithm)[0] == NOTHING


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_empty_world_needs_no_round(algorithm):
    assert run(evidence(0, 1), lambda _: True, algorithm=algorithm) == (NOTHING, [])


@given(world=worlds)
@examples(0.4)
def test_what_is_implied_is_tried_only_to_prove_the_end_minimal(world):
    """With `skip: implied`, no subset of an environment without f is tried, but for one without a
    single model.

    Nor that one where a certificate will show what is needed.
    """
    count, needed, seed = world
    for proves in (True, False):
        failed = []
        kept, rounds = run(evidence(count, seed), needed.__le__, skip="implied", proves=proves)
        for round, winner in rounds:
            for one in round.candidates:
                if one is winner:
                    break
                single = proves and len(one.lacks) == 1
                assert single or not any(one.models <= models for models in failed)
                failed.append(one.models)
        assert kept == needed


def test_nothing_is_implied_by_tests_that_broke():
    known = evidence(8, 1)

    def second_round(broke):
        guide = make_guide(
            "model2model", "failure-proximal", lambda: known, skip="implied", growth="steady"
        )
        searching = begin_search("ddenv", range(8), replace(guide, broke=lambda candidate: broke))
        return [one.models for one in list(_rounds(searching))[1].candidates]

    assert set(second_round(broke=False)) < set(second_round(broke=True))


def test_in_a_sweep_all_models_have_one_run_before_any_has_a_second_one():
    looks = [(round.runs, len(round.candidates)) for round in _rounds(sweep((0, 1, 2), 3))]
    assert looks == [(1, 3), (2, 3), (3, 3)]


def _rounds(searching):
    """The rounds of a search to which nothing is similar."""
    with suppress(StopIteration):
        round = next(searching)
        while True:
            yield round
            round = searching.send(None)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_algorithm_uses_the_parts_of_the_pair_that_it_is_said_to_use(algorithm):
    guide, used = make_guide("model2model", "failure-proximal", lambda: evidence(9, 1)), set()

    def split(environment, n):
        used.add("partitioning")
        return guide.split(environment, n)

    def rank(partitions):
        used.add("prioritization")
        return guide.rank(partitions)

    carried_through(
        begin_search(algorithm, range(9), replace(guide, split=split, rank=rank)),
        Environment.of((1, 7)).__le__,
    )
    assert used == set(uses(algorithm))


def test_many_needed_models_far_apart_take_ddenv_little_more_than_splitting_and_as_printed_stays():
    draw = Random(0)
    elements = [f"m{number}" for number in range(100)]
    places = {name: (draw.uniform(0, 20), draw.uniform(0, 20), 0.0) for name in elements}
    needed = frozenset(draw.sample(elements, 20))

    def tests(**options):
        found = ddenv.reduce(
            elements,
            needed.issubset,
            positions=places,
            failure_pose=(10, 10, 0),
            accept_rate="first",
            **options,
        )
        assert frozenset(found.kept) == needed
        return found.search_tests

    assert tests() < 1.3 * tests(algorithm="splitting")
    assert tests(growth="paper", skip="known") > 2 * tests()
