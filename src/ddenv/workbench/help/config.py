"""The user's own theme, keys and notifications, from a file in the folder for settings; and the lines of `ddenv config`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.workbench.app import Config
from ddenv.workbench.help.catalogue import Action, actions, checked
from ddenv.workbench.help.key_names import written
from ddenv.workbench.terminal.themes import DARK, nearest, theme_called, theme_names

KNOWN = ("theme", "notify", "keys")


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
    data = _load(path) if path.exists() else {}
    if not data:
        if os.environ.get("DDENV_CONFIG") and not path.exists():
            raise UserError(f"{path}: no such file; create it, or unset DDENV_CONFIG")
        return Config()
    for key in data:
        if key not in KNOWN:
            raise UserError(
                f"{path}: '{key}' is not known here{nearest(str(key), KNOWN)}; known are {', '.join(KNOWN)}"
            )
    theme, keys = data.get("theme"), data.get("keys")
    if theme is not None and not isinstance(theme, str):
        raise UserError(f"{path}: theme: expected a name, such as ddenv-light; found {theme!r}")
    notify = data.get("notify", True)
    if not isinstance(notify, bool):
        raise UserError(f"{path}: notify: expected yes or no; found {notify!r}")
    wanted = _wanted(keys, path)
    chosen = theme_called(theme, f"{path}: theme") if theme else ""
    return Config(chosen, checked(wanted, str(path)) if wanted else {}, notify)


def _load(path: Path) -> dict[Any, Any]:
    import yaml

    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read: {getattr(error, 'strerror', '') or 'is not UTF-8 text'}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}: " if mark else ""
        raise UserError(
            f"{path}: {line}is no YAML: {getattr(error, 'problem', None) or 'it cannot be read'}; "
            f"keys such as '?' go in quotes"
        ) from None
    except RecursionError:
        raise UserError(f"{path}: is nested too deeply") from None
    except ValueError as error:
        # An invalid date.
        raise UserError(f"{path}: is no YAML: {error}; put it in quotes") from None
    if data is not None and not isinstance(data, dict):
        raise UserError(f"{path}: expected lines such as 'theme: ddenv-light'; 'ddenv config --example' prints some")
    return data or {}


def _wanted(keys: Any, path: Path) -> dict[str, str]:
    """The section `keys`, as text."""
    if keys is None:
        return {}
    if not isinstance(keys, dict):
        raise UserError(f"{path}: keys: expected lines such as 'run.pause: p'; found {keys!r}")
    for id, value in keys.items():
        # A digit is a number in YAML, and a key here.
        if not isinstance(value, str) and (isinstance(value, bool) or not isinstance(value, int)):
            raise UserError(
                f"{path}: keys: {id}: expected a key such as p, in quotes if it is punctuation; found {value!r}"
            )
    return {str(id): str(value) for id, value in keys.items()}


# The head of the example.
INTRODUCTION = """# Settings of the ddenv workbench: {path}
# Remove the '# ' in front of a line to change it. '?' and other punctuation needs quotes.

# {themes}
# theme: {theme}

# Whether the terminal rings and shows a notification when a run ends, or waits for you.
# notify: yes

# The key of each action. Several keys are separated by commas.
keys:"""


def lines() -> list[str]:
    """The file, the theme, whether the terminal rings, and every action with its keys. Raises UserError for an invalid file."""
    config, path = read_config(), config_path()
    chosen = config.theme or f"{DARK.name}, or ansi-dark where the terminal has 16 colours"
    found = [
        f"file    {path}{'' if path.exists() else ' (does not exist; ddenv config --example prints one)'}",
        f"theme   {chosen}",
        f"themes  {', '.join(theme_names())}",
        f"notify  {'yes' if config.notify else 'no'}",
    ]
    width = max(len(id) for id in actions())
    keys = {id: _written(config.keys.get(id, ",".join(action.keys))) for id, action in actions().items()}
    room = max(len(key) for key in keys.values())
    section = ""
    for id, action in sorted(actions().items(), key=_place):
        if section != _section(action):
            section = _section(action)
            found.append("")
        changed = "*" if id in config.keys else " "
        found.append(f"{changed} {id:<{width}}  {keys[id]:<{room}}  {action.words}")
    return [*found, "", "* is your own key"] if config.keys else found


def example_lines() -> list[str]:
    """An example file that changes nothing: every action is a comment."""
    begin = INTRODUCTION.format(path=config_path(), themes=f"One of {', '.join(theme_names())}.", theme=DARK.name)
    found = begin.splitlines()
    section = ""
    for id, action in sorted(actions().items(), key=_place):
        if section != _section(action):
            section = _section(action)
            found.append(f"  # {section}")
        found.append(f"  # {id}: {_quoted(_written(','.join(action.keys)))}  # {action.words}")
    return found


def _written(keys: str) -> str:
    return ", ".join(written(key) for key in keys.split(","))


def _quoted(keys: str) -> str:
    """As YAML reads it as text."""
    return keys if all(char.isalnum() or char in "+, " for char in keys) and keys[0].isalpha() else f'"{keys}"'


def _section(action: Action) -> str:
    return action.id.split(".")[0]


def _place(entry: tuple[str, Action]) -> tuple[int, str]:
    """The app first, then the screens that are used most."""
    order = ("app", "setup", "run", "map", "runs")
    section = _section(entry[1])
    return (order.index(section) if section in order else len(order), section)
