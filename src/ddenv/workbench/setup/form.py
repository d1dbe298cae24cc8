"""The fields of the setup screen: turns texts into values, with errors that name the field. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.settings import FARTHEST, JOBS, OPTIONS, SETTINGS, TURNS, Setting, Shown, Value, number_text, read

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

ON, OFF = "on", "off"
# Longer numbers are shown rounded, in characters.
LONGEST_NUMBER = 10


@dataclass(frozen=True, slots=True)
class Field:
    """`id` is the field's name on the screen, `label` the text before it, `kind` int, float, str or bool.

    `key` is the scenario's key for it, "" if a scenario has none. `choices` are the allowed words, if there are few. A field
    with `empty` may be empty, and then shows it; the word can be typed, too. `meaning` is a sentence. `setting` is the field's
    setting, if any. Without one, a number is at most `most` from 0.
    """

    id: str
    label: str
    kind: type
    key: str = ""
    choices: tuple[str, ...] = ()
    empty: str = ""
    meaning: str = ""
    setting: Setting | None = None
    most: float = FARTHEST


def _field(one: Setting) -> Field:
    meaning = f"{one.summary[:1].upper()}{one.summary[1:]}. {one.more}".strip()
    choices = (OFF, ON) if one.kind is bool else one.choices
    return Field(one.name, one.label, one.kind, one.key, choices, one.none, meaning, one)


def _shown(where: Shown) -> tuple[Field, ...]:
    return tuple(_field(one) for one in OPTIONS if one.shown == where)


JOBS_FIELD = _field(JOBS)
BASIC = (*_shown("basic"), JOBS_FIELD)
START, TARGET = "Where the robot starts, m.", "Where the robot has to go, m."
HEIGHT = "Height of the robot's frame at the start, m. A place picked on the map fills it in."
HEADING = "Heading at the start, rad, counterclockwise from x."
SPAWN = (
    Field("spawn_x", "spawn x m", float, "robot.spawn.x", meaning=START),
    Field("spawn_y", "spawn y m", float, "robot.spawn.y", meaning=START),
    Field("spawn_z", "spawn z m", float, "robot.spawn.z", meaning=HEIGHT),
    Field("spawn_yaw", "yaw rad", float, "robot.spawn.yaw", meaning=HEADING, most=TURNS),
)
GOAL = (
    Field("goal_x", "goal x m", float, "goal.x", meaning=TARGET),
    Field("goal_y", "goal y m", float, "goal.y", meaning=TARGET),
)
PLACES = (*SPAWN, *GOAL)
ADVANCED = _shown("more")
NAMED = "The name of the run: a file in the runs folder, or a path that ends in .ddenv."
NAME = Field("name", "run name", str, meaning=NAMED)
ACCEPTED = "Whether each reduction is accepted at once (automatic), or waits for you to accept or reject it (ask)."
ACCEPT = Field("accept", "accept", str, choices=("automatic", "ask"), meaning=ACCEPTED)
ALL = (*BASIC, *PLACES, *ADVANCED, NAME, ACCEPT)
FIELDS = {field.id: field for field in ALL}


class FieldError(UserError):
    """Texts of fields are wrong: `wrong` says why, by the ids of the fields."""

    def __init__(self, wrong: Mapping[str, str]) -> None:
        super().__init__(in_words(wrong))
        self.wrong = dict(wrong)


def in_words(wrong: Mapping[str, str]) -> str:
    """Why fields are wrong, in one line. Those that are wrong for the same reason are named together."""
    labels: dict[str, list[str]] = {}
    for id, why in wrong.items():
        labels.setdefault(why, []).append(FIELDS[id].label)
    return "; ".join(f"{', '.join(fields)}: {why}" for why, fields in labels.items())


def value(field: Field, text: str) -> Value:
    """The value of `text`. Raises FieldError."""
    text = text.strip()
    if field.kind is bool:
        return text == ON
    if field.empty and text in ("", field.empty):
        return None
    if not text:
        raise FieldError({field.id: f"missing; {_wanted(field)}"})
    try:
        found = str(text) if field.kind is str else int(text) if field.kind is int else float(text)
    except ValueError:
        wanted = "a whole number" if field.kind is int else "a number"
        raise FieldError({field.id: f"expected {wanted}, found '{text[:40]}'"}) from None
    if allowed := _out_of_range(field, found):
        raise FieldError({field.id: f"expected {allowed}, found {text[:40]}"})
    return found


def _wanted(field: Field) -> str:
    """What an empty field asks for."""
    if field in PLACES:
        return f"press {'s for the start' if field in SPAWN else 'g for the goal'}, on the map"
    return f"type {field.setting.range}" if field.setting is not None and field.setting.range else "type one"


def _out_of_range(field: Field, found: Value) -> str:
    if field.setting is not None:
        return "" if field.setting.allows(found) or isinstance(found, str) else field.setting.range
    if isinstance(found, float) and not abs(found) <= field.most:
        return f"{number_text(-field.most)} to {number_text(field.most)}"
    return ""


def problem(field: Field, text: str) -> str:
    """Why the text is wrong, or ""."""
    try:
        value(field, text)
    except FieldError as error:
        return error.wrong[field.id]
    return ""


def values(fields: tuple[Field, ...], texts: Mapping[str, str]) -> dict[str, Value]:
    """The values of the texts, by the ids of the fields. Raises FieldError, which names all that are wrong."""
    if wrong := {field.id: why for field in fields if (why := problem(field, texts.get(field.id, "")))}:
        raise FieldError(wrong)
    return {field.id: value(field, texts.get(field.id, "")) for field in fields}


def jobs(text: str) -> int:
    number = value(JOBS_FIELD, text)
    assert isinstance(number, int)
    return number


def text_of(value: Value) -> str:
    if isinstance(value, bool):
        return ON if value else OFF
    if isinstance(value, float):
        short = f"{value:g}"
        return short if float(short) == value else repr(value)
    return "" if value is None else str(value)


def read_key(data: Mapping[str, Any], key: str) -> Any:
    """The value of a scenario's key such as `robot.spawn.x`; None if missing."""
    found: Any = data
    for part in key.split("."):
        found = found.get(part) if isinstance(found, Mapping) else None
    return found


