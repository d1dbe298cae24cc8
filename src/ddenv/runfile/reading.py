"""Dataclasses as plain data and back: what a file says is checked against each field's annotation,
and what is wrong is named.
"""

from __future__ import annotations

import reprlib
from functools import cache
from typing import Annotated, Any

from annotated_types import Interval

from ddenv.environment import Environment

# No robot comes so far, no test takes so long, and no run counts so far (m, s). Squares of these
# are still numbers.
LARGEST = 1e15
# The maximum number of digits of an environment: a million models.
DIGITS = 250_000

Natural = Annotated[int, Interval(ge=0, le=LARGEST)]
Number = Annotated[int, Interval(ge=1, le=LARGEST)]
Real = Annotated[float, Interval(ge=-LARGEST, le=LARGEST)]
Seconds = Annotated[float, Interval(ge=0, le=LARGEST)]
Share = Annotated[float, Interval(ge=0, le=1)]
Positive = Annotated[float, Interval(ge=1e-12, le=LARGEST)]
Part = Annotated[float, Interval(ge=1e-9, le=1)]
Pose = tuple[Real, Real, Real, Real, Real, Real, Real]


class Invalid(ValueError):
    """A value is not what its field may have; the message says which field, what it should be, and
    what was found.
    """


class OneOf:
    """The allowed words of a field, `Annotated` with it."""

    def __init__(self, *words: str) -> None:
        self.words = words

    def __get_pydantic_core_schema__(self, *_: Any) -> Any:
        from pydantic_core import core_schema

        return core_schema.literal_schema(list(self.words))


class Digits:
    """An environment `Annotated` with it is hexadecimal digits in a file."""

    @staticmethod
    def __get_pydantic_core_schema__(*_: Any) -> Any:
        from pydantic_core import core_schema

        written = core_schema.plain_serializer_function_ser_schema(
            lambda environment: f"{environment.bits:x}"
        )
        return core_schema.no_info_plain_validator_function(_environment, serialization=written)


Models = Annotated[Environment, Digits]


def _environment(value: Any) -> Environment:
    if type(value) is str and 0 < len(value) <= DIGITS and value.isascii() and value.isalnum():
        return Environment(int(value, 16))
    raise ValueError


def read(kind: Any, text: str) -> Any:
    """An object of a dataclass, or of another type, from JSON. Raises Invalid."""
    from pydantic import ValidationError

    try:
        return _adapter(kind).validate_json(f"[{text}]")[0]
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    where = "".join(
        f"{part if str(part).isidentifier() else ascii(part)[:40]}: " for part in first["loc"][1:]
    )
    found = f"{first['msg'].removeprefix('Input ')}, found {reprlib.repr(first['input'])}"
    raise Invalid(f"{where}{_PLAINLY.get(first['type'], found)}")


_PLAINLY = {
    "missing": "is missing",
    "unexpected_keyword_argument": "is not one of its fields",
    "value_error": "should be hexadecimal digits",
}


def plain(value: Any) -> Any:
    """An object of a dataclass as plain data for JSON, without fields that have their default."""
    kind: Any = type(value)
    return _adapter(kind).dump_python((value,), mode="json", exclude_defaults=True)[0]


@cache
def _adapter(kind: Any) -> Any:
    # Loading this takes a fifth of a second, which the first picture of a run does not wait for.
    from pydantic import ConfigDict, TypeAdapter

    return TypeAdapter(tuple[kind], config=ConfigDict(strict=True, extra="forbid"))
