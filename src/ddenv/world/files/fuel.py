"""Models that Gazebo downloaded from Fuel: where its cache keeps them, and what else on disk has their name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from ddenv.world.files.access import without_tilde

HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")
CACHES = ("~/.gz/fuel", "~/.ignition/fuel")


def in_cache(owner: str, name: str, version: str) -> Iterator[Path]:
    """Folders where the Fuel cache may have the model; of `version`, or the newest if that is empty or "tip".

    The cache is $GZ_FUEL_CACHE_PATH, or else `CACHES`; both hosts are looked at, since Fuel moved from one to the other.
    """
    chosen = os.environ.get("GZ_FUEL_CACHE_PATH", "")
    for cache in (chosen,) if chosen else CACHES:
        for host in HOSTS:
            folder = without_tilde(cache) / host / owner.lower() / "models" / name.lower()
            if version.isdecimal():
                yield folder / version
            elif versions := [entry for entry in folders_of(folder) if entry.isdecimal()]:
                yield folder / max(versions, key=int)


def of_name(name: str, folders: tuple[Path, ...]) -> Iterator[Path]:
    """Folders called `name` in any of `folders`; then those that differ by case only, or by `_` for a space."""
    for folder in folders:
        yield folder / name
    for folder in folders:
        yield from (folder / entry for entry in folders_of(folder) if _plain(entry) == _plain(name))


def folders_of(folder: Path) -> list[str]:
    """Names of the folders in `folder`, sorted; none if it cannot be looked at."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries if entry.is_dir())
    except (OSError, ValueError):
        return []


def _plain(name: str) -> str:
    return name.casefold().replace("_", " ")
