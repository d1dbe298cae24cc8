"""The files that an SDF file refers to: found by URI and read from disk, or taken from what an
earlier reading stored.

Reading downloads nothing, and no URI leaves the folder it is relative to.
"""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ddenv.arrays import Floats
from ddenv.text import first_of
from ddenv.world.access import (
    Missing,
    Unusable,
    folders_of,
    is_file,
    is_folder,
    read,
    reason,
    xml_root,
)
from ddenv.world.files.fuel import (
    GAZEBO,
    FuelModel,
    cached,
    caches,
    hosts,
    in_fuel,
    newest,
    refuse_link_out,
)
from ddenv.world.files.heights import read_heights, unpack_heights
from ddenv.world.files.kept_pieces import ToCut, kept_file, read_kept
from ddenv.world.files.meshes import build, read_parts, surface_of, unpack, unpack_pieces
from ddenv.world.files.roots import absolute, source_of
from ddenv.world.files.triangles import Part
from ddenv.world.model import Found, Mesh
from ddenv.world.pose import Vector
from ddenv.world.tinyxml import Element

SDF_LIMIT = 50_000_000  # bytes of a file
# Of the parts of mesh files that are kept in case that they are used again, bytes.
MOST_KEPT = 200_000_000


@dataclass(frozen=True)
class MeshPart:
    """A mesh file, or its part called `submesh`, named by a URI in a file of the folder `base`.

    `center` moves the middle of its bounding box to the origin.
    """

    uri: str
    base: Path
    submesh: str = ""
    center: bool = False

    def key(self, kind: str, *more: Any) -> str:
        """The name of what is made of it, for `Resources.taken`."""
        return json.dumps([kind, self.uri, str(self.base), self.submesh, self.center, *more])


