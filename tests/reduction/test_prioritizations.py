"""In which order partitions are tried."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ddenv.reduction.evidence import Evidence
from ddenv.reduction.prioritizations import (
    avg_trajectory_proximal,
    failure_proximal,
    min_trajectory_proximal,
    random,
    sequential,
    timestep,
)
from tests.reduction.worlds import evidence

PATH = np.array([[0.0, 0, 0, 0, 0], [1.0, 4, 0, 0, 0]])
KNOWN = Evidence(("a", "b", "c"), {"a": (0.0, 3, 0), "b": (4.0, 3, 0), "c": (2.0, 0, 1)}, PATH, (4.0, 0.0, 0.0))
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
