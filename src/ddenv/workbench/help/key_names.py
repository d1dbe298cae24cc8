"""The names of keys: as a screen shows them, as the settings file writes them, and as Textual knows
them.
"""

from __future__ import annotations

import string

from textual.binding import Binding
from textual.keys import Keys

from ddenv.errors import UserError


def _named(character: str) -> str:
    """Textual's name of a character, such as question_mark."""
    return next(iter(Binding.make_bindings([Binding(character, "")]))).key


_MODIFIERS = ("ctrl", "shift", "alt", "meta", "super", "hyper")
_NAMED = {key.value for key in Keys}
# Punctuation of every keyboard, by names such as question_mark.
_SIGNS = {_named(sign): sign for sign in string.punctuation if sign != ","} | {"comma": ","}
_ARROWS = {"up": "↑", "down": "↓", "left": "←", "right": "→"}
# Terminals send the same code for both keys of a pair.
_SAME = {
    "ctrl+i": "tab",
    "ctrl+m": "enter",
    "ctrl+h": "backspace",
    "ctrl+left_square_bracket": "escape",
}


def shown(keys: str) -> str:
    """Keys as a screen shows them: `question_mark,up` as `? ↑`."""
    return " ".join(shown_key(key) for key in keys.split(","))


def shown_key(key: str) -> str:
    *modifiers, name = key.split("+")
    if name in _ARROWS:
        return "+".join((*modifiers, _ARROWS[name]))
    return written(key)


def written(key: str) -> str:
    """One key as the settings file writes it: a character as itself, others by name."""
    *modifiers, name = key.split("+")
    if not modifiers and len(name) == 1 and name.isupper():
        return f"shift+{name.lower()}"
    return "+".join((*modifiers, _SIGNS.get(name, name)))


def textual_keys(keys: str, where: str) -> str:
    """Keys from the settings file, separated by commas, by Textual's names. Raises UserError that
    begins with `where`.
    """
    names = [keys] if keys == "," else [key.strip() for key in keys.split(",")]
    return ",".join(_textual_key(key, where) for key in names)


def _textual_key(key: str, where: str) -> str:
    # The plus sign itself may stand after the last plus sign.
    *modifiers, name = f"{key[:-1]}plus".split("+") if key.endswith("+") else key.split("+")
    modifiers = [modifier.lower() for modifier in modifiers]
    if len(name) == 1:
        if modifiers == ["shift"] and name.isalpha():
            return name.upper()
        name = "comma" if name == "," else _named(name)
    elif name.lower() in _NAMED or name.lower() in _SIGNS:
        name = name.lower()
    else:
        name = ""
    if not name or not set(modifiers) <= set(_MODIFIERS):
        raise UserError(
            f"{where}: there is no key '{key}'; write a character, or a name such as space, "
            "enter, f2, ctrl+s or shift+left"
        )
    found = "+".join((*sorted(modifiers, key=_MODIFIERS.index), name))
    if found in _SAME:
        raise UserError(
            f"{where}: terminals send the same for {found} and {_SAME[found]}; use another key"
        )
    return found
