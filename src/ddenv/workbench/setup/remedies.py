"""Remedies for files that a world names but that cannot be found: a stand-in, `none`, or a folder; remembered by URI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.runs.remembered import read_state, write_state

if TYPE_CHECKING:
    from ddenv.world.model import World
    from ddenv.world.scenario import Reading

REMEDIES = "remedies.json"
KEPT = 1000  # URIs


@dataclass(frozen=True, slots=True)
class Missing:
    """A URI that cannot be found.

    Its `remedy` is a stand-in as for `--stand-in`, the absolute path of a folder, or "" for none yet. `words` say what stands on
    the map for it, and first if it is not in the folder that was chosen for it.
    """

    uri: str
    remedy: str
    words: str


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
    """What the user typed, as a remedy: a stand-in, or else the path of a folder. Raises UserError."""
    from ddenv.world.access import is_folder, without_tilde
    from ddenv.world.sdf.standin import AUTO, NONE, parse_stand_in

    text = text.strip()
    names_folder = text not in ("", AUTO, NONE) and is_folder(Path(text))
    if "/" in text or text.startswith(("~", ".")) or names_folder:
        folder = without_tilde(text).absolute()
        if not is_folder(folder):
            raise UserError(f"{folder} is a file; name a folder" if folder.exists() else f"there is no folder {folder}")
        return str(folder)
    stand_in = parse_stand_in(text, "remedy") if text else AUTO
    if isinstance(stand_in, str) and stand_in not in (AUTO, NONE):
        raise UserError(f"{text} is for single meshes, with --stand-in; auto takes the box around the visuals, too")
    return text


def _is_usable(text: str) -> bool:
    try:
        return bool(remedy(text))
    except UserError:
        return False


def read_with_remedies(
    path: Path, reading: Reading, options: Mapping[str, Any]
) -> tuple[World, dict[str, Any], tuple[Missing, ...]]:
    """The world, with remembered remedies for what is missing, and a guess for all else; the `options` with these remedies.

    `reading` is the scenario's own, `options` are as on the command line. Raises UserError.
    """
    from ddenv.runs.subject import reading_of
    from ddenv.world.access import MissingFiles
    from ddenv.world.sdf.read import read_world
    from ddenv.world.sdf.standin import AUTO

    known, found, vain = remembered(), dict[str, str](), dict[str, str]()
    while True:
        chosen = with_remedies(options, found)
        try:
            world = read_world(path, reading_of(reading, **chosen))
            break
        except MissingFiles as error:
            # A folder does not help if the file is not in it.
            fresh = {uri: "" if uri in found else known.get(uri, "") for uri in error.uris}
            vain |= {uri: found[uri] for uri in error.uris if found.get(uri)}
            changed = {uri: text for uri, text in fresh.items() if found.get(uri, "") != text}
            found |= fresh
        if not changed:
            guessing = {**chosen, "stand_in": (*chosen.get("stand_in", ()), AUTO)}
            world = read_world(path, reading_of(reading, **guessing))
            break
    return (
        world,
        chosen,
        tuple(Missing(uri, text, _words(uri, text, vain.get(uri, ""), world)) for uri, text in found.items()),
    )


def with_remedies(options: Mapping[str, Any], found: Mapping[str, str]) -> dict[str, Any]:
    """The `options` of the command line that say the same as the remedies, too."""
    folders = tuple(dict.fromkeys(Path(text) for text in found.values() if text.startswith("/")))
    stand_ins = tuple(f"{uri}={text}" for uri, text in found.items() if text and not text.startswith("/"))
    more = {"model_path": folders, "stand_in": stand_ins}
    return {**options, **{name: (*options.get(name, ()), *each) for name, each in more.items() if each}}


def _words(uri: str, text: str, vain: str, world: World) -> str:
    if text.startswith("/"):
        return f"in {text}"
    if text:
        return _on_the_map(uri, world)
    return f"{f'not in {vain}; ' if vain else ''}guess {_on_the_map(uri, world)}"


def _on_the_map(uri: str, world: World) -> str:
    begin = f"'{uri}' by "
    by = next((note.why.removeprefix(begin) for note in world.notes if note.why.startswith(begin)), "left out")
    return by.removeprefix("a guess, ").removeprefix("the stand-in ")
