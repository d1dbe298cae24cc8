"""What the user chose for files that worlds name but that cannot be found: by URI, a stand-in,
`none`, or a folder.

The workbench asks for it; every command that reads a world uses it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.runs.preferences import read_state, write_state
from ddenv.text import Data
from ddenv.world.access import is_folder, without_tilde

REMEDIES = "remedies.json"
# Maximum number of URIs that are kept.
KEPT = 1000


def remembered() -> dict[str, str]:
    """The remedies that the user chose so far, by URI."""
    found = read_state(REMEDIES)
    if not isinstance(found, dict):
        return {}
    return {uri: text for uri, text in found.items() if isinstance(text, str) and _is_usable(text)}


def remember_remedies(chosen: Mapping[str, str]) -> None:
    """Remembers the remedies of some URIs; "" forgets one."""
    known = {uri: text for uri, text in remembered().items() if uri not in chosen}
    known |= {uri: text for uri, text in chosen.items() if text}
    write_state(REMEDIES, dict(list(known.items())[-KEPT:]))


def remedy(text: str) -> str:
    """What the user typed, as a remedy: a stand-in, or else the path of a folder. Raises
    UserError.
    """
    from ddenv.world.sdf.standin import AUTO, NONE, parse_stand_in

    text = text.strip()
    names_folder = text not in ("", AUTO, NONE) and is_folder(Path(text))
    if "/" in text or text.startswith(("~", ".")) or names_folder:
        folder = without_tilde(text).absolute()
        if not is_folder(folder):
            raise UserError(
                f"{folder} is a file; name a folder"
                if folder.exists()
                else f"there is no folder {folder}"
            )
        return str(folder)
    stand_in = parse_stand_in(text, "remedy") if text else AUTO
    if isinstance(stand_in, str) and stand_in not in (AUTO, NONE):
        raise UserError(
            f"{text} is for single meshes, with --stand-in; auto takes the box around the "
            "visuals, too"
        )
    return text


def _is_usable(text: str) -> bool:
    try:
        return bool(remedy(text))
    except UserError:
        return False


def with_remedies(options: Mapping[str, Any], found: Mapping[str, str]) -> Data:
    """The `options` of the command line that say the same as the remedies, too."""
    folders = tuple(dict.fromkeys(Path(text) for text in found.values() if text.startswith("/")))
    stand_ins = tuple(
        f"{uri}={text}" for uri, text in found.items() if text and not text.startswith("/")
    )
    more = {"model_path": folders, "stand_in": stand_ins}
    return {
        **options,
        **{name: (*options.get(name, ()), *each) for name, each in more.items() if each},
    }