class Resources:
    """Answers URIs in SDF files: from `taken`, the bytes read for earlier requests, or else from
    disk, if there are `folders`.

    `base` is the folder of the file that contains the URI; `folders` are from `search_roots`. Both
    methods raise Missing if there is no such file, and Unusable if it cannot be used, or if its
    stored bytes are damaged. Equal requests return the same object. Failures are kept too: a world
    may name one broken file a thousand times.
    """

    def __init__(
        self, taken: Mapping[str, bytes], folders: Mapping[Path, str] | None = None
    ) -> None:
        self.taken = dict(taken)
        self._reads_disk = folders is not None
        self._folders = folders or {}
        self._files: dict[str, tuple[Path, bytes]] = {}
        self._meshes: dict[str, Mesh] = {}
        self._pieces: dict[str, list[Mesh]] = {}
        # The meshes for `cut`, by the files of their pieces.
        self.uncut: dict[Path, ToCut] = {}
        self._heights: dict[str, Floats] = {}
        self._failed: dict[str, Missing | Unusable] = {}
        # Collisions and visuals use the same files, and different parts of them; the longest known
        # first.
        self._parts_of: dict[Path, list[Part]] = {}
        # All requests so far: the URI, and its base.
        self.asked: dict[tuple[str, Path], None] = {}
        # Where those are that were read from disk.
        self.found: dict[tuple[str, Path], Found] = {}

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        """Path and content of an SDF file, given by its own URI or by its model's folder."""
        self.asked[uri, base] = None
        key = json.dumps(["sdf", uri, str(base)])
        if key not in self._files:
            path, end, text = self._bytes(key, lambda: self._sdf(uri, base)).partition(b"\0")
            if not end or not path:
                raise Unusable("its stored file is damaged")
            self._files[key] = Path(path.decode("utf-8", "surrogateescape")), text
        return self._files[key]

    def mesh(self, part: MeshPart, *, convex: bool) -> Mesh:
        """A mesh in m; the convex hull of it if it is to be `convex`."""
        self.asked[part.uri, part.base] = None
        key = part.key("mesh", convex)
        if key not in self._meshes:
            packed = self._bytes(
                key, lambda: build(self._parts(part), part.submesh, part.center, convex)
            )
            self._meshes[key] = unpack(
                json.dumps([part.uri, part.submesh, part.center, convex]), packed
            )
        return self._meshes[key]

    def pieces(self, part: MeshPart, scale: Vector, most: int) -> list[Mesh]:
        """The convex pieces of a mesh, in m and times `scale`, at most `most`; a mesh that is
        convex is a single one.

        There are none before `cut`, nor where it cannot be cut.
        """
        key = part.key("pieces", scale, most)
        if key in self._pieces:
            return self._pieces[key]
        if key not in self.taken and self._reads_disk:
            vertices, faces = surface_of(self._parts(part), part.submesh, part.center)
            mesh = vertices * np.array(scale), faces, most
            file = kept_file(*mesh)
            packed = read_kept(file)
            if packed is None:
                self.uncut[file] = mesh
                return self._pieces.setdefault(key, [])
            self.taken[key] = packed
        self._pieces[key] = unpack_pieces(key, self._bytes(key, bytes))
        return self._pieces[key]

    def cut(self) -> bool:
        """Cuts the meshes whose pieces were asked for and not known; False if there is none. What
        `watch.WATCH` raises ends it.
        """
        if not self.uncut:
            return False
        # Loaded late: most worlds have no such mesh.
        from ddenv.world.files.cutting import cut

        cut(self.uncut)
        self._pieces.clear()
        return True

    def heights(self, part: MeshPart) -> Floats:
        """The heights (R, C) in an image, as a share of the greatest; the first row has the least
        y.
        """
        self.asked[part.uri, part.base] = None
        return self._unpacked(
            part.key("heightmap"),
            lambda: read_heights(self._find(part.uri, part.base, model=False)),
        )

    def ground(self, part: MeshPart, scale: Vector) -> Floats:
        """The heights (R, C) of a mesh that is ground, times `scale`, as a share of those of the
        box around it.
        """
        key = part.key("ground", scale)
        if key not in self.taken and not self._reads_disk:
            raise Unusable("was no ground when the world was read")
        return self._unpacked(key, lambda: _heights_of(self._parts(part), part, scale))

    def _unpacked(self, key: str, from_disk: Callable[[], bytes]) -> Floats:
        if key not in self._heights:
            self._heights[key] = unpack_heights(self._bytes(key, from_disk))
        return self._heights[key]

    def config_fault(self, folder: Path) -> str:
        """Why the model.config in the folder of a model cannot be read, so that its model.sdf is
        taken; empty if it can.
        """
        key = json.dumps(["config", str(folder)])
        if key not in self.taken and self._reads_disk:
            try:
                _model_config(folder)
            except Unusable as error:
                self.taken[key] = str(error).encode()
            except Missing:
                return ""
        return self.taken.get(key, b"").decode("utf-8", "replace")

    def rename(self, uri: str, folder: str, new: str, new_folder: str) -> None:
        """Makes the meshes and images called `uri` in files of `folder` also known as `new` in
        files of `new_folder`.
        """
        for key, content in list(self.taken.items()):
            kind, *names = json.loads(key)
            if kind in ("mesh", "pieces", "heightmap", "ground") and names[:2] == [uri, folder]:
                self.taken[json.dumps([kind, new, new_folder, *names[2:]])] = content

    def _bytes(self, key: str, from_disk: Callable[[], bytes]) -> bytes:
        if key in self._failed:
            # A new exception each time: an exception raised again would collect a traceback of all
            # its uses.
            raise type(self._failed[key])(str(self._failed[key]))
        if key not in self.taken:
            if not self._reads_disk:
                raise Missing("was not found when the world was read")
            try:
                self.taken[key] = from_disk()
            except (Missing, Unusable) as error:
                self._failed[key] = error
                raise
        return self.taken[key]

    def absent(self) -> tuple[str, ...]:
        """The URIs for which no file was found so far."""
        missing = [
            json.loads(key)[1] for key, error in self._failed.items() if isinstance(error, Missing)
        ]
        return tuple(dict.fromkeys(missing))

    def _find(self, uri: str, base: Path, *, model: bool) -> Path:
        """The file that `uri` refers to, by its folder if it is a `model`."""
        path = find(uri, base, self._folders)
        if model and is_folder(path):
            path = model_file(path)
        refuse_link_out(path)
        roots = {**self._folders, **dict.fromkeys(map(absolute, caches()), "Fuel's cache")}
        self.found[uri, base] = Found(uri, path, *source_of(path, roots))
        return path

    def _sdf(self, uri: str, base: Path) -> bytes:
        """The bytes to be stored for an SDF file: its path, a NUL byte, its content."""
        try:
            path = self._find(uri, base, model=True)
            text = read(path, SDF_LIMIT)
        except Missing:
            name = model_named(uri)
            if name not in _TEXTS:
                raise
            path = FOLDER / f"{name}.sdf"
            text = f"<sdf version='1.5'>{_TEXTS[name]}</sdf>".encode()
        return str(path).encode("utf-8", "surrogateescape") + b"\0" + text

    def _parts(self, part: MeshPart) -> list[Part]:
        path = self._find(part.uri, part.base, model=False)
        if path not in self._parts_of:
            self._parts_of[path] = read_parts(path)
        found = self._parts_of[path]
        while len(self._parts_of) > 1 and sum(map(_size, self._parts_of.values())) > MOST_KEPT:
            del self._parts_of[next(iter(self._parts_of))]
        return found


