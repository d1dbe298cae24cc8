"""What the setup screen asks for, as text fields to numbers, with complaints that name the field. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ddenv.errors import UserError

if TYPE_CHECKING:
    from ddenv.world.scenario import Reduction, Scenario


@dataclass(frozen=True, slots=True)
class Field:
    """`id` is the field's name on the screen, `label` what stands before it; `kind` is int, float or str."""

    id: str
    label: str
    kind: type
    tooltip: str


OPTIONS = (
    Field("iterations", "iterations", int, "re-runs of a candidate that did not show the failure"),
    Field("timeout", "timeout s", float, "simulated time the robot has to reach its goal, s"),
    Field("n_partitions", "n_partitions", int, "partitions in the first round"),
    Field("epsilon", "epsilon m", float, "how far from f's end a run may end and still be similar, m"),
    Field("seed", "seed", int, "run i of every candidate uses seed + i"),
    Field("jobs", "jobs", int, "tests that run at the same time"),
)
PLACES = (
    Field("spawn_x", "spawn x m", float, "where the robot starts, m"),
    Field("spawn_y", "spawn y m", float, "where the robot starts, m"),
    Field("spawn_z", "spawn z m", float, "height of the robot's frame at the start, m"),
    Field("spawn_yaw", "yaw rad", float, "heading at the start, rad"),
    Field("goal_x", "goal x m", float, "where the robot has to go, m"),
    Field("goal_y", "goal y m", float, "where the robot has to go, m"),
)
EARLY_STOP = {"off": False, "on": True}
NAME = Field("name", "run name", str, "what the run is called: a file in the runs folder")


class FieldError(UserError):
    """A field's text is wrong; `field` is its id."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


def value(field: Field, text: str) -> int | float | str:
    """What `text` stands for. Raises FieldError."""
    text = text.strip()
    if not text:
        raise FieldError(field.id, f"{field.label}: is missing")
    try:
        return field.kind(text)
    except ValueError:
        wanted = "a whole number" if field.kind is int else "a number"
        raise FieldError(field.id, f"{field.label}: expected {wanted}, found '{text[:40]}'") from None


def values(fields: tuple[Field, ...], texts: Mapping[str, str]) -> dict[str, int | float | str]:
    """The values of all `fields`. Raises FieldError for the first wrong one."""
    return {field.id: value(field, texts.get(field.id, "")) for field in fields}


def jobs(number: int) -> int:
    """At least one test at a time, and no more than a large machine can do. Raises FieldError."""
    if not 1 <= number <= 256:
        raise FieldError("jobs", f"jobs: expected 1 to 256, found {number}")
    return number


def are_jobs(text: str) -> bool:
    """Whether `text` can stand in the field for jobs."""
    try:
        jobs(int(text))
    except (ValueError, FieldError):
        return False
    return True


def texts_of(scenario: Scenario) -> dict[str, str]:
    """What a scenario's own settings are, as texts for the fields."""
    reduction, failure = scenario.reduction, scenario.failure
    return {
        "iterations": str(reduction.iterations),
        "timeout": f"{failure.timeout:g}",
        "n_partitions": str(reduction.n_partitions),
        "epsilon": f"{failure.epsilon:g}",
        "seed": str(reduction.seed),
    }


def settings_of(reduction: Reduction) -> dict[str, str]:
    """A sentence for each name that has a setting without a field: what it is here, and the scenario's key for it."""
    prior = f"Here the prior is {reduction.prior} (reduction.prior)."
    return {
        "trajectoryseg": f"Here delta is {reduction.delta:g} rad/s (reduction.delta).",
        "probdd": prior,
        "splitting": prior,
    }


def field_of(error: UserError) -> str | None:
    """The field that a complaint about a scenario's key belongs to, if it has one."""
    if isinstance(error, FieldError):
        return error.field
    message = str(error)
    for field in (*OPTIONS, *PLACES):
        section, _, key = field.id.partition("_")
        names = (f".{field.id}:", f"robot.spawn.{key}:" if section == "spawn" else f"{section}.{key}:")
        if any(name in message for name in names):
            return field.id
    if "robot.spawn" in message:
        return "spawn_x"
    return NAME.id if "exists already" in message else None
