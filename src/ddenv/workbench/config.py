"""The user's own theme, keys and notifications, from a file; all actions that have keys; the lines
of `ddenv config`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

from textual.binding import Binding
from textual.dom import DOMNode
from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.workbench.app import Config, Workbench
from ddenv.workbench.help.key_names import shown_key, textual_keys, written
from ddenv.workbench.terminal.themes import DARK, theme_called, theme_names

# The head of the example.
INTRODUCTION = """# Settings of the ddenv workbench: {path}
# Remove the '# ' in front of a line to change it. '?' and other punctuation needs quotes.

# {themes}
# theme: {theme}

# Whether the terminal rings and shows a notification when a run ends, or waits for you.
# notify: yes

# The key of each action. Several keys are separated by commas.
keys:"""


@dataclass(frozen=True, slots=True)
class Action:
    """An action with its `keys` (Textual's names)."""

    id: str
    keys: tuple[str, ...]
    words: str


@cache
def actions() -> dict[str, Action]:
    """All actions by their ids, in the order of their screens."""
    found: dict[str, Action] = {}
    for owner in _owners():
        bindings = [binding for binding in _bindings(owner) if binding.id]
        for id in dict.fromkeys(binding.id or "" for binding in bindings):
            own = [binding for binding in bindings if binding.id == id]
            keys = dict.fromkeys(single.key for single in Binding.make_bindings(own))
            found.setdefault(id, Action(id, tuple(keys), own[0].tooltip or own[0].description))
    return found


def checked(wanted: Mapping[str, str], where: str) -> dict[str, str]:
    """Textual's keymap with these keys for the actions. Raises UserError with a message that begins
    with `where`.
    """
    keymap = {id: textual_keys(keys, f"{where}: keys: {id}") for id, keys in wanted.items()}
    known = actions()
    for id in keymap:
        if id not in known:
            raise UserError(
                f"{where}: keys: there is no action '{id}'{nearest(id, known)}; 'ddenv config' "
                "lists them"
            )
    for owner in _owners():
        _check_clashes(owner, keymap, where)
    return keymap


def _check_clashes(owner: type[DOMNode], keymap: Mapping[str, str], where: str) -> None:
    """Raises UserError if a key of the user's belongs to two actions of one screen."""
    holders: dict[str, str] = {}
    everywhere = _bindings(Workbench) if issubclass(owner, Screen) else ()
    for id in dict.fromkeys(
        binding.id for binding in (*_bindings(owner), *everywhere) if binding.id
    ):
        usual = actions()[id].keys
        for key in keymap[id].split(",") if id in keymap else usual:
            other = holders.setdefault(key, id)
            moved = [each for each in (other, id) if key not in actions()[each].keys]
            if other != id and moved:
                raise UserError(
                    f"{where}: keys: {moved[0]}: '{shown_key(key)}' is the key of "
                    f"{id if moved[0] == other else other} already; give one of the two another key"
                )


@cache
def _owners() -> tuple[type[DOMNode], ...]:
    home = import_module("ddenv.workbench")
    names = [
        module.name
        for module in walk_packages(home.__path__, f"{home.__name__}.")
        if not module.ispkg
    ]
    classes = (value for name in names for value in vars(import_module(name)).values())
    ours = (value for value in classes if isinstance(value, type) and value.__module__ in names)
    with_keys = (each for each in ours if issubclass(each, DOMNode) and "BINDINGS" in vars(each))
    return tuple(dict.fromkeys((Workbench, *with_keys)))


def _bindings(owner: type[DOMNode]) -> Iterator[Binding]:
    """The owner's own bindings, and those of its base classes in ddenv."""
    for each in owner.__mro__:
        if each.__module__.startswith("ddenv."):
            yield from (
                binding
                for binding in vars(each).get("BINDINGS", ())
                if isinstance(binding, Binding)
            )


def config_path() -> Path:
    """The path of the file: `$DDENV_CONFIG`, or `config.yaml` in the user's folder for settings."""
    named = os.environ.get("DDENV_CONFIG")
    if named:
        return Path(named)
    import platformdirs

    return Path(platformdirs.user_config_dir("ddenv", appauthor=False)) / "config.yaml"


def read_config() -> Config:
    """Reads the file if it exists. Raises UserError with the place of the error."""
    path = config_path()
    if not path.exists():
        if os.environ.get("DDENV_CONFIG"):
            raise UserError(f"{path}: no such file; create it, or unset DDENV_CONFIG")
        return Config()
    from pydantic import BaseModel, ConfigDict, StrictBool, ValidationError

    from ddenv.world.load import complaint, read_yaml

    class File(BaseModel):
        # A digit is a number in YAML, and a key here.
        model_config = ConfigDict(extra="forbid", coerce_numbers_to_str=True)
        theme: str | None = None
        notify: StrictBool = True
        keys: dict[str, str] | None = None

    data = read_yaml(path) or {}
    if not isinstance(data, dict):
        raise UserError(
            f"{path}: expected lines such as 'theme: {DARK.name}'; 'ddenv config --example' "
            "prints some"
        )
    try:
        found = File.model_validate(data)
    except ValidationError as error:
        key, words = complaint(error.errors()[0], File)
        raise UserError(f"{path}: {key}: {words}") from None
    theme = theme_called(found.theme, f"{path}: theme") if found.theme else ""
    return Config(theme, checked(found.keys, str(path)) if found.keys else {}, found.notify)


def lines() -> list[str]:
    """The file, the theme, whether the terminal rings, and every action with its keys. Raises
    UserError for an invalid file.
    """
    config = read_config()
    path = config_path()
    note = "" if path.exists() else " (does not exist; ddenv config --example prints one)"
    found = [
        f"file    {path}{note}",
        f"theme   {config.theme or f'{DARK.name}, or ansi-dark where the terminal has 16 colours'}",
        f"themes  {', '.join(theme_names())}",
        f"notify  {'yes' if config.notify else 'no'}",
        "",
    ]
    keys = {
        id: _written(config.keys.get(id, ",".join(action.keys))) for id, action in actions().items()
    }
    width, room = (max(map(len, words)) for words in (keys, keys.values()))
    for id, action in actions().items():
        found.append(
            f"{'*' if id in config.keys else ' '} {id:<{width}}  {keys[id]:<{room}}  {action.words}"
        )
    if config.keys:
        return [*found, "", "* marks your own keys"]
    return found


def example_lines() -> list[str]:
    """An example file that changes nothing: every action is a comment."""
    begin = INTRODUCTION.format(
        path=config_path(), themes=f"One of {', '.join(theme_names())}.", theme=DARK.name
    )
    keys = {id: _quoted(_written(",".join(action.keys))) for id, action in actions().items()}
    return [
        *begin.splitlines(),
        *(f"  # {id}: {keys[id]}  # {action.words}" for id, action in actions().items()),
    ]


def _written(keys: str) -> str:
    return ", ".join(written(key) for key in keys.split(","))


def _quoted(keys: str) -> str:
    if all(char.isalnum() or char in "+, " for char in keys) and keys[0].isalpha():
        return keys
    return f'"{keys}"'
