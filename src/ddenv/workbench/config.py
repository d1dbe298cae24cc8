"""What a user wants otherwise: the theme, and the keys of actions, from a file in the folder for settings."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ddenv.errors import UserError

KNOWN = ("theme", "keys")


@dataclass(frozen=True, slots=True)
class Config:
    """`theme` is "" where the terminal decides. `keys` are Textual's names of keys by the ids of actions."""

    theme: str = ""
    keys: Mapping[str, str] = field(default_factory=dict)


def config_path() -> Path:
    """Where the file is looked for: `$DDENV_CONFIG`, or `config.yaml` in the user's folder for settings."""
    named = os.environ.get("DDENV_CONFIG")
    if named:
        return Path(named)
    import platformdirs

    return Path(platformdirs.user_config_dir("ddenv", appauthor=False)) / "config.yaml"


def read_config() -> Config:
    """What the file says; without a file all is as it comes. Raises UserError: what is wrong, and where."""
    path = config_path()
    data = _load(path) if path.exists() else {}
    if not data:
        if os.environ.get("DDENV_CONFIG") and not path.exists():
            raise UserError(f"{path}: no such file; make it, or unset DDENV_CONFIG")
        return Config()
    from ddenv.workbench.keys import checked
    from ddenv.workbench.themes import nearest, theme_called

    for key in data:
        if key not in KNOWN:
            raise UserError(
                f"{path}: '{key}' is not known here{nearest(str(key), KNOWN)}; known are {' and '.join(KNOWN)}"
            )
    theme, keys = data.get("theme"), data.get("keys")
    if theme is not None and not isinstance(theme, str):
        raise UserError(f"{path}: theme: expected a name, such as ddenv-light; found {theme!r}")
    wanted = _wanted(keys, path)
    return Config(theme_called(theme, f"{path}: theme") if theme else "", checked(wanted, str(path)) if wanted else {})


def _load(path: Path) -> dict[Any, Any]:
    import yaml

    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read: {getattr(error, 'strerror', '') or 'is no UTF-8 text'}") from None
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
        # A date that no calendar has.
        raise UserError(f"{path}: is no YAML: {error}; put it in quotes") from None
    if data is not None and not isinstance(data, dict):
        raise UserError(f"{path}: expected lines such as 'theme: ddenv-light'; 'ddenv config --example' prints some")
    return data or {}


def _wanted(keys: Any, path: Path) -> dict[str, str]:
    """What the section `keys` says, as text."""
    if keys is None:
        return {}
    if not isinstance(keys, dict):
        raise UserError(f"{path}: keys: expected lines such as 'run.pause: p'; found {keys!r}")
    for id, value in keys.items():
        # A digit is a number in YAML, and a key here.
        if not isinstance(value, str) and (isinstance(value, bool) or not isinstance(value, int)):
            raise UserError(f"{path}: keys: {id}: expected a key such as p, in quotes if it is a sign; found {value!r}")
    return {str(id): str(value) for id, value in keys.items()}
