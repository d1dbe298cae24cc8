"""Ends in groups, ends that scatter, and ends that lie elsewhere than before."""

import math
import random

from hypothesis import given
from hypothesis import strategies as st

from ddenv.evidence.ends import ERROR, elsewhere, groups_of, joining, one_place

EPSILON = 0.33
A, B = (3.0, 0.0, 0.2), (3.28, 0.1, 0.2)


def cloud(centre, reach, number, seed):
    """Ends that are equally likely everywhere within `reach` of a centre, m."""
    draw = random.Random(f"{centre} {reach} {seed}")
    polar = [(draw.uniform(0, math.tau), reach * math.sqrt(draw.random())) for _ in range(number)]
    return [
        (centre[0] + far * math.cos(angle), centre[1] + far * math.sin(angle), centre[2])
        for angle, far in polar
    ]


@given(
    seed=st.integers(0, 10**6),
    sizes=st.tuples(st.integers(2, 8), st.integers(3, 8)),
    reach=st.floats(0, 0.04),
)
def test_two_failures_within_epsilon_are_told_apart_by_the_epsilon_that_is_named(
    seed, sizes, reach
):
    ends = [*cloud(A, reach, sizes[0], seed), *cloud(B, reach, sizes[1], seed + 1)]
    random.Random(seed).shuffle(ends)
    found = groups_of(ends, EPSILON)
    assert sorted(map(len, found.groups)) == sorted(sizes)
    for group in found.groups:
        inside, outside = (
            [end for one, end in enumerate(ends) if (one in group) is here]
            for here in (True, False)
        )
        assert all(math.dist(inside[0], end) <= found.epsilon for end in inside)
        assert all(math.dist(inside[0], end) > found.epsilon for end in outside)


def test_a_single_cloud_is_hardly_ever_said_to_be_two():
    said = [groups_of(cloud(A, EPSILON / 2, 10, seed), EPSILON) is not None for seed in range(400)]
    assert sum(said) <= 8
    # Equal ends, a stray one, and a few ends are no groups.
    assert groups_of([A] * 10, EPSILON) is None
    assert groups_of([*[A] * 9, B], EPSILON) is None
    assert groups_of([A, A, B, B], EPSILON) is None


@given(seed=st.integers(0, 10**6), number=st.integers(5, 30))
def test_ends_that_scatter_are_joined_by_the_epsilon_that_is_named(seed, number):
    ends = cloud(A, 0.7, number, seed)
    reach = one_place(ends, EPSILON)
    if groups_of(ends, EPSILON) is None and any(
        math.dist(first, last) > 2 * EPSILON for first in ends for last in ends
    ):
        assert EPSILON < reach < joining(reach) <= 1.2 * reach + 0.1
        assert any(all(math.dist(centre, end) <= joining(reach) for end in ends) for centre in ends)


def test_ends_of_one_failure_and_of_several_far_apart_do_not_scatter():
    assert one_place(cloud(A, EPSILON / 2, 20, 0), EPSILON) is None
    assert one_place([*cloud(A, 0.1, 10, 0), *cloud((9.0, 0.0, 0.2), 0.1, 10, 0)], EPSILON) is None
    assert [joining(reach) for reach in (0.9, 1.2, 0.05, 11.0)] == [1.0, 1.4, 0.06, 12.1]


def test_what_is_left_ends_elsewhere():
    found = elsewhere([A] * 6 + [B] * 3, [B] * 11, EPSILON)
    assert (found.whole, found.of_whole, found.left, found.of_left, found.epsilon) == (
        6,
        9,
        0,
        11,
        0.15,
    )
    # A failure that is no longer there, and fewer runs of a rarer one, are none.
    assert elsewhere([A] * 7 + [B] * 2, [A] * 11, EPSILON) is None
    assert elsewhere([A] * 6 + [B] * 3, [A] * 7 + [B] * 4, EPSILON) is None
    assert elsewhere(cloud(A, 0.1, 9, 1), cloud(A, 0.1, 11, 2), EPSILON) is None


def test_ends_like_those_before_are_hardly_ever_said_to_lie_elsewhere():
    false = 0
    for seed in range(1000):
        draw = random.Random(seed)
        ends = [A if draw.random() < 0.6 else B for _ in range(22)]
        false += elsewhere(ends[:10], ends[10:], EPSILON) is not None
    assert false <= 1000 * ERROR
