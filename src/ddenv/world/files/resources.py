"""The files that an SDF file refers to, from disk (`Disk`) or from what an earlier reading stored (`Stored`)."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from ddenv.world.access import Missing, Unusable, is_folder, read, size_of
from ddenv.world.files.meshes import MESH_LIMIT, build, origin, pack, read_parts, unpack
from ddenv.world.files.resolve import find, model_file, model_named, search_folders
from ddenv.world.files.triangles import Part
from ddenv.world.model import Mesh

SDF_LIMIT = 50_000_000  # bytes of a file
SLOW_MESH = 3_000_000  # bytes; reading a larger mesh is announced

Answer = TypeVar("Answer")


class Resources(Protocol):
    """Answers URIs in SDF files. `base` is the folder of the file that contains the URI.

    Both methods raise Missing if there is no such file, and Unusable if it cannot be used. Equal requests return the same
    object. `taken` holds at least everything returned so far, by request.
    """

    @property
    def taken(self) -> Mapping[str, bytes]: ...

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        """Path and content of an SDF file, given by its own URI or by its model's folder."""
        ...

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        """A mesh file in m, or its part called `submesh`; `center` moves the middle of its bounding box to the origin."""
        ...


class Disk:
    """Reads from disk, and keeps everything it returned in `taken`, for a later `Stored`.

    `announce` is called with a line of text before slow steps.
    """

    def __init__(
        self, world_folder: Path, model_path: Sequence[Path] = (), announce: Callable[[str], None] | None = None
    ) -> None:
        self.taken: dict[str, bytes] = {}
        self._folders = search_folders(model_path, world_folder)
        self._announce = announce or (lambda message: None)
        self._sdfs = _Answers[tuple[Path, bytes]]()
        self._meshes = _Answers[Mesh]()
        # A collision and its visual mostly use the same file, one after the other.
        self._last: tuple[Path, list[Part]] | None = None

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        key = _key("sdf", uri, str(base))
        return self._sdfs.get(key, lambda: self._read_sdf(key, uri, base))

    def _read_sdf(self, key: str, uri: str, base: Path) -> tuple[Path, bytes]:
        try:
            path = find(uri, base, self._folders)
            path = model_file(path) if is_folder(path) else path
            text = read(path, SDF_LIMIT)
        except Missing:
            found = built_in(uri)
            if found is None:
                raise
            path, text = found
        self.taken[key] = str(path).encode("utf-8", "surrogateescape") + b"\0" + text
        return path, text

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        def read_mesh() -> Mesh:
            parts = self._parts(find(uri, base, self._folders))
            name = origin(uri, submesh, center, convex)
            mesh = build(parts, name, submesh=submesh, center=center, convex=convex)
            self.taken[key] = pack(mesh.vertices, mesh.faces, simplified=mesh.simplified)
            return mesh

        key = _key("mesh", uri, str(base), submesh, center, convex)
        return self._meshes.get(key, read_mesh)

    def _parts(self, path: Path) -> list[Part]:
        if self._last is None or self._last[0] != path:
            size = size_of(path)
            if SLOW_MESH < size <= MESH_LIMIT:
                self._announce(f"reading mesh {path.name} ({size / 1e6:.0f} MB)")
            self._last = None
            self._last = (path, read_parts(path))
        return self._last[1]


class Stored:
    """Returns what a `Disk` has taken, without using the disk. Raises Missing for all else, Unusable for damaged bytes."""

    def __init__(self, taken: Mapping[str, bytes]) -> None:
        self.taken = taken
        self._sdfs = _Answers[tuple[Path, bytes]]()
        self._meshes = _Answers[Mesh]()

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        key = _key("sdf", uri, str(base))
        return self._sdfs.get(key, lambda: self._unpacked(key))

    def _unpacked(self, key: str) -> tuple[Path, bytes]:
        path, end, text = self._bytes(key).partition(b"\0")
        if not end or not path:
            raise Unusable("its stored file is damaged")
        return Path(path.decode("utf-8", "surrogateescape")), text

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        key = _key("mesh", uri, str(base), submesh, center, convex)
        return self._meshes.get(key, lambda: unpack(origin(uri, submesh, center, convex), self._bytes(key)))

    def _bytes(self, key: str) -> bytes:
        try:
            return self.taken[key]
        except KeyError:
            raise Missing("was not found when the world was read") from None


class _Answers(Generic[Answer]):
    """Answers by request, each made once. Failures are kept too: a world may name one broken file a thousand times."""

    def __init__(self) -> None:
        self._known: dict[str, Answer | Missing | Unusable] = {}

    def get(self, key: str, make: Callable[[], Answer]) -> Answer:
        if key not in self._known:
            try:
                self._known[key] = make()
            except (Missing, Unusable) as error:
                self._known[key] = error
        answer = self._known[key]
        if isinstance(answer, Missing | Unusable):
            # A new exception each time: an exception raised again would collect a traceback of all its uses.
            raise type(answer)(str(answer))
        return answer


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
