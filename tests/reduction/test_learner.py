"""Chances: where needed models are likely to be, before and after tests."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.reduction.evidence import Evidence, Traits, Trial, spatial_prior
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.reduction.learner import Learner, beliefs, undominated
from tests.reduction.worlds import evidence, tried


def exact(prior, groups):
    """By looking at every set of needed models."""
    chances, whole = np.zeros(len(prior)), 0.0
    for needed in product([False, True], repeat=len(prior)):
        needed = np.array(needed)
        if all(needed[group].any() for group in groups):
            weight = np.where(needed, prior, 1 - prior).prod()
            whole += weight
            chances += weight * needed
    return chances / whole


@given(
    prior=st.lists(st.floats(0.02, 0.6), min_size=2, max_size=8).map(np.array),
    bits=st.lists(st.integers(1, 2**16), min_size=1, max_size=3),
)
def test_beliefs_are_near_bayes_rule(prior, bits):
    count = len(prior)
    groups = np.array([[bool(number >> index & 1) for index in range(count)] for number in bits])
    groups = groups[undominated(groups)]
    found = beliefs(prior, groups)
    right = exact(prior, [group for group in groups if group.any()])
    assert np.abs(found - right).max() < 0.12
    assert (found >= prior - 1e-9).all()


def test_one_group_is_exactly_bayes_rule():
    prior = np.array([0.1, 0.3, 0.2, 0.5])
    group = np.array([[True, True, True, False]])
    assert beliefs(prior, group) == pytest.approx(exact(prior, group), abs=1e-3)


def test_a_test_that_may_have_missed_f_says_less():
    prior, group = np.full(5, 0.1), np.ones((1, 5), dtype=bool)
    sure, unsure, blind = (beliefs(prior, group, miss)[0] for miss in (0.0, 0.5, 1.0))
    assert sure > unsure > blind
    assert blind == pytest.approx(0.1, abs=1e-3)


def test_of_nested_groups_the_smallest_speak():
    groups = np.array(
        [[1, 1, 1, 0], [1, 1, 0, 0], [0, 0, 1, 1], [1, 1, 0, 0], [0, 0, 0, 0]], dtype=bool
    )
    assert undominated(groups).tolist() == [1, 2]


def test_with_no_test_yet_the_near_ones_are_likely():
    positions = {
        name: (float(x), 0.0, 0.0) for name, x in zip("abcde", (8, 1, 3, 20, 5), strict=True)
    }
    known = Evidence(
        elements=tuple("abcde"),
        positions=positions,
        trajectory=np.array([[0.0, 9, 0, 0, 0], [1, 0, 0, 0, 0]]),
        failure_position=(0.0, 0.0, 0.0),
    )
    chances = Learner().chances(known.elements, known)
    assert "".join(known.elements[index] for index in np.argsort(-chances)) == "bcead"
    assert np.array_equal(chances, spatial_prior(known.elements, known))


def test_a_large_model_is_near_where_its_box_may_be():
    positions = {"hill": (6.0, 0.0, 0.0), "stone": (4.0, 0.0, 0.0)}
    known = Evidence(
        elements=("hill", "stone"),
        positions=positions,
        trajectory=None,
        failure_position=(0.0, 0.0, 0.0),
        traits={"hill": Traits(10), "stone": Traits(1)},
    )
    assert spatial_prior(("hill", "stone"), known)[0] > spatial_prior(("hill", "stone"), known)[1]


def test_it_learns_what_needed_models_are_like():
    """Slippery models are to blame, wherever they stand: seen in tests of some, believed of the
    others.
    """
    rng = np.random.default_rng(5)
    elements = tuple(f"m{index}" for index in range(40))
    positions = {name: (*rng.uniform(-5, 5, 2), 0.0) for name in elements}
    slippery = set(elements[::5])
    traits = {name: Traits(1.0, 0.01 if name in slippery else 1.0) for name in elements}
    whole = Environment.whole(len(elements))
    trials = [
        Trial(whole - Environment.of((number,)), name not in slippery, elements)
        for number, name in enumerate(elements[:20])
    ]
    left = tuple(name for name in elements if name in slippery or name not in elements[:20])
    learner = Learner()
    for made in range(1, len(trials) + 1):
        gone = {
            next(iter(set(elements) - trial.models)) for trial in trials[:made] if trial.similar
        }
        there = tuple(name for name in elements if name not in gone)
        known = Evidence(
            elements=elements,
            positions=positions,
            trajectory=None,
            failure_position=(0.0, 0.0, 0.0),
            traits=traits,
            trials=trials[:made],
        )
        chances = learner.chances(there, known)
    assert there == left
    new = [index for index, name in enumerate(left) if name not in elements[:20]]
    slippery_ones = [chances[index] for index in new if left[index] in slippery]
    others = [chances[index] for index in new if left[index] not in slippery]
    assert np.mean(slippery_ones) > 2 * np.mean(others)


def followed(weights):
    """Chances from the first rounds of many reductions, the prior's beside them, and whether the
    models are needed.

    `weights` (30,) say how likely the model at each rank of nearness to the failure is one of the
    three that are needed.
    """
    learnt, at_first, truth = [], [], []
    for seed in range(60):
        known = evidence(30, seed)
        end = known.failure_position
        near = sorted(
            known.elements, key=lambda name: np.linalg.norm(np.subtract(known.positions[name], end))
        )
        ranks = np.random.default_rng(seed).choice(30, 3, replace=False, p=weights / weights.sum())
        needed = Environment.of(known.elements.index(near[rank]) for rank in ranks)
        learner, trials = Learner(), []
        guide = make_guide(
            "model2model",
            "failure-proximal",
            lambda known=known: known,
            growth="steady",
            skip="implied",
        )
        searching, winner = begin_search("ddenv", range(30), guide), None
        for _ in range(8):
            round = searching.send(winner)
            if len(round.environment) < 6:
                break
            there = tuple(map(known.elements.__getitem__, round.environment))
            learnt += learner.chances(there, replace(known, trials=tuple(trials))).tolist()
            at_first += spatial_prior(there, known).tolist()
            truth += [model in needed for model in round.environment]
            winner = next((one for one in round.candidates if needed <= one.models), None)
            trials += [
                Trial(one.models, one is winner, known.elements) for one in tried(round, winner)
            ]
    return np.array(learnt), np.array(at_first), np.array(truth)


@pytest.mark.rates
def test_its_chances_are_right_on_average():
    """Of all models that it gives a chance of about a half while it works, about a half are needed,
    and so on.
    """
    learnt, _, needed = followed(1.0 / np.arange(1, 31))
    for low, high in ((0.0, 0.05), (0.05, 0.15), (0.15, 0.35), (0.35, 0.65), (0.65, 1.0)):
        inside = (learnt >= low) & (learnt < high)
        assert inside.sum() > 30
        assert needed[inside].mean() == pytest.approx(learnt[inside].mean(), abs=0.15), (low, high)


@pytest.mark.rates
@pytest.mark.parametrize(
    "weights",
    [1.0 / np.arange(1, 31), np.ones(30), np.arange(30) < 12],
    ids=["near", "any", "ring"],
)
def test_wherever_the_needed_models_are_it_does_better_than_nearness_alone(weights):
    learnt, at_first, needed = followed(np.array(weights, dtype=float))

    def surprise(chances):
        return -np.mean(np.where(needed, np.log(chances), np.log1p(-chances)))

    assert surprise(learnt) < 0.95 * surprise(at_first)


def test_likely_models_stand_in_small_partitions():
    known = evidence(60, 2)
    learner = Learner()
    partitions = learner(known.elements, 4, known)
    chances = dict(zip(known.elements, learner.chances(known.elements, known), strict=True))
    likely = max(partitions, key=lambda part: np.mean([chances[name] for name in part]))
    unlikely = min(partitions, key=lambda part: np.mean([chances[name] for name in part]))
    assert len(unlikely) > 3 * len(likely)
    # Like chances stand together: the partitions do not overlap in them.
    spans = sorted(
        (min(chances[name] for name in part), max(chances[name] for name in part))
        for part in partitions
    )
    assert all(high <= low for (_, high), (low, _) in pairwise(spans))
