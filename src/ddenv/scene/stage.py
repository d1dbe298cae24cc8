"""The scene in the browsers: a tree of objects by path, sent as messages of Meshcat's protocol.

The stage keeps the latest message of each kind for each path, so that a browser that connects later
gets the whole scene.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import umsgpack
from meshcat.geometry import Object

from ddenv.text import Data
from ddenv.world.pose import Pose

Path = tuple[str, ...]
DRAWN = "<object>"  # at every path, the viewer keeps the object itself in a child of this name


class Stage:
    """`send(message, newest_only)` sends a message to the browsers; for slow ones, a `newest_only`
    message may be dropped.
    """

    def __init__(self, send: Callable[[bytes, bool], None]) -> None:
        self._send = send
        self._kept: dict[tuple[Path, str], bytes] = {}

    def draw(self, path: Path, thing: Object | None, *, shadow: bool = True) -> None:
        """Puts `thing` at `path`, replacing the object there; None only deletes it."""
        if thing is None:
            self.delete(path)
            return
        self._keep(path, "object", {"type": "set_object", "object": thing.lower()})
        # In the viewer a new object always casts a shadow, and properties of the old one are lost.
        self._kept.pop(((*path, DRAWN), "property castShadow"), None)
        self.set((*path, DRAWN), "castShadow", shadow)

    def draw_json(self, path: Path, thing: Data) -> None:
        """Like `draw`, for a three.js object without geometry and material, such as a light."""
        metadata = {"version": 4.5, "type": "Object"}
        self._keep(
            path,
            "object",
            {"type": "set_object", "object": {"metadata": metadata, "object": thing}},
        )

    def move(self, path: Path, pose: Pose, *, newest_only: bool = False) -> None:
        """Places everything at and below `path`."""
        matrix = np.eye(4)
        matrix[:3, :3] = pose.rotation()
        matrix[:3, 3] = pose.position
        self._keep(
            path,
            "transform",
            {"type": "set_transform", "matrix": matrix.T.ravel().tolist()},
            newest_only,
        )

    def show(self, path: Path, visible: bool) -> None:
        """Shows or hides everything at and below `path`."""
        self.set(path, "visible", visible)

    def set(self, path: Path, name: str, value: Any) -> None:
        """Sets a property of the object at `path`."""
        self._keep(
            path, f"property {name}", {"type": "set_property", "property": name, "value": value}
        )

    def delete(self, path: Path) -> None:
        """Deletes everything at and below `path`."""
        below = [key for key in self._kept if key[0][: len(path)] == path]
        for key in below:
            del self._kept[key]
        if below:
            self._send(umsgpack.packb({"type": "delete", "path": _text(path)}), False)

    def drawn(self, path: Path, thing: Object | None) -> bytes:
        """The message that draws `thing` at `path`, or None deletes what is there, for one browser
        alone: it is not kept.
        """
        if thing is None:
            command = {"type": "delete"}
        else:
            command = {"type": "set_object", "object": thing.lower()}
        return bytes(umsgpack.packb(command | {"path": _text(path)}))

    def messages(self) -> list[bytes]:
        """The messages that a new browser needs, objects before their properties."""
        return [
            message
            for (_, kind), message in sorted(
                self._kept.items(), key=lambda item: item[0][1] != "object"
            )
        ]

    def _keep(self, path: Path, kind: str, command: Data, newest_only: bool = False) -> None:
        message = umsgpack.packb(command | {"path": _text(path)})
        key = (path, kind)
        # A slow browser may have missed a `newest_only` message, so it is sent again.
        if self._kept.get(key) == message and not newest_only:
            return
        self._kept[key] = message
        self._send(message, newest_only)


def _text(path: Path) -> str:
    return "/" + "/".join(path)
