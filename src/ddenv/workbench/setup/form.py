"""The fields of the setup screen, each a setting: turns texts into values, with errors that name
the field. Pure.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ddenv.errors import UserError
from ddenv.settings import FARTHEST, JOBS, OPTIONS, SETTINGS, TURNS, Setting, Value, read
from ddenv.text import Names

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

ON = "on"
OFF = "off"
# Longer numbers are shown rounded, in characters.
LONGEST_NUMBER = 10


def _place(
    name: str, meaning: str, unit: str = "m", most: float = FARTHEST, more: str = ""
) -> Setting:
    return Setting(
        default=None,
        meaning=meaning,
        unit=unit,
        least=-most,
        most=most,
        more=more,
        name=name,
        kind=float,
    )


BASIC = (*(one for one in OPTIONS if one.shown == "basic"), JOBS)
SPAWN = (
    _place("spawn_x", "where the robot starts"),
    _place("spawn_y", "where the robot starts"),
    _place(
        "spawn_z",
        "height of the robot's frame at the start",
        more="A place picked on the map fills it in.",
    ),
    _place("yaw", "heading at the start, counterclockwise from x", "rad", TURNS),
)
GOAL = (
    _place("goal_x", "where the robot has to go"),
    _place("goal_y", "where the robot has to go"),
)
PLACES = (*SPAWN, *GOAL)
ADVANCED = tuple(one for one in OPTIONS if one.shown == "more")
NAMED = "the name of the run: a file in the runs folder, or a path that ends in .ddenv"
NAME = Setting(default=None, meaning=NAMED, name="run_name")
ACCEPTED = (
    "whether each reduction is accepted at once (automatic), or waits for you to accept or "
    "reject it (ask)"
)
ACCEPT = Setting(default=None, meaning=ACCEPTED, name="accept", choices=("automatic", "ask"))
FIELDS = {one.name: one for one in (*BASIC, *PLACES, *ADVANCED, NAME, ACCEPT)}


class FieldError(UserError):
    """Texts of fields are wrong: `wrong` says why, by the names of the fields."""

    def __init__(self, wrong: Mapping[str, str]) -> None:
        super().__init__(in_words(wrong))
        self.wrong = dict(wrong)


def in_words(wrong: Mapping[str, str]) -> str:
    """Why fields are wrong, in one line. Those that are wrong for the same reason are named
    together.
    """
    labels: dict[str, list[str]] = {}
    for name, why in wrong.items():
        labels.setdefault(why, []).append(FIELDS[name].label)
    return "; ".join(f"{', '.join(fields)}: {why}" for why, fields in labels.items())


def choices(one: Setting) -> Names:
    if one.kind is bool:
        return (OFF, ON)
    return one.choices


def value(one: Setting, text: str) -> Value:
    """The value of `text`. Raises FieldError."""
    text = text.strip()
    if one.kind is bool:
        return text == ON
    if one.none and text in ("", one.none):
        return None
    if not text:
        wanted = f"type {one.range or 'one'}"
        if one in PLACES:
            wanted = f"press {'s for the start' if one in SPAWN else 'g for the goal'}, on the map"
        raise FieldError({one.name: f"missing; {wanted}"})
    try:
        found: Value = one.kind(text)
    except ValueError:
        wanted = "a whole number" if one.kind is int else "a number"
        raise FieldError({one.name: f"expected {wanted}, found '{text[:40]}'"}) from None
    if one.range and not one.allows(found):
        raise FieldError({one.name: f"expected {one.range}, found {text[:40]}"})
    return found


def problem(one: Setting, text: str) -> str:
    """Why the text is wrong, or ""."""
    try:
        value(one, text)
    except FieldError as error:
        return error.wrong[one.name]
    return ""


def values(fields: tuple[Setting, ...], texts: Mapping[str, str]) -> dict[str, Value]:
    """The values of the texts, by the names of the fields. Raises FieldError, which names all that
    are wrong.
    """
    if wrong := {one.name: why for one in fields if (why := problem(one, texts.get(one.name, "")))}:
        raise FieldError(wrong)
    return {one.name: value(one, texts.get(one.name, "")) for one in fields}


def text_of(value: Value) -> str:
    if isinstance(value, bool):
        if value:
            return ON
        return OFF
    if isinstance(value, float):
        short = f"{value:g}"
        if float(short) == value:
            return short
        return repr(value)
    if value is None:
        return ""
    return str(value)


def places_of(scenario: Scenario) -> dict[str, float]:
    spawn = scenario.robot.spawn
    goal = scenario.goal
    numbers = (spawn.x, spawn.y, spawn.z, spawn.yaw, goal.x, goal.y)
    return {one.name: number for one, number in zip(PLACES, numbers, strict=True)}


def texts_of(scenario: Scenario) -> dict[str, str]:
    """Long numbers are rounded: two thirds are 0.667, which `asked_of` takes for unchanged."""
    data = scenario.model_dump(mode="json")
    texts = {}
    for one in FIELDS.values():
        if one.key:
            value = read(data, one)
            text = text_of(value)
            texts[one.name] = (
                f"{value:.3g}" if isinstance(value, float) and len(text) > LONGEST_NUMBER else text
            )
    return texts | {name: text_of(number) for name, number in places_of(scenario).items()}


def asked_of(base: Scenario, texts: Mapping[str, str], pair: str, algorithm: str) -> Scenario:
    """`base` with the values of the fields. Raises UserError, or FieldError if a text is not a
    number.
    """
    from ddenv.runs.experiment import with_values
    from ddenv.world.load import validate

    data = base.model_dump(mode="json")
    before = texts_of(base)
    given = values(tuple(FIELDS[name] for name in before), texts)
    # What is unchanged is not asked for: one field may set what others show, and a long number is
    # shown rounded.
    known = {
        name: one
        for name, one in SETTINGS.items()
        if name in given and texts.get(name) != before[name]
    }
    chosen = {name: given[name] for name, one in known.items() if given[name] != read(data, one)}
    data = with_values(data, chosen | {"pair": pair, "algorithm": algorithm})
    for fields, place in ((SPAWN, data["robot"]["spawn"]), (GOAL, data["goal"])):
        place |= {one.name.rpartition("_")[2]: given[one.name] for one in fields}
    return validate(data, "options")


def numbers(fields: tuple[Setting, ...], texts: Mapping[str, str]) -> tuple[float, ...] | None:
    """The numbers of `SPAWN` or `GOAL`; None while one of them is wrong or missing."""
    try:
        return tuple(
            float(number) for number in values(fields, texts).values() if number is not None
        )
    except FieldError:
        return None