def _heights_of(parts: list[Part], part: MeshPart, scale: Vector) -> bytes:
    # Loaded late: what was read before is shown without it.
    from ddenv.world.files.surfaces import surface_heights

    vertices, faces = surface_of(parts, part.submesh, part.center)
    return surface_heights((vertices * np.array(scale), faces))


def _size(parts: Sequence[Part]) -> int:
    """The bytes of all `parts`."""
    return sum(part.vertices.nbytes + part.faces.nbytes for part in parts)


# In place of a folder: messages name it.
FOLDER = Path("built in")
# As in Gazebo's own models: the ground has no end, and wheels grip it.
_TEXTS = {
    "sun": "<light name='sun' type='directional'/>",
    "ground_plane": (
        "<model name='ground_plane'><static>true</static><link name='link'>"
        "<collision name='collision'><geometry><plane><normal>0 0 1</normal><size>100 "
        "100</size></plane></geometry>"
        "<surface><friction><ode><mu>100</mu><mu2>50</mu2></ode></friction></surface></collision>"
        "<visual name='visual'><geometry><plane><normal>0 0 1</normal><size>100 "
        "100</size></plane></geometry>"
        "<material><script><name>Gazebo/Grey</name></script></material></visual></link></model>"
    ),
}


# The newest supported SDF version: a model's folder may hold one file per version.
NEWEST_SDF = (1, 12)
# A line names so many commands, and so many folders.
MOST_COMMANDS = MOST_FOLDERS = 3
MODEL_CONFIG_LIMIT = 1_000_000  # bytes
CLIMBS = "leaves its folder with '..' (give the target folder with --model-path)"
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):(.*)", re.DOTALL)
# Errors of the file system for files that do not exist.
_ABSENT = (errno.ENOENT, errno.ENOTDIR)


def model_named(uri: str) -> str:
    """The model that `uri` names, such as `construction_barrel`, as its folder in Gazebo is called;
    "" if it names none.
    """
    scheme, rest = _decoded(uri)
    name = ""
    if scheme in ("model", "package"):
        name = rest.strip("/").split("/")[0]
    elif (model := fuel_model(uri)) is not None and model.kind == "models":
        name = model.name
    return _plain(name).replace(" ", "_")


def fuel_model(uri: str) -> FuelModel | None:
    """The model in Fuel that `uri`, or the file that it names, belongs to; None if it is no such
    URL.
    """
    scheme, rest = _decoded(uri)
    found = in_fuel(rest) if scheme in ("http", "https") else None
    if found is None:
        return None
    return found[0]


def how_to_fetch(uris: Iterable[str]) -> str:
    """What downloads those of the missing `uris` that are in Fuel, as the end of a sentence; empty
    if none is.
    """
    models = [model for model in map(fuel_model, uris) if model is not None]
    commands = [
        f"gz fuel download -u {url}" for url in dict.fromkeys(model.url for model in models)
    ]
    if not commands:
        return ""
    what = "this model" if len(commands) == 1 else f"these {len(commands)} models"
    return f"; --fetch downloads {what} from Fuel, as does {first_of(commands, MOST_COMMANDS)}"


def find(uri: str, base: Path, folders: Collection[Path]) -> Path:
    """The file or folder that `uri`, in a file of the folder `base`, refers to; `folders` are from
    `search_roots`.

    Raises Missing if there is none, and Unusable if the URI is invalid or not supported.
    """
    scheme, rest = _decoded(uri)
    if not rest.strip("/ "):
        raise Unusable("names no file")
    if "\0" in rest:
        raise Unusable("has a NUL byte")
    if scheme in ("model", "package"):
        path = _inside(rest)
        where = f"looked in {_listed(folders)} and the Fuel cache"
        return _first(chain(_of_model(path, folders), _cached(path)), where)
    if scheme in ("http", "https"):
        return _downloaded(rest, folders)
    if scheme not in ("", "file"):
        raise Unusable(f"scheme '{scheme[:30]}:' is not supported")
    if rest.startswith("/"):
        return _first([Path(os.path.normpath(rest))], "there is no such file")
    around = (base, *folders)
    paths = [Path(os.path.normpath(folder / rest)) for folder in around]
    staying = [
        path for path in paths if any(map(absolute(path).is_relative_to, map(absolute, around)))
    ]
    if not staying:
        raise Unusable(CLIMBS)
    return _first(staying, f"looked beside the file that names it and in {_listed(folders)}")


def _decoded(uri: str) -> tuple[str, str]:
    """The scheme in lower case (empty for a plain path) and the rest, percent-decoded."""
    uri = uri.strip()
    match = _SCHEME.fullmatch(uri)
    scheme, rest = ("", uri) if match is None else (match[1].lower(), match[2].removeprefix("//"))
    return scheme, unquote(rest, errors="surrogateescape")


