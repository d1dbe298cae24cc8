"""A worker of a cluster makes tests only if its first run has the bits of this machine."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("distributed")

from ddenv import __version__
from ddenv.engine.cluster.cluster_pool import refusal
from ddenv.engine.cluster.made_there import Hello
from ddenv.engine.shared import machine, simulator
from ddenv.engine.worker import Broken
from tests.engine.fake import result

SAME = Hello("b", __version__, simulator(), machine())
HERE = result("failed", 0, 2.0)


def nudged():
    other = HERE.trajectory.copy()
    other[1, 1] = np.nextafter(other[1, 1], 9)
    return replace(HERE, trajectory=other)


def test_the_same_bits_are_taken_in_whatever_the_versions():
    assert refusal(replace(SAME, machine="another processor"), HERE, HERE) == ""


@pytest.mark.parametrize(
    ("hello", "there", "why"),
    [
        (
            SAME,
            nudged(),
            (
                f"different bits; it has {simulator()}, {machine()}; this machine has "
                f"{simulator()}, "
                f"{machine()}"
            ),
        ),
        (replace(SAME, simulator="drake 0.1"), nudged(), "it has drake 0.1, "),
        (SAME, replace(HERE, took_part=frozenset({"wall"})), "different bits"),
        (SAME, replace(HERE, motions={"ball": HERE.trajectory}), "different bits"),
        (SAME, Broken("error", "no memory"), "broke: no memory"),
        (SAME, None, "different bits"),
        (replace(SAME, version="0.0.1"), None, "it has ddenv 0.0.1"),
    ],
)
def test_others_are_left_out_with_the_reason(hello, there, why):
    assert why in refusal(hello, there, HERE)


def test_a_simulator_of_the_users_own_is_compared_by_the_version_alone():
    assert refusal(SAME, None, None) == ""
    assert "it has ddenv 0.0.1" in refusal(replace(SAME, version="0.0.1"), None, None)
