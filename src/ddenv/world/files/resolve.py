"""Finds the file that a URI in an SDF file refers to. Never downloads, and no URI leaves the folder it is relative to."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

from ddenv.world.access import Missing, Unusable, is_folder, read, reason, without_tilde

HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")
CACHES = ("~/.gz/fuel", "~/.ignition/fuel")
ENVIRONMENT = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH")
DOWNLOADS = "~/.gazebo/models"  # of Gazebo Classic
# ROS packages are in the folders of the one, and in `share` of those of the other.
PACKAGES, PREFIXES = "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"
# The owner of Gazebo's own models in Fuel.
GAZEBO = "openrobotics"
# The newest supported SDF version: a model's folder may hold one file per version.
NEWEST_SDF = (1, 12)
MODEL_CONFIG_LIMIT = 1_000_000  # bytes
CLIMBS = "leaves its folder with '..' (give the target folder with --model-path)"
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):(.*)", re.DOTALL)
# Errors of the file system for files that do not exist.
_ABSENT = (errno.ENOENT, errno.ENOTDIR)


def search_folders(model_path: Sequence[Path], world_folder: Path) -> tuple[Path, ...]:
    """The folders searched for models: `model_path`, the world's own folder, then those of Gazebo and ROS.

    They are absolute, exist, and are listed once.
    """
    gazebo = [folder for variable in ENVIRONMENT for folder in _listed_in(variable)]
    packages = [*_listed_in(PACKAGES), *(str(Path(prefix, "share")) for prefix in _listed_in(PREFIXES))]
    named = [*map(str, (*model_path, world_folder)), *gazebo, DOWNLOADS, *packages]
    absolute = [_absolute(without_tilde(name)) for name in named]
    return tuple(dict.fromkeys(folder for folder in absolute if is_folder(folder)))


def _listed_in(variable: str) -> list[str]:
    return [folder for folder in os.environ.get(variable, "").split(os.pathsep) if folder]


def model_named(uri: str) -> str:
    """The model that `uri` names, such as `construction_barrel`, as its folder in Gazebo is called; "" if it names none."""
    match = _SCHEME.fullmatch(uri.strip())
    if match is None:
        return ""
    words = unquote(match[2], errors="replace").strip("/").split("/")
    if match[1].lower() in ("http", "https"):
        words = words[4:] if words[3:4] == ["models"] else []
    elif match[1].lower() not in ("model", "package"):
        words = []
    return _plain(words[0]).replace(" ", "_") if words else ""


def find(uri: str, base: Path, folders: Sequence[Path]) -> Path:
    """The file or folder that `uri`, in a file of the folder `base`, refers to; `folders` are from `search_folders`.

    Raises Missing if there is none, and Unusable if the URI is invalid or not supported.
    """
    scheme, rest = _split(uri.strip())
    if scheme in ("model", "package"):
        path = _inside(rest)
        return _first(
            chain(_of_model(path, folders), _cached(path)), f"looked in {_listed(folders)} and the Fuel cache"
        )
    if scheme in ("http", "https"):
        return _downloaded(rest, folders)
    if scheme not in ("", "file"):
        raise Unusable(f"scheme '{scheme[:30]}:' is not supported")
    if rest.startswith("/"):
        return _first([Path(os.path.normpath(rest))], "there is no such file")
    where = f"looked beside the file that names it and in {_listed(folders)}"
    return _first(_beside(rest, base, folders), where)


def _split(uri: str) -> tuple[str, str]:
    """The scheme in lower case (empty for a plain path) and the rest, percent-decoded. Raises Unusable."""
    match = _SCHEME.fullmatch(uri)
    scheme, rest = ("", uri) if match is None else (match[1].lower(), match[2].removeprefix("//"))
    rest = unquote(rest, errors="surrogateescape")
    if not rest.strip("/ "):
        raise Unusable("names no file")
    if "\0" in rest:
        raise Unusable("has a NUL byte")
    return scheme, rest


def _inside(rest: str) -> str:
    """`rest` as a normalised relative path. Raises Unusable if it would leave its folder."""
    path = os.path.normpath(rest.lstrip("/") or ".")
    if Path(path).parts[:1] == ("..",):
        raise Unusable(CLIMBS)
    return path


def _of_model(path: str, folders: Sequence[Path]) -> Iterator[Path]:
    if path == ".":
        raise Unusable("names no file")
    name, _, rest = path.partition(os.sep)
    for folder in folders:
        yield folder / path
        if folder.name == name:
            yield folder / rest


def _beside(rest: str, base: Path, folders: Sequence[Path]) -> Iterator[Path]:
    """`rest` below `base` and each search folder. Raises Unusable if it leaves all of them."""
    allowed = [_absolute(folder) for folder in (base, *folders)]
    candidates = [Path(os.path.normpath(folder / rest)) for folder in (base, *folders)]
    staying = [path for path in candidates if any(_absolute(path).is_relative_to(folder) for folder in allowed)]
    if not staying:
        raise Unusable(CLIMBS)
    yield from staying


def _downloaded(rest: str, folders: Sequence[Path]) -> Path:
    """`rest` is HOST/1.0/OWNER/models/NAME[/VERSION][/files/FILE]: a model that was downloaded from Fuel before."""
    words = rest.split("/")
    if words[0].lower() not in HOSTS or len(words) < 5 or words[3] != "models" or not (words[2] and words[4]):
        raise Missing("is not downloaded; name a file or folder of this machine instead")
    if any(word in (".", "..") for word in words):
        raise Unusable(CLIMBS if ".." in words else "names no file")
    owner, name, tail = words[2], words[4], words[5:]
    version = tail.pop(0) if tail and tail[0] != "files" else ""
    path = _inside("/".join(tail[1:] if tail[:1] == ["files"] else tail))
    models = (*in_cache(owner, name, version), *of_name(name, tuple(folders)))
    where = f"looked in the Fuel cache and in {_listed(folders)}; nothing is downloaded"
    return _first((model / path for model in models), where)


def in_cache(owner: str, name: str, version: str) -> Iterator[Path]:
    """Folders where the Fuel cache may hold the model: `version`, or the newest if that is empty or "tip"."""
    for host in _caches():
        folder = host / owner.lower() / "models" / name.lower()
        yield from [folder / version] if version.isdecimal() else _newest(folder)


def _cached(path: str) -> Iterator[Path]:
    """`path`, which begins with a model's name, in the newest version of each such model in the Fuel cache."""
    name, _, rest = path.partition(os.sep)
    for host in _caches():
        for owner in sorted(folders_of(host), key=lambda each: each != GAZEBO):
            models = of_name(name, (host / owner / "models",))
            yield from (version / rest for model in models for version in _newest(model))