def _inside(rest: str) -> str:
    """`rest` as a normalised relative path. Raises Unusable if it would leave its folder."""
    path = os.path.normpath(rest.lstrip("/") or ".")
    if Path(path).parts[:1] == ("..",):
        raise Unusable(CLIMBS)
    return path


def _of_model(path: str, folders: Collection[Path]) -> Iterator[Path]:
    if path == ".":
        raise Unusable("names no file")
    name, _, rest = path.partition(os.sep)
    for folder in folders:
        yield folder / path
        if name in (folder.name, _package(folder)):
            yield folder / rest


def _package(folder: Path) -> str:
    """The name of the ROS package in `folder`; empty if it holds none."""
    try:
        return (
            xml_root(read(folder / "package.xml", MODEL_CONFIG_LIMIT)).findtext("name") or ""
        ).strip()
    except Unusable:
        return ""


def _downloaded(rest: str, folders: Collection[Path]) -> Path:
    """What a URL refers to, if it is of a model in Fuel that was downloaded before."""
    words = rest.split("/")
    if any(word in (".", "..") for word in words):
        raise Unusable(CLIMBS if ".." in words else "names no file")
    found = in_fuel(rest)
    if found is None:
        raise Missing("is not downloaded; name a file or folder on this machine instead")
    model, file = found
    # A copy of a model can be in any folder of models.
    copies = of_name(model.name, folders) if model.kind == "models" else ()
    where = f"looked in the Fuel cache and in {_listed(folders)}"
    return _first((folder / file for folder in (*cached(model), *copies)), where)


def _cached(path: str) -> Iterator[Path]:
    """`path`, which begins with a model's name, in the newest version of each such model in Fuel's
    caches.
    """
    name, _, rest = path.partition(os.sep)
    for host in hosts():
        for owner in sorted(folders_of(host), key=lambda each: each != GAZEBO):
            models = of_name(name, [host / owner / "models"])
            yield from (version / rest for model in models for version in newest(model))


def of_name(name: str, folders: Collection[Path]) -> Iterator[Path]:
    """Folders called `name` in any of `folders`; then those that differ only in case, or in `_` for
    a space.
    """
    for folder in folders:
        yield folder / name
    for folder in folders:
        yield from (folder / entry for entry in folders_of(folder) if _plain(entry) == _plain(name))


def _plain(name: str) -> str:
    return name.casefold().replace("_", " ")


def _first(candidates: Iterable[Path], where: str) -> Path:
    """The first candidate that exists. Raises Missing, or Unusable if one that is not accessible
    may be it.
    """
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


def _listed(folders: Collection[Path]) -> str:
    """The first three folders by name."""
    return first_of([str(folder)[:100] for folder in folders], MOST_FOLDERS)


def model_file(folder: Path) -> Path:
    """The SDF file of a model's folder: the newest supported one in its model.config, or else
    model.sdf.

    Raises Unusable if a model.config cannot be read and there is no model.sdf, or if it names a
    file outside of the folder; Missing if there is no SDF file.
    """
    usual = folder / "model.sdf"
    try:
        config = _model_config(folder)
    except Unusable as error:
        if is_file(usual):
            return usual
        raise Unusable(f"model.config: {error}") from None
    except Missing:
        return _first([usual], f"{folder} has neither model.config nor model.sdf")
    name = _newest_file(config)
    if not name:
        return _first([usual], "model.config names no file for SDF 1.12 or older")
    return _first([folder / name], f"model.config names '{name[:60]}', which does not exist")


def _model_config(folder: Path) -> Element:
    """The root of the model.config in `folder`. Raises Unusable if it cannot be read, and Missing
    if there is none.
    """
    return xml_root(read(_first([folder / "model.config"], ""), MODEL_CONFIG_LIMIT))


def _newest_file(config: Element) -> str:
    """The file for the newest supported SDF version that a model.config names; empty if there is
    none. Raises Unusable.
    """
    name = ""
    newest = (-1, -1)
    for element in config.findall("sdf"):
        # As numbers, since 1.12 is newer than 1.9.
        match = re.fullmatch(
            r"\s*(\d{1,4})(?:\.(\d{1,4}))?(?:\.\d{1,4})*\s*", element.get("version", "")
        )
        version = (0, 0) if match is None else (int(match[1]), int(match[2] or 0))
        own = (element.text or "").strip()
        if own and newest < version <= NEWEST_SDF:
            newest = version
            name = own
    try:
        if name:
            return _inside(name)
        return ""
    except Unusable as error:
        raise Unusable(f"model.config: {error}") from None
