"""What the browsers show: a tree of drawn things by path, as messages of Meshcat's protocol.

The stage remembers the newest message of each kind for each path, so that a browser that comes later gets the whole scene.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import umsgpack
from meshcat.geometry import Object

from ddenv.world.pose import Pose

Path = tuple[str, ...]
# Under every path the viewer keeps the drawn thing itself in a child of this name.
DRAWN = "<object>"


class Stage:
    """`send(message, newest_only)` passes a message on to the browsers; a `newest_only` one may be dropped by a slow browser."""

    def __init__(self, send: Callable[[bytes, bool], None]) -> None:
        self._send = send
        self._kept: dict[tuple[Path, str], bytes] = {}

    def draw(self, path: Path, thing: Object, *, shadow: bool = True) -> None:
        """Puts `thing` at `path`, in place of what is drawn there."""
        self._keep(path, "object", {"type": "set_object", "object": thing.lower()})
        # The viewer lets every new thing cast a shadow: what was set before on the old one is lost there.
        self._kept.pop(((*path, DRAWN), "property castShadow"), None)
        self.set((*path, DRAWN), "castShadow", shadow)

    def draw_json(self, path: Path, thing: dict[str, Any]) -> None:
        """As `draw`, for one of three.js's objects that needs neither geometry nor material, such as a light."""
        metadata = {"version": 4.5, "type": "Object"}
        self._keep(path, "object", {"type": "set_object", "object": {"metadata": metadata, "object": thing}})

    def move(self, path: Path, pose: Pose, *, newest_only: bool = False) -> None:
        """Places what is at and below `path`."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.rotation(), pose.position
        self._keep(path, "transform", {"type": "set_transform", "matrix": matrix.T.ravel().tolist()}, newest_only)

    def show(self, path: Path, visible: bool) -> None:
        """Shows or hides what is at and below `path`."""
        self.set(path, "visible", visible)

    def set(self, path: Path, name: str, value: Any) -> None:
        """Sets a property of what is at `path`."""
        self._keep(path, f"property {name}", {"type": "set_property", "property": name, "value": value})

    def delete(self, path: Path) -> None:
        """Takes away what is at and below `path`."""
        below = [key for key in self._kept if key[0][: len(path)] == path]
        for key in below:
            del self._kept[key]
        if below:
            self._send(umsgpack.packb({"type": "delete", "path": _text(path)}), False)

    def messages(self) -> list[bytes]:
        """All that a new browser needs, things before their properties."""
        return [message for (_, kind), message in sorted(self._kept.items(), key=lambda item: item[0][1] != "object")]

    def _keep(self, path: Path, kind: str, command: dict[str, Any], newest_only: bool = False) -> None:
        message = umsgpack.packb(command | {"path": _text(path)})
        key = (path, kind)
        # A message that a slow browser may have missed is sent again.
        if self._kept.get(key) == message and not newest_only:
            return
        self._kept[key] = message
        self._send(message, newest_only)


def _text(path: Path) -> str:
    return "/" + "/".join(path)
