"""What `ddenv config` prints: the settings as they are, and an example of the file."""

from __future__ import annotations

from ddenv.workbench.config import config_path, read_config
from ddenv.workbench.keys import Action, actions, written
from ddenv.workbench.themes import DARK, theme_names

# Before the sections of an example.
INTRODUCTION = """# Settings of the ddenv workbench: {path}
# Take away the '# ' in front of a line to change it. '?' and other signs go in quotes.

# {themes}
# theme: {theme}

# The key of each action. Several keys are separated by commas.
keys:"""


def lines() -> list[str]:
    """The file, the theme, and every action with its keys. Raises UserError for a file that is wrong."""
    config, path = read_config(), config_path()
    chosen = config.theme or f"{DARK.name}, or ansi-dark where the terminal has 16 colours"
    told = [
        f"file    {path}{'' if path.exists() else ' (there is none; ddenv config --example prints one)'}",
        f"theme   {chosen}",
        f"themes  {', '.join(theme_names())}",
    ]
    width = max(len(id) for id in actions())
    keys = {id: _written(config.keys.get(id, ",".join(action.keys))) for id, action in actions().items()}
    room = max(len(key) for key in keys.values())
    section = ""
    for id, action in sorted(actions().items(), key=_place):
        if section != _section(action):
            section = _section(action)
            told.append("")
        changed = "*" if id in config.keys else " "
        told.append(f"{changed} {id:<{width}}  {keys[id]:<{room}}  {action.words}")
    return [*told, "", "* is yours"] if config.keys else told


def example_lines() -> list[str]:
    """A file that changes nothing, with every action as a comment."""
    begin = INTRODUCTION.format(path=config_path(), themes=f"One of {', '.join(theme_names())}.", theme=DARK.name)
    told = begin.splitlines()
    section = ""
    for id, action in sorted(actions().items(), key=_place):
        if section != _section(action):
            section = _section(action)
            told.append(f"  # {section}")
        told.append(f"  # {id}: {_quoted(_written(','.join(action.keys)))}  # {action.words}")
    return told


def _written(keys: str) -> str:
    return ", ".join(written(key) for key in keys.split(","))


def _quoted(keys: str) -> str:
    """As YAML takes it for text."""
    return keys if all(char.isalnum() or char in "+, " for char in keys) and keys[0].isalpha() else f'"{keys}"'


def _section(action: Action) -> str:
    return action.id.split(".")[0]


def _place(entry: tuple[str, Action]) -> tuple[int, str]:
    """The app first, then what one sees most."""
    order = ("app", "setup", "run", "map", "runs")
    section = _section(entry[1])
    return (order.index(section) if section in order else len(order), section)
