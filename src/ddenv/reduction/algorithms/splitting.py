"""Binary splitting from far to near: group testing (Hwang 1972) for environments."""

from __future__ import annotations

import math

import numpy as np

from ddenv.reduction.algorithms.sweep import sweep
from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Guide, Search
from ddenv.reduction.round import left_out, one_model_partitions


def splitting(elements: Partition, guide: Guide) -> Search:
    """Binary splitting. The models stand in a line, by the prioritization, the last one first: far to near. A group at the head of
    the line is left out, so large that the failure shows with even chances; if it does not show, one of the group is needed, and
    halves of it are left out until it is found. At the end each model is left out once more. It takes the failure for one that
    needs all its models in every environment, and then needs about as few tests as can be.
    """
    line = _far_to_near(elements, guide)
    weight = dict(zip(line, -np.log1p(-guide.chances(line)), strict=True))
    environment, suspects = line, ()
    passed = found = 0.0
    while line:
        # How much likelier needed models are than was thought, from what was passed so far.
        likelier = (1.0 + found) / (1.0 + passed)
        group = _half(suspects, weight, likelier) if suspects else _head(line, weight, likelier)
        round = left_out(group, environment)
        # f is taken to need something: leaving out everything is not worth a test.
        winner = (yield round) if round.candidates else None
        if winner is not None:
            environment = tuple(name for name in environment if name not in set(group))
            line, suspects = line[len(group) :], suspects[len(group) :]
            passed += sum(weight[name] for name in group)
        else:
            suspects = group
        if len(suspects) == 1:
            # All others that were suspected are gone.
            passed, found = passed + weight[suspects[0]], found + 1
            line, suspects = line[1:], ()
    return (yield from sweep(environment))


def _far_to_near(elements: Partition, guide: Guide) -> Partition:
    scores = guide.rank(one_model_partitions(elements)) if elements else []
    return tuple(name for name, _ in sorted(zip(elements, scores, strict=True), key=lambda pair: -pair[1]))


def _head(line: Partition, weight: dict[str, float], likelier: float) -> Partition:
    """So many models from the head of the line that none of them is needed with even chances; at least one."""
    reach = np.cumsum([weight[name] for name in line]) * likelier
    return line[: max(1, int(np.searchsorted(reach, math.log(2.0))))]


def _half(suspects: Partition, weight: dict[str, float], likelier: float) -> Partition:
    """So many of the suspects, of which one is needed, that it is among them with even chances; not all of them."""
    reach = np.cumsum([weight[name] for name in suspects]) * likelier
    # Solves (e^-x - e^-all) / (1 - e^-all) = 1/2: none in the first part, though some in all.
    even = -math.log((1.0 + math.exp(-reach[-1])) / 2.0)
    nearest = int(np.argmin(np.abs(reach[:-1] - even)))
    return suspects[: nearest + 1]
