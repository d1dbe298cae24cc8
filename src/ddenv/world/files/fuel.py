"""Models and worlds of Gazebo Fuel: their URLs, and where gz-fuel-tools keeps those that were
downloaded.

The layout is that of LocalCache and ModelIdentifier in gz-fuel-tools:
HOST/OWNER/models/NAME/VERSION, with owner and name in lower case.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ddenv.world.access import Unusable, folders_of, without_tilde

# Fuel moved from the second to the first.
HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")
KINDS = ("models", "worlds")
# The variables that say where the caches of Gazebo and of Ignition Gazebo are, and where they are
# by default.
CACHES = {"GZ_FUEL_CACHE_PATH": "~/.gz/fuel", "IGN_FUEL_CACHE_PATH": "~/.ignition/fuel"}
# The owner of Gazebo's own models in Fuel.
GAZEBO = "openrobotics"


@dataclass(frozen=True)
class FuelModel:
    """A model or a world in Fuel (`kind` is one of KINDS). `version` is empty for the newest, which
    Fuel calls tip.
    """

    owner: str
    kind: str
    name: str
    version: str = ""

    @property
    def url(self) -> str:
        """Its address, as `gz fuel download -u` takes it."""
        version = f"/{self.version}" if self.version else ""
        return (
            f"https://{HOSTS[0]}/1.0/{quoted(self.owner)}/{self.kind}/{quoted(self.name)}{version}"
        )

    @property
    def folder(self) -> Path:
        """The folder of its versions, relative to that of a host in a cache."""
        return Path(self.owner.lower(), self.kind, self.name.lower())


def quoted(name: str) -> str:
    """A name as a part of a URL."""
    return quote(name, safe="", errors="surrogateescape")


def in_fuel(rest: str) -> tuple[FuelModel, str] | None:
    """The model, and the file in it, that a URL names:
    HOST/1.0/OWNER/models/NAME[/VERSION][/files/FILE], decoded.

    None if it names none.
    """
    host, *words = [word for word in rest.split("/") if word] or [""]
    if words and re.fullmatch(r"[0-9]+\.[0-9]+", words[0]):
        del words[0]
    if host.lower() not in HOSTS or len(words) < 3 or words[1] not in KINDS:
        return None
    owner, kind, name, *tail = words
    if {owner, name} & {".", ".."}:
        return None
    version = tail.pop(0) if tail and re.fullmatch("[0-9]{1,9}|tip", tail[0]) else ""
    inside = tail[1:] if tail[:1] == ["files"] else tail
    return FuelModel(owner, kind, name, version.removeprefix("tip")), "/".join(inside)


def caches() -> list[Path]:
    """The folders of Fuel's caches; the first is the one that Gazebo writes to."""
    return [without_tilde(os.environ.get(variable) or usual) for variable, usual in CACHES.items()]


def hosts() -> list[Path]:
    """The folders of all hosts in all caches."""
    return [cache / host for cache in caches() for host in HOSTS]


def cached(model: FuelModel) -> Iterator[Path]:
    """Where the model can be in the caches: in the version that it names, or else in the newest one
    that is there.
    """
    for host in hosts():
        if model.version:
            yield host / model.folder / model.version
        else:
            yield from newest(host / model.folder)


def newest(folder: Path) -> list[Path]:
    """The newest version of a model in a cache, if there is one."""
    versions = [entry for entry in folders_of(folder) if entry.isdecimal()]
    if versions:
        return [folder / max(versions, key=int)]
    return []


def refuse_link_out(path: Path) -> None:
    """Raises Unusable if `path`, which is in a cache, is a link to something outside of it."""
    for cache in caches():
        if path.is_relative_to(cache) and not path.resolve().is_relative_to(cache.resolve()):
            raise Unusable(f"{path} is a link that leads out of Fuel's cache")
