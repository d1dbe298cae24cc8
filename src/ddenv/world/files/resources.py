"""The files that an SDF file names, from disk or from what an earlier reading has kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from ddenv.world.files.access import Missing, Unusable, is_folder, read, size_of
from ddenv.world.files.meshes import MESH_LIMIT, build, origin, pack, read_parts, unpack
from ddenv.world.files.resolve import find, model_file, search_folders
from ddenv.world.files.triangles import Part
from ddenv.world.model import Mesh

__all__ = ["Disk", "Missing", "Resources", "Stored", "Unusable"]

SDF_LIMIT = 50_000_000
# A mesh of more bytes takes long enough to be announced.
SLOW_MESH = 3_000_000

Answer = TypeVar("Answer")


class Resources(Protocol):
    """Answers for URIs in SDF files. `base` is the folder of the file that names the URI.

    Both raise Missing if there is no such file, and Unusable if it is there and cannot be used. Equal requests get the same object.
    `taken` holds what was given so far, or more, by request.
    """

    taken: Mapping[str, bytes]

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        """Path and content of an SDF file, given by its own URI or by that of its model's folder."""
        ...

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        """A mesh file, or the part of it called `submesh`, in m; `center` puts the middle of its box at the origin."""
        ...


class Disk:
    """Reads from disk, and keeps in `taken` all that it gave, for `Stored` to give again.

    `tell` is called before something slow starts, with what that is.
    """

    def __init__(
        self, world_folder: Path, model_path: Sequence[Path] = (), tell: Callable[[str], None] | None = None
    ) -> None:
        self.taken: dict[str, bytes] = {}
        self._folders = search_folders(model_path, world_folder)
        self._tell = tell or (lambda message: None)
        self._answers: dict[tuple, object] = {}
        # A collision and its visual mostly name the same file, one after the other.
        self._last: tuple[Path, list[Part]] | None = None

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        request = ("sdf", uri, str(base))
        return _known(self._answers, request, lambda: self._read_sdf(request, base))

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        request = ("mesh", uri, str(base), submesh, center, convex)
        return _known(self._answers, request, lambda: self._read_mesh(request, base))

    def _read_sdf(self, request: tuple, base: Path) -> tuple[Path, bytes]:
        path = find(request[1], base, self._folders)
        path = model_file(path) if is_folder(path) else path
        text = read(path, SDF_LIMIT)
        self.taken[_key(request)] = str(path).encode("utf-8", "surrogateescape") + b"\0" + text
        return path, text

    def _read_mesh(self, request: tuple, base: Path) -> Mesh:
        _, uri, _, submesh, center, convex = request
        parts = self._parts(find(uri, base, self._folders))
        mesh = build(parts, origin(*_way(request)), submesh=submesh, center=center, convex=convex)
        self.taken[_key(request)] = pack(mesh.vertices, mesh.faces)
        return mesh

    def _parts(self, path: Path) -> list[Part]:
        if self._last is None or self._last[0] != path:
            size = size_of(path)
            if SLOW_MESH < size <= MESH_LIMIT:
                self._tell(f"reading mesh {path.name} ({size / 1e6:.0f} MB)")
            self._last = None
            self._last = (path, read_parts(path))
        return self._last[1]


class Stored:
    """Gives again what a `Disk` has taken, and looks at no disk. What it did not take is Missing; damaged bytes are Unusable."""

    def __init__(self, taken: Mapping[str, bytes]) -> None:
        self.taken = taken
        self._answers: dict[tuple, object] = {}

    def sdf(self, uri: str, base: Path) -> tuple[Path, bytes]:
        request = ("sdf", uri, str(base))
        return _known(self._answers, request, lambda: _unpack_sdf(self._bytes(request)))

    def mesh(self, uri: str, base: Path, *, submesh: str = "", center: bool = False, convex: bool) -> Mesh:
        request = ("mesh", uri, str(base), submesh, center, convex)
        return _known(self._answers, request, lambda: unpack(origin(*_way(request)), self._bytes(request)))

    def _bytes(self, request: tuple) -> bytes:
        try:
            return self.taken[_key(request)]
        except KeyError:
            raise Missing("was not found when the world was read") from None


def _known(answers: dict[tuple, object], request: tuple, make: Callable[[], Answer]) -> Answer:
    """The answer to `request`, made once. A refusal is kept too: a world may name one broken file a thousand times."""
    answer = answers.get(request)
    if answer is None:
        try:
            answer = make()
        except (Missing, Unusable) as error:
            answer = error
        answers[request] = answer
    if isinstance(answer, Missing | Unusable):
        # A new exception each time: one that is raised again would collect a traceback of all its uses.
        raise type(answer)(str(answer))
    return answer


def _key(request: tuple) -> str:
    return json.dumps(request)


def _way(request: tuple) -> tuple[str, str, bool, bool]:
    _, uri, _, submesh, center, convex = request
    return uri, submesh, center, convex


def _unpack_sdf(packed: bytes) -> tuple[Path, bytes]:
    path, end, text = packed.partition(b"\0")
    if not end or not path:
        raise Unusable("its stored file is damaged")
    return Path(path.decode("utf-8", "surrogateescape")), text
