"""Runs with a changed number beside one of what is left with the same seed: as tests that can be
played, compared and drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.evidence.margins import MOST_RUNS, changes_at
from ddenv.runfile.events import MarginRan
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import RunFile
from ddenv.runs.reasons import Divergence, F, parted, parting_words
from ddenv.words.margins import rows
from ddenv.world.model import Model, World
from ddenv.world.pose import Pose
from ddenv.world.sdf.numbers import move_of

# A model that has moved to a limit: the verdict there, such as "f", the model, and how it has
# moved.
Limit = tuple[str, Model, Pose]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A number with another `value`, `share` of its scale away, at a limit of its margin, as
    `sentence` says; it means `changes` of numbers to values. `parting` compares two runs with one
    seed, of what is left as it is and with that value; None where no such pair is stored. `limits`
    are those up to which its model may move, if the number is a place.
    """

    name: str
    value: float
    share: float
    changes: tuple[tuple[str, float], ...]
    verdict: str
    sentence: str
    parting: Divergence | None
    limits: tuple[Limit, ...]


def changes(file: RunFile, state: RunState, world: World | None) -> tuple[Change, ...]:
    """A change for each number with a limit: to the nearest value at which the robot reaches its
    goal, or else f is gone.
    """
    margins = state.margins
    if margins is None:
        return ()
    by_name = {} if world is None else {model.name: model for model in world.models}
    found = []
    for row in rows(margins):
        one = row.margin
        asked = row.margin.asked
        ends = [
            value
            for side in one.sides
            for value in (side.goal, side.gone)
            if value and value.outcomes
        ]
        if not ends:
            continue
        value = min(ends, key=lambda each: (each.verdict != "goal", abs(each.value - asked.now)))
        parting = _parting(file, state, asked.name, value.value)
        limits = list[Limit]()
        owner, _, what = asked.name.rpartition(".")
        if owner in by_name and what in ("x", "y", "yaw"):
            for each in (each for side in one.sides for each in (side.until, side.gone) if each):
                limits.append(
                    (each.verdict, by_name[owner], move_of(by_name[owner], what, each.value))
                )
        share = abs(value.value - asked.now) / asked.scale
        words = f"{row.sentence}. {parting_words(parting, '', '')}".rstrip()
        to = changes_at(asked, value.value)
        found.append(
            Change(
                name=asked.name,
                value=value.value,
                share=share,
                changes=to,
                verdict=value.verdict,
                sentence=words,
                parting=parting,
                limits=tuple(limits),
            )
        )
    return tuple(found)


def beside(state: RunState) -> Test | None:
    """The run of what is left that shows f and with which those with changed numbers are compared;
    None if there is none.
    """
    margins = state.margins
    there = margins and margins.asked.environment
    tests = (
        test
        for test in state.tests
        if test.environment == there and test.outcome == F and test.run < MOST_RUNS
    )
    return min(tests, key=lambda test: test.run, default=None)


def changed_run(state: RunState, number: int) -> tuple[MarginRan, Test]:
    """The run with this negative `number`, also as a test, whose phase says what was changed.
    Raises UserError.
    """
    margins = state.margins
    place = -1 if margins is None else -number - 1 - margins.earlier
    if margins is None or not 0 <= place < len(margins.runs):
        raise UserError(f"there is no run {-number} with a changed number")
    one = margins.runs[place]
    test = Test(
        id=number,
        environment=margins.asked.environment,
        phase=f"{one.name} = {one.value:.4g}",
        round=None,
        candidate=None,
        run=one.run,
        seed=one.seed,
        outcome=one.outcome,
        failure=one.failure,
        distance=one.distance,
        end_pose=one.end_pose,
    )
    return one, test


def _parting(file: RunFile, state: RunState, name: str, value: float) -> Divergence | None:
    left = beside(state)
    margins = state.margins
    if left is None or margins is None:
        return None
    for place, one in enumerate(margins.runs):
        number = -1 - margins.earlier - place
        if (one.name, one.value, one.run) == (name, value, left.run) and (
            samples := file.motion(number)
        ):
            equal, apart, parted_at = parted(file.trajectory(left.id), samples)
            return Divergence(
                with_test=left.id,
                without_test=number,
                seed=left.seed,
                equal=equal,
                apart=apart,
                place=parted_at,
                met=None,
                touched=False,
            )
    return None
