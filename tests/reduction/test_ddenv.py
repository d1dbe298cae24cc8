"""What the algorithm promises, for any world and any oracle."""

from zlib import crc32

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ddenv.reduction.ddenv import ddenv
from ddenv.reduction.evidence import Evidence
from ddenv.reduction.partitioning import PARTITIONINGS, distance_to_segments, one_model_partitions
from ddenv.reduction.prioritization import PRIORITIZATIONS

PAIRS = [(p, q) for p in PARTITIONINGS for q in PRIORITIZATIONS]


def evidence(count, seed):
    rng = np.random.default_rng(seed)
    positions = {f"m{index}": tuple(rng.normal(size=3)) for index in range(count)}
    trajectory = np.column_stack([np.arange(20) / 10, np.cumsum(rng.normal(size=(20, 3)), axis=0)])
    return Evidence(positions, trajectory, tuple(trajectory[-1, 1:]), seed)


def reduce(known, pair, is_similar, **options):
    """Drives the generator as the engine does; returns what is left and the rounds."""
    split, rank = PARTITIONINGS[pair[0]], PRIORITIZATIONS[pair[1]]
    algorithm = ddenv(
        known.positions, lambda e, n: split(e, n, known), lambda partitions: rank(partitions, known), **options
    )
    rounds, winner = [], None
    try:
        while True:
            rounds.append(algorithm.send(winner))
            winner = next((one for one in rounds[-1].candidates if is_similar(one.models)), None)
            assert len(rounds) < 1000
    except StopIteration as end:
        return end.value, rounds


worlds = st.integers(1, 14).flatmap(
    lambda count: st.tuples(
        st.just(count), st.sets(st.integers(0, count - 1), min_size=1, max_size=4), st.integers(0, 1000)
    )
)


@pytest.mark.parametrize("pair", PAIRS, ids="/".join)
@given(world=worlds, n=st.integers(2, 6))
@settings(max_examples=25)
def test_a_monotone_oracle_leaves_exactly_the_needed_models(pair, world, n):
    count, numbers, seed = world
    needed = {f"m{index}" for index in numbers}
    kept, _ = reduce(evidence(count, seed), pair, needed.issubset, n_partitions=n)
    assert kept == needed


@given(world=worlds, salt=st.integers(0, 10**6), order=st.sampled_from(["paper", "far-first"]))
@settings(max_examples=60)
def test_any_deterministic_oracle_leaves_a_one_minimal_environment(world, salt, order):
    count, _, seed = world

    def is_similar(models):
        return crc32(f"{salt} {sorted(models)}".encode()) % 3 == 0

    kept, _ = reduce(evidence(count, seed), ("model2model", "failure-proximal"), is_similar, complement_order=order)
    assert not any(is_similar(kept - {name}) for name in kept)


@pytest.mark.parametrize("pair", PAIRS, ids="/".join)
@given(world=worlds)
@settings(max_examples=20)
def test_partitions_are_disjoint_not_empty_and_cover_the_environment(pair, world):
    count, numbers, seed = world
    needed = {f"m{index}" for index in numbers}
    for round in reduce(evidence(count, seed), pair, needed.issubset)[1]:
        models = [name for partition in round.partitions for name in partition]
        assert sorted(models) == sorted(round.environment)
        assert all(round.partitions)
        assert len(round.partitions) <= round.n_partitions or round.exhaustive
        assert list(round.scores) == sorted(round.scores)
        keeps = [one.models for one in round.candidates]
        assert len(set(keeps)) == len(keeps)
        assert frozenset(round.environment) not in keeps
        assert frozenset() not in keeps or len(round.environment) == 1


def test_a_world_of_six_models_step_by_step():
    """By hand, on a line at x = 0, 1, 5, 6, 20, 21 with the failure at 0; a and e are needed."""
    positions = {name: (x, 0.0, 0.0) for name, x in zip("abcdef", (0.0, 1.0, 5.0, 6.0, 20.0, 21.0), strict=True)}
    known = Evidence(positions, np.array([[0.0, 5, 0, 0], [1.0, 0, 0, 0]]), (0.0, 0.0, 0.0))
    kept, rounds = reduce(known, ("model2model", "failure-proximal"), {"a", "e"}.issubset)
    assert kept == {"a", "e"}
    # n=2: {abcd} and {ef} are each other's complements: two candidates, neither holds both a and e.
    assert [sorted(one.models) for one in rounds[0].candidates] == [list("abcd"), list("ef")]
    # n=3: {ab}, {cd}, {ef}; near first. p0, c0, p1 fail, and c1 = without cd is similar.
    assert [(one.kind, "".join(sorted(one.models))) for one in rounds[1].candidates][:4] == [
        ("partition", "ab"),
        ("complement", "cdef"),
        ("partition", "cd"),
        ("complement", "abef"),
    ]
    # n=4 = |E|: one-model partitions. Without b, three models are left; n=5 is cut to 3, and f goes.
    assert rounds[2].environment == ("a", "b", "e", "f")
    assert rounds[2].n_partitions == 4
    assert rounds[3].environment == ("a", "e", "f")
    assert rounds[3].n_partitions == 3
    # The last round, n=2=|E|, finds nothing: a and e stay.
    assert rounds[4].environment == ("a", "e")
    assert rounds[4].exhaustive
    assert len(rounds) == 5