def _caches() -> Iterator[Path]:
    """The Fuel caches, by host: $GZ_FUEL_CACHE_PATH, by default `CACHES`. Fuel moved from one host to the other."""
    chosen = os.environ.get("GZ_FUEL_CACHE_PATH", "")
    for cache in (chosen,) if chosen else CACHES:
        yield from (without_tilde(cache) / host for host in HOSTS)


def _newest(folder: Path) -> list[Path]:
    """The newest version of a model in the Fuel cache, if there is one."""
    versions = [entry for entry in folders_of(folder) if entry.isdecimal()]
    return [folder / max(versions, key=int)] if versions else []


def of_name(name: str, folders: tuple[Path, ...]) -> Iterator[Path]:
    """Folders called `name` in any of `folders`; then those that differ only in case, or in `_` for a space."""
    for folder in folders:
        yield folder / name
    for folder in folders:
        yield from (folder / entry for entry in folders_of(folder) if _plain(entry) == _plain(name))


def folders_of(folder: Path) -> list[str]:
    """The sorted names of the folders in `folder`; none if it is not accessible."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries if entry.is_dir())
    except (OSError, ValueError):
        return []


def _plain(name: str) -> str:
    return name.casefold().replace("_", " ")


def _first(candidates: Iterable[Path], where: str) -> Path:
    """The first candidate that exists. Raises Missing, or Unusable if one that is not accessible may be it."""
    problem = ""
    for path in candidates:
        try:
            path.stat()
        except OSError as error:
            problem = problem or ("" if error.errno in _ABSENT else reason(error))
        except ValueError:
            raise Unusable("is not a valid file name") from None
        else:
            return path
    if problem:
        raise Unusable(problem)
    raise Missing(where)


def _absolute(path: Path) -> Path:
    """`path` made absolute and without `..`; symbolic links are not followed."""
    return Path(os.path.normpath(path.absolute()))


def _listed(folders: Sequence[Path]) -> str:
    """The first three folders by name."""
    names = ", ".join(str(folder)[:100] for folder in folders[:3])
    return names if len(folders) <= 3 else f"{names} and {len(folders) - 3} more"


def model_file(folder: Path) -> Path:
    """The SDF file of a model's folder: the newest supported one in its model.config, or else model.sdf.

    Raises Unusable for an invalid model.config, and Missing if there is no SDF file.
    """
    try:
        config = _first([folder / "model.config"], "")
    except Missing:
        return _first([folder / "model.sdf"], "the folder has neither model.config nor model.sdf")
    name = _configured(read(config, MODEL_CONFIG_LIMIT))
    if not name:
        return _first(
            [folder / "model.sdf"], f"model.config names no file for SDF {'.'.join(map(str, NEWEST_SDF))} or older"
        )
    try:
        path = _inside(name)
    except Unusable as error:
        raise Unusable(f"model.config: <sdf> {error}") from None
    return _first([folder / path], f"model.config names '{name[:60]}', which does not exist")


def _configured(text: bytes) -> str:
    """The file that a model.config names for the newest supported SDF version; empty if there is none."""
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root = fromstring(text)
    except ElementTree.ParseError as error:
        raise Unusable(f"model.config:{error.position[0]}: not well-formed XML") from None
    except DefusedXmlException:
        raise Unusable("model.config: DOCTYPE is not allowed (its entities can read other files)") from None
    except (LookupError, ValueError):
        raise Unusable("model.config: cannot be decoded; save it as UTF-8") from None
    entries = [(_version(element.get("version", "")), (element.text or "").strip()) for element in root.findall("sdf")]
    # `max` takes the first of two entries for one version.
    usable = [entry for entry in entries if entry[0] <= NEWEST_SDF and entry[1] and "\0" not in entry[1]]
    return max(usable, key=lambda entry: entry[0], default=((), ""))[1]


def _version(text: str) -> tuple[int, ...]:
    """The version as numbers, since 1.12 is newer than 1.9; (0, 0) for anything else."""
    match = re.fullmatch(r"\s*(\d{1,4})(?:\.(\d{1,4}))?(?:\.\d{1,4})*\s*", text)
    return (0, 0) if match is None else (int(match[1]), int(match[2] or 0))
