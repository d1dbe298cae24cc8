"""What the setup screen asks for, as texts to values, with complaints that name the field. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

Value = int | float | str | bool | None
ON, OFF = "on", "off"


@dataclass(frozen=True, slots=True)
class Field:
    """`id` is the field's name on the screen, `label` what stands before it, `kind` int, float, str or bool.

    `key` is the scenario's key for it, "" where a scenario has none. `choices` are the words it may be, if these are few. A field
    may be empty where `empty` says so: it is shown in its place.
    """

    id: str
    label: str
    kind: type
    key: str = ""
    choices: tuple[str, ...] = ()
    empty: str = ""


BASIC = (
    Field("iterations", "iterations", int, "reduction.iterations"),
    Field("budget", "budget", int, "reduction.budget", empty="none"),
    Field("timeout", "timeout s", float, "failure.timeout"),
    Field("epsilon", "epsilon m", float, "failure.epsilon"),
    Field("seed", "seed", int, "reduction.seed"),
    Field("jobs", "jobs", int),
)
PLACES = (
    Field("spawn_x", "spawn x m", float, "robot.spawn.x"),
    Field("spawn_y", "spawn y m", float, "robot.spawn.y"),
    Field("spawn_z", "spawn z m", float, "robot.spawn.z"),
    Field("spawn_yaw", "yaw rad", float, "robot.spawn.yaw"),
    Field("goal_x", "goal x m", float, "goal.x"),
    Field("goal_y", "goal y m", float, "goal.y"),
)
ADVANCED = (
    Field("baseline_runs", "baseline runs", int, "reduction.baseline_runs"),
    Field("n_partitions", "n_partitions", int, "reduction.n_partitions"),
    Field("delta", "delta rad/s", float, "reduction.delta"),
    Field("early_stop", "early stop", bool, "failure.early_stop", (OFF, ON)),
    Field("similarity", "similarity", str, "failure.similarity", ("end-pose", "trajectory")),
    Field("candidates", "candidates", str, "reduction.candidates", ("both", "partitions", "complements")),
    Field("complement_order", "complement order", str, "reduction.complement_order", ("paper", "far-first")),
    Field("growth", "growth", str, "reduction.growth", ("paper", "steady")),
    Field("skip", "skip", str, "reduction.skip", ("known", "implied")),
    Field("prior", "prior", str, "reduction.prior", ("spatial", "uniform")),
)
NAME = Field("name", "run name", str)
ACCEPT = Field("accept", "accept", str, "", ("automatic", "ask"))
ALL = (*BASIC, *PLACES, *ADVANCED, NAME, ACCEPT)


class FieldError(UserError):
    """A field's text is wrong; `field` is its id."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


def value(field: Field, text: str) -> Value:
    """What `text` stands for. Raises FieldError."""
    text = text.strip()
    if field.kind is bool:
        return text == ON
    if not text and field.empty:
        return None
    if not text:
        raise FieldError(field.id, f"{field.label}: is missing")
    try:
        return field.kind(text)
    except ValueError:
        wanted = "a whole number" if field.kind is int else "a number"
        raise FieldError(field.id, f"{field.label}: expected {wanted}, found '{text[:40]}'") from None


def values(fields: tuple[Field, ...], texts: Mapping[str, str]) -> dict[str, Value]:
    """The values of all `fields` by id. Raises FieldError for the first wrong one."""
    return {field.id: value(field, texts.get(field.id, "")) for field in fields}


def jobs(text: str) -> int:
    """At least one test at a time, and no more than a large machine can do. Raises FieldError."""
    number = value(BASIC[-1], text)
    if not 1 <= number <= 256:
        raise FieldError("jobs", f"jobs: expected 1 to 256, found {number}")
    return number


def are_jobs(text: str) -> bool:
    """Whether `text` can stand in the field for jobs."""
    try:
        jobs(text)
    except FieldError:
        return False
    return True


def text_of(value: Value) -> str:
    """How a value is written in a field."""
    if isinstance(value, bool):
        return ON if value else OFF
    if isinstance(value, float):
        short = f"{value:g}"
        return short if float(short) == value else repr(value)
    return "" if value is None else str(value)


def read_key(data: Mapping[str, Any], key: str) -> Any:
    """The value of a scenario's key such as `robot.spawn.x`; None where it is not there."""
    for part in key.split("."):
        data = data.get(part) if isinstance(data, Mapping) else None
    return data


def texts_of(scenario: Scenario) -> dict[str, str]:
    """What a scenario's own settings are, as texts for the fields."""
    data = scenario.model_dump(mode="json")
    return {field.id: text_of(read_key(data, field.key)) for field in ALL if field.key}


def asked_of(base: Scenario, texts: Mapping[str, str], pair: str, algorithm: str) -> Scenario:
    """`base` with what stands in the fields. Raises UserError, a FieldError where a text is no number."""
    from ddenv.world.load import validate

    data = base.model_dump(mode="json")
    fields = tuple(field for field in (*BASIC, *PLACES, *ADVANCED) if field.key)
    asked = values(fields, texts)
    for field in fields:
        section, _, key = field.key.rpartition(".")
        # A field that is left empty, or that this scenario does not know, changes nothing that is not there.
        if asked[field.id] is not None or read_key(data, field.key) is not None:
            read_key(data, section)[key] = asked[field.id]
    data["reduction"] |= {"pair": pair, "algorithm": algorithm}
    return validate(data, "options")


def place(what: str, texts: Mapping[str, str]) -> tuple[float, ...] | None:
    """The numbers of "spawn" (x, y, z m, yaw rad) or "goal" (x, y m); None while any of them is no number."""
    try:
        return tuple(values(tuple(field for field in PLACES if field.id.startswith(what)), texts).values())
    except FieldError:
        return None


def field_of(error: UserError) -> str | None:
    """The field that a complaint about a scenario's key belongs to, if it has one."""
    if isinstance(error, FieldError):
        return error.field
    message = str(error)
    for field in ALL:
        if field.key and f" {field.key}:" in f" {message}":
            return field.id
    if "robot.spawn" in message:
        return "spawn_x"
    return NAME.id if "exists already" in message else None