def test_far_first_leaves_the_farthest_out_first():
    positions = {name: (float(index), 0.0, 0.0) for index, name in enumerate("abc")}
    known = Evidence(positions, np.array([[0.0, 0, 0, 0]]), (0.0, 0.0, 0.0))
    _, rounds = reduce(
        known, ("model2model", "failure-proximal"), lambda _: False, n_partitions=3, complement_order="far-first"
    )
    complements = [sorted(one.models) for one in rounds[0].candidates if one.kind == "complement"]
    assert complements == [["a", "b"], ["a", "c"], ["b", "c"]]


def test_models_at_one_place_fall_back_to_one_model_partitions():
    known = Evidence(dict.fromkeys("abcd", (1.0, 1.0, 0.0)), np.array([[0.0, 0, 0, 0]]), (0.0, 0.0, 0.0))
    assert PARTITIONINGS["model2model"](tuple("abcd"), 3, known) == one_model_partitions(tuple("abcd"))


def test_timeseg_groups_models_by_when_the_robot_was_near():
    path = np.array([[0.0, 0, 0, 0], [1.0, 10, 0, 0], [2.0, 10, 10, 0]])
    known = Evidence({"early": (2.0, 1, 0), "late": (11.0, 8, 0), "soon": (7.0, -1, 0)}, path, (10.0, 10.0, 0.0))
    assert PARTITIONINGS["timeseg"](("early", "late", "soon"), 2, known) == [("early", "soon"), ("late",)]


def test_timeseg_measures_to_the_path_and_not_only_to_its_samples():
    path = np.array([[0.0, 0, 0, 0], [1.0, 10, 0, 0], [2.0, 10, 4.2, 0]])
    known = Evidence({"beside": (5.0, 4.0, 0.0)}, path, (10.0, 4.0, 0.0))
    # 4 m from the middle of the first stretch, whose ends are 6.4 m away; 5 m from the end of the second.
    assert distance_to_segments(np.array([[5.0, 4.0, 0.0]]), path[:, 1:4]).argmin() == 0
    assert PARTITIONINGS["timeseg"](("beside",), 2, known) == [("beside",)]


def test_a_robot_that_never_moved_still_splits():
    known = Evidence({"a": (0.0, 0, 0), "b": (1.0, 0, 0)}, np.array([[0.0, 0, 0, 0]]), (0.0, 0.0, 0.0))
    assert PARTITIONINGS["timeseg"](("a", "b"), 2, known) == [("a", "b")]


def test_random_is_a_shuffle_that_the_seed_fixes():
    known = evidence(8, 3)
    partitions = one_model_partitions(tuple(known.positions))
    scores = PRIORITIZATIONS["random"](partitions, known)
    assert scores == PRIORITIZATIONS["random"](partitions, known)
    assert scores != sorted(scores)


def test_sequential_keeps_the_order_of_the_world():
    known = evidence(6, 1)
    assert PRIORITIZATIONS["sequential"]([("m4", "m5"), ("m1",), ("m3", "m0")], known) == [4.0, 1.0, 0.0]


def test_proximal_orders_measure_what_they_say():
    path = np.array([[0.0, 0, 0, 0], [1.0, 4, 0, 0]])
    known = Evidence({"a": (0.0, 3, 0), "b": (4.0, 3, 0)}, path, (4.0, 0.0, 0.0))
    assert PRIORITIZATIONS["failure-proximal"]([("a",), ("b",), ("a", "b")], known) == pytest.approx([5, 3, 13**0.5])
    assert PRIORITIZATIONS["avg-trajectory-proximal"]([("a",), ("a", "b")], known) == pytest.approx([4, 13**0.5])
