"""The files that an SDF file refers to, from disk or from what an earlier reading stored."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from ddenv.world.access import Missing, Unusable, is_folder, read, size_of
from ddenv.world.files.meshes import MESH_LIMIT, build, origin, read_parts, unpack
from ddenv.world.files.resolve import find, model_file, model_named, search_folders
from ddenv.world.files.triangles import Part
from ddenv.world.model import Mesh

SDF_LIMIT = 50_000_000  # bytes of a file
SLOW_MESH = 3_000_000  # bytes; reading a larger mesh is announced


class Resources:
    """Answers URIs in SDF files: from `taken`, the bytes read for earlier requests, or else from the `disk`, if there is one.

    `base` is the folder of the file that contains the URI. Both methods raise Missing if there is no such file, and Unusable if it
    cannot be used, or if its stored bytes are damaged. Equal requests return the same object. Failures are kept too: a world may
    name one broken file a thousand times.
    """

    def __init__(self, taken: Mapping[str, bytes], disk: _Reader | None = None) -> None:
        self.taken = dict(taken)
        self._disk = disk
        self._files: dict[str, tuple[Path, bytes]] = {}
        self._meshes: dict[str, Mesh] = {}
        self._failed: dict[str, Missing | Unusable] = {}
        # All requests so far: the URI, and its base.
        self.asked: dict[tuple[str, Path], None] = {}

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        """Path and content of an SDF file, given by its own URI or by its model's folder."""
        self.asked[uri, base] = None
        key = _key("sdf", uri, str(base))
        if key not in self._files:
            path, end, text = self._bytes(key, lambda disk: disk.sdf(uri, base)).partition(b"\0")
            if not end or not path:
                raise Unusable("its stored file is damaged")
            self._files[key] = Path(path.decode("utf-8", "surrogateescape")), text
        return self._files[key]

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        """A mesh file in m, or its part called `submesh`; `center` moves the middle of its bounding box to the origin."""
        self.asked[uri, base] = None
        key = _key("mesh", uri, str(base), submesh, center, convex)
        if key not in self._meshes:
            packed = self._bytes(key, lambda disk: disk.mesh(uri, base, submesh, center, convex))
            self._meshes[key] = unpack(origin(uri, submesh, center, convex), packed)
        return self._meshes[key]

    def _bytes(self, key: str, ask: Callable[[_Reader], bytes]) -> bytes:
        if key in self._failed:
            # A new exception each time: an exception raised again would collect a traceback of all its uses.
            raise type(self._failed[key])(str(self._failed[key]))
        if key not in self.taken:
            if self._disk is None:
                raise Missing("was not found when the world was read")
            try:
                self.taken[key] = ask(self._disk)
            except (Missing, Unusable) as error:
                self._failed[key] = error
                raise
        return self.taken[key]


class _Reader:
    """Reads files from disk, as bytes to be stored."""

    def __init__(self, folders: Sequence[Path], announce: Callable[[str], None] | None) -> None:
        self._folders = folders
        self._announce = announce
        # A collision and its visual mostly use the same file, one after the other.
        self._last: tuple[Path, list[Part]] | None = None

    def sdf(self, uri: str, base: Path) -> bytes:
        try:
            path = find(uri, base, self._folders)
            path = model_file(path) if is_folder(path) else path
            text = read(path, SDF_LIMIT)
        except Missing:
            found = built_in(uri)
            if found is None:
                raise
            path, text = found
        return str(path).encode("utf-8", "surrogateescape") + b"\0" + text

    def mesh(self, uri: str, base: Path, submesh: str, center: bool, convex: bool) -> bytes:
        path = find(uri, base, self._folders)
        if self._last is None or self._last[0] != path:
            size = size_of(path)
            if self._announce is not None and SLOW_MESH < size <= MESH_LIMIT:
                self._announce(f"reading mesh {path.name} ({size / 1e6:.0f} MB)")
            self._last = None
            self._last = (path, read_parts(path))
        return build(self._last[1], submesh=submesh, center=center, convex=convex)


def on_disk(
    world_folder: Path, model_path: Sequence[Path] = (), announce: Callable[[str], None] | None = None
) -> Resources:
    """The files beside a world and in the folders of `model_path`, Gazebo and ROS; `announce` gets a line before slow steps."""
    return Resources({}, _Reader(search_folders(model_path, world_folder), announce))


def _key(*request: str | bool) -> str:
    """The name under which a run file stores the answer to a request."""
    return json.dumps(request)


# In place of a folder: messages name it.
FOLDER = Path("built in")
# As in Gazebo's own models: the ground has no end, and wheels grip it.
_TEXTS = {
    "sun": "<light name='sun' type='directional'/>",
    "ground_plane": (
        "<model name='ground_plane'><static>true</static><link name='link'>"
        "<collision name='collision'><geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>"
        "<surface><friction><ode><mu>100</mu><mu2>50</mu2></ode></friction></surface></collision>"
        "<visual name='visual'><geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>"
        "<material><script><name>Gazebo/Grey</name></script></material></visual></link></model>"
    ),
}


def built_in(uri: str) -> tuple[Path, bytes] | None:
    """A name in place of a path, and the SDF text, of the built-in model that `uri` names; None if there is none."""
    name = model_named(uri)
    text = _TEXTS.get(name)
    return None if text is None else (FOLDER / f"{name}.sdf", f"<sdf version='1.5'>{text}</sdf>".encode())
