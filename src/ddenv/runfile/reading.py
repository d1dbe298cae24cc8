"""Frozen dataclasses as plain data and back: each field is checked against its annotation, and what is wrong is named."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable
from dataclasses import MISSING, dataclass, fields, is_dataclass
from operator import call
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from ddenv.environment import Environment

# No robot comes so far, no test takes so long, and no run counts so far (m, s). Squares of these are still numbers.
LARGEST = 1e15
# The maximum number of digits of an environment: a million models.
DIGITS = 250_000

Data = TypeVar("Data")
Reader = Callable[[Any], Any]

# What reads each dataclass, made once.
_READERS: dict[Any, Reader] = {}


class Invalid(ValueError):
    """A value is not what its field may have; the message says which field, what was expected, and what was found."""


@dataclass(frozen=True, slots=True)
class Range:
    """The allowed numbers of a field, `Annotated` with it."""

    least: float
    most: float = LARGEST

    def __str__(self) -> str:
        return f"{self.least:g} or more" if self.most == LARGEST else f"{self.least:g} to {self.most:g}"


class OneOf:
    """The allowed words of a field, `Annotated` with it."""

    def __init__(self, *words: str) -> None:
        self.words = words


def read(kind: type[Data], data: Any) -> Data:
    """An object of a dataclass from plain data. Raises Invalid."""
    made: Data = _of_dataclass(kind)(data)
    return made


def plain(value: Any) -> Any:
    """An object of a dataclass as plain data for JSON, without fields that have their default."""
    if isinstance(value, Environment):
        return f"{value.bits:x}"
    if is_dataclass(value):
        contents = ((field, getattr(value, field.name)) for field in fields(value))
        return {
            field.name: plain(content)
            for field, content in contents
            if field.default is MISSING or content != field.default
        }
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return value


def number(value: Any) -> float:
    """A number that something in a run can have. Raises Invalid."""
    made: float = _number(float, None)(value)
    return made


def vector(values: Iterable[Any], length: int = 7) -> tuple[float, ...]:
    """So many numbers, 7 as in a pose. Raises Invalid."""
    numbers = tuple(map(number, values))
    if len(numbers) != length:
        raise Invalid(f"expected {length} numbers, found {len(numbers)}")
    return numbers


def _of_dataclass(kind: Any) -> Reader:
    if kind not in _READERS:
        _READERS[kind] = _made(kind)
    return _READERS[kind]


def _made(kind: Any) -> Reader:
    hints = get_type_hints(kind, include_extras=True)
    readers = [(field.name, field.default, _reader(hints[field.name])) for field in fields(kind)]

    def made(data: Any) -> Any:
        if not isinstance(data, dict):
            raise _wrong("an object with fields", data)
        values, used = {}, 0
        for name, default, reader in readers:
            if name in data:
                used += 1
                try:
                    values[name] = reader(data[name])
                except Invalid as invalid:
                    raise Invalid(f"{name}: {invalid}") from None
            elif default is MISSING:
                raise Invalid(f"{name}: is missing")
        if used != len(data):
            unknown = next(name for name in data if name not in dict.fromkeys(name for name, *_ in readers))
            raise Invalid(f"{unknown[:40]!a}: is no field of it")
        return kind(**values)

    return made


def _reader(hint: Any) -> Reader:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        allowed = arguments[1]
        return _choice(allowed.words) if isinstance(allowed, OneOf) else _number(arguments[0], allowed)
    if origin is Literal:
        return _choice(arguments)
    if origin in (Union, types.UnionType):
        inner = _reader(next(argument for argument in arguments if argument is not types.NoneType))
        return lambda value: None if value is None else inner(value)
    if origin is tuple:
        return _tuple(arguments)
    if origin is dict:
        return _dictionary(*arguments)
    if is_dataclass(hint) and hint is not Environment:
        return _of_dataclass(hint)
    return {
        int: _number(int, None),
        float: _number(float, None),
        str: _instance(str, "text"),
        bool: _instance(bool, "true or false"),
        Environment: _models,
    }[hint]


def _number(kind: type, within: Range | None) -> Reader:
    allowed = (int,) if kind is int else (int, float)
    what = f"{'a whole number' if kind is int else 'a number'}{f', {within}' if within else ''}"
    least, most = (within.least, within.most) if within else (-LARGEST, LARGEST)

    def number(value: Any) -> Any:
        # What is no number at all is not within any limits.
        if type(value) not in allowed or not least <= value <= most:
            raise _wrong(what, value)
        return value

    return number


def _choice(choices: tuple[Any, ...]) -> Reader:
    def choice(value: Any) -> Any:
        if value not in choices:
            raise _wrong(f"one of {', '.join(choices)}", value)
        return value

    return choice


def _tuple(arguments: tuple[Any, ...]) -> Reader:
    if arguments[-1] is Ellipsis:
        reader = _reader(arguments[0])

        def items(value: Any) -> Any:
            if type(value) is not list:
                raise _wrong("a list", value)
            return tuple(map(reader, value))

        return items
    readers = [_reader(argument) for argument in arguments]

    def group(value: Any) -> Any:
        if type(value) is not list or len(value) != len(readers):
            raise _wrong(f"a list of {len(readers)}", value)
        # As quick as it can be: tests have hundreds of thousands of pairs.
        return tuple(map(call, readers, value))

    return group


def _dictionary(key: Any, content: Any) -> Reader:
    """JSON has numbers as keys only in quotes."""
    reader: Reader = (lambda item: item) if content is Any else _reader(content)

    def dictionary(value: Any) -> Any:
        if type(value) is not dict:
            raise _wrong("an object", value)
        if key is int and not all(type(name) is str and name.isdecimal() and len(name) < 16 for name in value):
            raise _wrong("an object with numbers as keys", value)
        return {key(name): reader(item) for name, item in value.items()}

    return dictionary


def _instance(kind: type, what: str) -> Reader:
    def instance(value: Any) -> Any:
        if type(value) is not kind:
            raise _wrong(what, value)
        return value

    return instance


def _models(value: Any) -> Environment:
    """The bits of an environment are written in hexadecimal digits."""
    try:
        if type(value) is str and 0 < len(value) <= DIGITS and value.isalnum():
            return Environment(int(value, 16))
    except ValueError:
        pass
    raise _wrong("hexadecimal digits", value)


def _wrong(expected: str, value: Any) -> Invalid:
    found = (
        f"a list of {len(value)}" if type(value) is list else "an object" if type(value) is dict else ascii(value)[:40]
    )
    return Invalid(f"expected {expected}, found {found}")
