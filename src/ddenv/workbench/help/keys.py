"""Every action that a key stands for, and the keys that a user wants for them instead."""

from __future__ import annotations

import string
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import walk_packages

from textual.binding import Binding
from textual.dom import DOMNode
from textual.keys import Keys, _character_to_key
from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.workbench.terminal.themes import nearest

_MODIFIERS = ("ctrl", "shift", "alt", "meta", "super", "hyper")
_NAMED = {key.value for key in Keys}
# The names of signs that are on every keyboard, such as question_mark.
_SIGNS = {_character_to_key(sign): sign for sign in string.punctuation}
_ARROWS = {"up": "↑", "down": "↓", "left": "←", "right": "→"}
# Terminals send the same for these: (key, what it is).
_SAME = {"ctrl+i": "tab", "ctrl+m": "enter", "ctrl+h": "backspace", "ctrl+left_square_bracket": "escape"}


@dataclass(frozen=True, slots=True)
class Action:
    """What `keys` (as Textual names them) do; `owner` is the name of the screen or widget that has them."""

    id: str
    keys: tuple[str, ...]
    words: str
    owner: str


@cache
def actions() -> dict[str, Action]:
    """All actions by their ids, in the order of their screens."""
    found: dict[str, Action] = {}
    for owner in _owners():
        for binding in _bindings(owner):
            if binding.id and binding.id not in found:
                words = binding.tooltip or binding.description
                found[binding.id] = Action(binding.id, _keys_of(owner, binding.id), words, owner.__name__)
    return found


def checked(wanted: Mapping[str, str], where: str) -> dict[str, str]:
    """The keymap for Textual that gives the actions these keys. Raises UserError, which begins with `where`."""
    keymap = {id: _normal(id, keys, where) for id, keys in wanted.items()}
    known = actions()
    for id in keymap:
        if id not in known:
            raise UserError(f"{where}: keys: there is no action '{id}'{nearest(id, known)}; 'ddenv config' lists them")
    for owner in _owners():
        _check_clashes(owner, keymap, where)
    return keymap


def shown(keys: str) -> str:
    """Keys as a screen shows them: `question_mark,up` as `? ↑`."""
    return " ".join(shown_key(key) for key in keys.split(","))


def shown_key(key: str) -> str:
    """One key as a screen shows it."""
    *modifiers, name = key.split("+")
    return "+".join((*modifiers, _ARROWS[name])) if name in _ARROWS else written(key)


def written(key: str) -> str:
    """One key as it is written in the file: a character as itself, others by name."""
    *modifiers, name = key.split("+")
    if not modifiers and len(name) == 1 and name.isupper():
        return f"shift+{name.lower()}"
    return "+".join((*modifiers, _SIGNS.get(name, name)))


def _check_clashes(owner: type[DOMNode], keymap: Mapping[str, str], where: str) -> None:
    """No two actions of one screen may be on one key, if one of them was put there by the user."""
    from ddenv.workbench.app import Workbench

    holders: dict[str, str] = {}
    everywhere = _bindings(Workbench) if issubclass(owner, Screen) else ()
    for id in dict.fromkeys(binding.id for binding in (*_bindings(owner), *everywhere) if binding.id):
        usual = actions()[id].keys
        for key in keymap[id].split(",") if id in keymap else usual:
            other = holders.setdefault(key, id)
            moved = [each for each in (other, id) if key not in actions()[each].keys]
            if other != id and moved:
                raise UserError(
                    f"{where}: keys: {moved[0]}: '{shown_key(key)}' is the key of "
                    f"{id if moved[0] == other else other} already; give one of the two another key"
                )


def _normal(id: str, keys: str, where: str) -> str:
    names = [keys] if keys == "," else [key.strip() for key in keys.split(",")]
    return ",".join(_normal_key(id, key, where) for key in names)


def _normal_key(id: str, key: str, where: str) -> str:
    # The plus sign itself may stand after the last plus sign.
    *modifiers, name = f"{key[:-1]}plus".split("+") if key.endswith("+") else key.split("+")
    modifiers = [modifier.lower() for modifier in modifiers]
    if len(name) == 1:
        if modifiers == ["shift"] and name.isalpha():
            return name.upper()
        name = _character_to_key(name)
    elif name.lower() in _NAMED or name.lower() in _SIGNS:
        name = name.lower()
    else:
        name = ""
    if not name or not set(modifiers) <= set(_MODIFIERS):
        raise UserError(
            f"{where}: keys: {id}: there is no key '{key}'; write a character, or a name such as "
            f"space, enter, f2, ctrl+s or shift+left"
        )
    normal = "+".join((*sorted(modifiers, key=_MODIFIERS.index), name))
    if normal in _SAME:
        raise UserError(
            f"{where}: keys: {id}: terminals send the same for {normal} and {_SAME[normal]}; use another key"
        )
    return normal


def _keys_of(owner: type[DOMNode], id: str) -> tuple[str, ...]:
    bindings = (binding for binding in _bindings(owner) if binding.id == id)
    return tuple(dict.fromkeys(single.key for binding in bindings for single in Binding.make_bindings([binding])))


@cache
def _owners() -> tuple[type[DOMNode], ...]:
    """The app, and all screens and widgets of ours that have keys."""
    from ddenv.workbench.app import Workbench

    home = import_module("ddenv.workbench")
    names = [module.name for module in walk_packages(home.__path__, f"{home.__name__}.") if not module.ispkg]
    classes = (value for name in names for value in vars(import_module(name)).values())
    ours = (value for value in classes if isinstance(value, type) and value.__module__ in names)
    with_keys = (each for each in ours if issubclass(each, DOMNode) and "BINDINGS" in vars(each))
    return tuple(dict.fromkeys((Workbench, *with_keys)))


def _bindings(owner: type[DOMNode]) -> Iterator[Binding]:
    """The owner's own bindings, and those of the classes of ours that it is made of."""
    for each in owner.__mro__:
        if each.__module__.startswith("ddenv."):
            yield from (binding for binding in vars(each).get("BINDINGS", ()) if isinstance(binding, Binding))
