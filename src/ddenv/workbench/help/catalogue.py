"""The catalogue of actions: every action that has a key, in the app and on all of its screens."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import walk_packages

from textual.binding import Binding
from textual.dom import DOMNode
from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.workbench.app import Workbench
from ddenv.workbench.help.key_names import shown_key, textual_keys
from ddenv.workbench.terminal.themes import nearest


@dataclass(frozen=True, slots=True)
class Action:
    """An action with its `keys` (Textual's names); `owner` is the name of its screen or widget."""

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
    """Textual's keymap with these keys for the actions. Raises UserError with a message that begins with `where`."""
    keymap = {id: textual_keys(keys, f"{where}: keys: {id}") for id, keys in wanted.items()}
    known = actions()
    for id in keymap:
        if id not in known:
            raise UserError(f"{where}: keys: there is no action '{id}'{nearest(id, known)}; 'ddenv config' lists them")
    for owner in _owners():
        _check_clashes(owner, keymap, where)
    return keymap


def _check_clashes(owner: type[DOMNode], keymap: Mapping[str, str], where: str) -> None:
    """Raises UserError if a key of the user's belongs to two actions of one screen."""
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


def _keys_of(owner: type[DOMNode], id: str) -> tuple[str, ...]:
    bindings = (binding for binding in _bindings(owner) if binding.id == id)
    return tuple(dict.fromkeys(single.key for binding in bindings for single in Binding.make_bindings([binding])))


@cache
def _owners() -> tuple[type[DOMNode], ...]:
    """The app, and all screens and widgets with keys."""
    home = import_module("ddenv.workbench")
    names = [module.name for module in walk_packages(home.__path__, f"{home.__name__}.") if not module.ispkg]
    classes = (value for name in names for value in vars(import_module(name)).values())
    ours = (value for value in classes if isinstance(value, type) and value.__module__ in names)
    with_keys = (each for each in ours if issubclass(each, DOMNode) and "BINDINGS" in vars(each))
    return tuple(dict.fromkeys((Workbench, *with_keys)))


def _bindings(owner: type[DOMNode]) -> Iterator[Binding]:
    """The owner's own bindings, and those of its base classes in ddenv."""
    for each in owner.__mro__:
        if each.__module__.startswith("ddenv."):
            yield from (binding for binding in vars(each).get("BINDINGS", ()) if isinstance(binding, Binding))
