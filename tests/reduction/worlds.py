"""Small random worlds for the tests of the reduction, and a driver that does as the engine does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.reduction.evidence import Evidence, Traits, Trial
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.schemas import names, pairs

PAIRS = [tuple(pair.split("/")) for pair in pairs()]
ALGORITHMS = names("algorithm")


def evidence(count, seed, **known):
    """A world of `count` models and a robot that wandered about, with a trace of all there is to
    know.
    """
    rng = np.random.default_rng(seed)
    elements = tuple(f"m{index}" for index in range(count))
    positions = {name: tuple(rng.normal(size=3)) for name in elements}
    path = np.cumsum(rng.normal(size=(20, 3)), axis=0)
    trajectory = np.column_stack([np.arange(20) / 10, path, np.cumsum(rng.normal(size=20))])
    sensed = {name: float(rng.uniform(0, 2)) for name in elements if rng.random() < 0.7}
    traits = {name: Traits(*rng.uniform(0.1, 2, 2), bool(rng.random() < 0.5)) for name in elements}
    facts = {
        "first_sensed": sensed,
        "touched": frozenset(list(sensed)[::3]),
        "traits": traits,
        "seed": seed,
    } | known
    return Evidence(
        elements=elements,
        positions=positions,
        trajectory=trajectory,
        failure_position=tuple(path[-1]),
        **facts,
    )


def line(**places):
    """Models on a line, the robot came from x = 5 and failed at 0."""
    positions = {name: (float(x), 0.0, 0.0) for name, x in places.items()}
    trajectory = np.array([[0.0, 5, 0, 0, 0], [1.0, 0, 0, 0, 0]])
    return Evidence(
        elements=tuple(places),
        positions=positions,
        trajectory=trajectory,
        failure_position=(0.0, 0.0, 0.0),
    )


def run(known, is_similar, pair=("model2model", "failure-proximal"), algorithm="ddenv", **options):
    """What is left, and the rounds with their winners. The schemas see every test that was made."""
    trials = []
    guide = make_guide(*pair, lambda: replace(known, trials=trials), **options)
    searching = begin_search(algorithm, range(len(known.elements)), guide)

    def learn(round, winner):
        trials.extend(
            Trial(one.models, one is winner, known.elements) for one in tried(round, winner)
        )

    return carried_through(searching, is_similar, learn)


def carried_through(searching, is_similar, learn=lambda round, winner: None):
    """The end of a search, and its rounds with their winners."""
    rounds, winner = [], None
    try:
        while True:
            round = searching.send(winner)
            winner = next((one for one in round.candidates if is_similar(one.models)), None)
            rounds.append((round, winner))
            learn(round, winner)
            assert len(rounds) < 2000, "it does not end"
    except StopIteration as end:
        return end.value, rounds


def tried(round, winner):
    """The candidates of a round up to the winner."""
    return (
        round.candidates
        if winner is None
        else round.candidates[: round.candidates.index(winner) + 1]
    )


def needing(known, *names):
    """An oracle that shows the failure where all models of these names are there."""
    needed = Environment.of(map(known.elements.index, names))
    return lambda models: needed <= models


# How many models, which of them f needs, and a seed.
worlds = st.integers(1, 14).flatmap(
    lambda count: st.tuples(
        st.just(count),
        st.sets(st.integers(0, count - 1), min_size=1, max_size=5).map(Environment.of),
        st.integers(0, 1000),
    )
)
