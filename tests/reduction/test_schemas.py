"""How the environment is split, and in which order partitions are tried."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from ddenv.reduction.evidence import Evidence, nearest_on_path, to_segments
from ddenv.reduction.guide import make_guide
from ddenv.reduction.partitionings import cuts, model2model, timeseg, trajectoryseg
from ddenv.reduction.prioritizations import (
    avg_trajectory_proximal,
    failure_proximal,
    min_trajectory_proximal,
    random,
    sequential,
    timestep,
)
from ddenv.reduction.round import make_round
from ddenv.schemas import names
from tests.reduction.worlds import evidence
from tests.tiers import slow

STILL = np.array([[0.0, 0, 0, 0, 0]])


def known(positions, trajectory):
    return Evidence(
        elements=tuple(positions),
        positions=positions,
        trajectory=np.array(trajectory, dtype=float),
        failure_position=tuple(trajectory[-1][1:4]),
    )


def test_model2model_finds_clusters_in_space():
    positions = {
        "a": (0.0, 0, 0),
        "b": (9.0, 0, 0),
        "c": (0.1, 0, 0),
        "d": (9.0, 0.1, 0),
        "e": (0.0, 5, 0),
    }
    found = model2model(tuple("abcde"), 3, known(positions, STILL))
    assert sorted(found) == [("a", "c"), ("b", "d"), ("e",)]


def test_models_at_one_place_fall_back_to_one_model_partitions():
    positions = dict.fromkeys("abcd", (1.0, 1.0, 0.0))
    assert model2model(tuple("abcd"), 3, known(positions, STILL)) == [
        ("a",),
        ("b",),
        ("c",),
        ("d",),
    ]


def test_timeseg_groups_models_by_when_the_robot_was_near():
    path = [[0.0, 0, 0, 0, 0], [1.0, 10, 0, 0, 0], [2.0, 10, 10, 0, 0]]
    positions = {"early": (2.0, 1, 0), "late": (11.0, 8, 0), "soon": (7.0, -1, 0)}
    assert timeseg(tuple(positions), 2, known(positions, path)) == [("early", "soon"), ("late",)]


def test_timeseg_measures_to_the_path_and_not_only_to_its_samples():
    path = np.array([[0.0, 0, 0], [10, 0, 0], [10, 4.2, 0]])
    # 4 m from the middle of the first stretch, whose ends are 6.4 m away; 5 m from the end of the
    # second.
    distance, fraction = to_segments(np.array([[5.0, 4.0, 0.0]]), path)
    assert distance[0] == pytest.approx([4.0, 5.0])
    assert fraction[0, 0] == pytest.approx(0.5)
    assert nearest_on_path(np.array([[5.0, 4.0, 0.0]]), np.arange(3.0), path)[1] == pytest.approx(
        [0.5]
    )


def test_of_two_times_at_one_place_the_first_counts():
    path = np.array([[0.0, 0, 0], [5, 0, 0], [0, 0, 0]])
    assert nearest_on_path(np.array([[1.0, 1, 0]]), np.arange(3.0), path)[1] == pytest.approx([0.2])


@pytest.mark.parametrize("split", [timeseg, trajectoryseg])
def test_a_robot_that_never_moved_still_splits(split):
    positions = {"a": (0.0, 0, 0), "b": (1.0, 0, 0)}
    assert split(("a", "b"), 2, known(positions, STILL)) == [("a", "b")]


def turning(*rates):
    """A robot with one turn rate (rad/s) for each second, sampled every 0.1 s."""
    yaw = np.concatenate([[0.0], np.cumsum(np.repeat(rates, 10)) / 10])
    times = np.arange(len(yaw)) / 10
    return np.column_stack(
        [times, np.cos(yaw), np.sin(yaw), np.zeros(len(yaw)), np.angle(np.exp(1j * yaw))]
    )


def test_trajectoryseg_cuts_where_the_turning_changes():
    # From 0 to 2 rad/s at 1 s, to -2 at 3 s; the heading passes pi on its way.
    assert cuts(turning(0, 2, 2, -2, -2), 0.5, 3) == pytest.approx([1.0, 3.0])


def test_changes_up_to_delta_are_no_cuts_and_long_spans_are_halved():
    trajectory = turning(0, 1.0, 1.0, 1.4)
    assert cuts(trajectory, 0.5, 2) == pytest.approx([1.0])
    # The change of 0.4 at 3 s counts with a smaller delta only; otherwise the longest span, from 1
    # to 4 s, is halved.
    assert cuts(trajectory, 0.5, 3) == pytest.approx([1.0, 2.5])
    assert cuts(trajectory, 0.3, 3) == pytest.approx([1.0, 3.0])


def test_of_too_many_cuts_the_sharpest_stay():
    trajectory = turning(0, 3, 2, 0, 4, 3)
    assert cuts(trajectory, 0.5, 3) == pytest.approx([1.0, 4.0])


def test_trajectoryseg_groups_models_by_manoeuvre():
    straight = [[t / 10, t / 10, 0, 0, 0] for t in range(21)]
    turn = [[2 + t / 10, 2 + np.sin(t / 10), 1 - np.cos(t / 10), 0, t / 10] for t in range(1, 11)]
    positions = {
        "on the way": (1.0, 0.5, 0),
        "in the turn": (3.0, 0.2, 0),
        "at the start": (-1.0, 0, 0),
    }
    found = trajectoryseg(tuple(positions), 2, known(positions, straight + turn))
    assert found == [("on the way", "at the start"), ("in the turn",)]


@pytest.mark.parametrize("partitioning", names("partitioning"))
@pytest.mark.parametrize("n", slow(pytest.mark.rates, [2, 60, 700, 4999], but=[60]))
def test_five_thousand_models_are_split_in_the_end(partitioning, n):
    """Not a timing, but a second more than planning takes in earnest would show here."""
    facts = evidence(5000, 1)
    guide = make_guide(partitioning, "min-trajectory-proximal", lambda: facts)
    started = time.process_time()
    models = tuple(range(5000))
    partitions = guide.split(models, n)
    round = make_round(n, models, list(zip(partitions, guide.rank(partitions), strict=True)))
    assert sorted(model for part in round.partitions for model in part) == list(models)
    assert time.process_time() - started < 30


PATH = np.array([[0.0, 0, 0, 0, 0], [1.0, 4, 0, 0, 0]])
KNOWN = Evidence(
    elements=("a", "b", "c"),
    positions={"a": (0.0, 3, 0), "b": (4.0, 3, 0), "c": (2.0, 0, 1)},
    trajectory=PATH,
    failure_position=(4.0, 0.0, 0.0),
)
PARTS = [("a",), ("b",), ("a", "b"), ("c",)]


def test_failure_proximal_measures_from_centroids_to_the_failure():
    assert failure_proximal(PARTS, KNOWN) == pytest.approx([5, 3, 13**0.5, 5**0.5])


def test_avg_trajectory_proximal_measures_to_the_robot_over_time():
    assert avg_trajectory_proximal(PARTS, KNOWN) == pytest.approx([4, 4, 13**0.5, 5**0.5])


def test_min_trajectory_proximal_measures_to_the_path_between_samples():
    assert min_trajectory_proximal(PARTS, KNOWN) == pytest.approx([3, 3, 3, 1])


def test_timestep_goes_by_the_first_model_sensed_and_puts_the_others_last():
    known = replace(KNOWN, first_sensed={"b": 0.4, "c": 2.5})
    assert timestep([*PARTS, ("b", "c")], known) == [math.inf, 0.4, 0.4, 2.5, 0.4]


def test_random_is_a_shuffle_that_the_seed_fixes():
    known = evidence(8, 3)
    partitions = [(name,) for name in known.elements]
    scores = random(partitions, known)
    assert scores == random(partitions, known)
    assert scores != sorted(scores)
    assert scores != random(partitions, replace(known, seed=4))


def test_sequential_keeps_the_order_of_the_world():
    assert sequential([("m4", "m5"), ("m1",), ("m3", "m0")], evidence(6, 1)) == [4.0, 1.0, 0.0]