def texts_of(scenario: Scenario) -> dict[str, str]:
    data = scenario.model_dump(mode="json")
    values = {field.id: _short(read(data, field.setting)) for field in ALL if field.key and field.setting}
    places = {field.id: text_of(read_key(data, field.key)) for field in PLACES}
    return values | places


def _short(value: Value) -> str:
    """A setting's value for people: two thirds are 0.667, which `asked_of` takes for unchanged."""
    text = text_of(value)
    return f"{value:.3g}" if isinstance(value, float) and len(text) > LONGEST_NUMBER else text


def asked_of(base: Scenario, texts: Mapping[str, str], pair: str, algorithm: str) -> Scenario:
    """`base` with the values of the fields. Raises UserError, or FieldError if a text is not a number."""
    from ddenv.runs.subject import with_values
    from ddenv.world.load import validate

    data = base.model_dump(mode="json")
    given, before = values(tuple(field for field in ALL if field.key), texts), texts_of(base)
    # What is unchanged is not asked for: one field may set what others show, and a long number is shown rounded.
    known = {name: one for name, one in SETTINGS.items() if name in given and texts.get(name) != before[name]}
    chosen = {name: given[name] for name, one in known.items() if given[name] != read(data, one)}
    data = with_values(data, chosen | {"pair": pair, "algorithm": algorithm})
    for field in PLACES:
        section, _, key = field.key.rpartition(".")
        read_key(data, section)[key] = given[field.id]
    return validate(data, "options")


def numbers(fields: tuple[Field, ...], texts: Mapping[str, str]) -> tuple[float, ...] | None:
    """The numbers of `SPAWN` or `GOAL`; None while one of them is wrong or missing."""
    try:
        return tuple(float(number) for number in values(fields, texts).values() if number is not None)
    except FieldError:
        return None
