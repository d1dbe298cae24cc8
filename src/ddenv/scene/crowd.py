"""Large worlds: thousands of models that never move, drawn as a few objects, which a browser can show at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from meshcat.geometry import Object

from ddenv.scene import colors
from ddenv.scene.painted import Painted, lines, merged
from ddenv.scene.shot import Shot
from ddenv.scene.stage import Path

# With more elements than this, those that never move are drawn together. A browser takes some 10 ms for each object of its own.
MOST_SINGLE = 300


class Crowd:
    """The still elements of a large world: the surfaces of each one, and the ends of its edges."""

    def __init__(self, models: Path, left_out: Path, removed: Path) -> None:
        self._paths = models, left_out, removed
        self._painted: dict[str, list[Painted]] = {}
        self._edges: dict[str, np.ndarray] = {}

    def add(self, name: str, painted: list[Painted], edges: np.ndarray | None) -> None:
        """Adds a model; `edges` (N, 3) come for all elements, also for those that are drawn by themselves."""
        self._painted[name] = painted
        if edges is not None:
            self._edges[name] = edges

    def objects(self, shot: Shot) -> Iterator[tuple[Path, Object | None]]:
        """What shows the environment of `shot`; None where nothing is left to show."""
        models, left_out, removed = self._paths
        parts = [item for name, items in self._painted.items() if name in shot.models for item in items]
        solid = merged([item for item in parts if item.alpha == 1])
        clear = merged([item for item in parts if item.alpha < 1])
        yield (*models, "still"), solid
        yield (*models, "still clear"), clear
        yield (*left_out, "all"), self._outlines(shot.left_out, colors.LEFT_OUT)
        yield (*removed, "all"), self._outlines(shot.removed, colors.REMOVED)

    def _outlines(self, names: Iterable[str], color: colors.Color) -> Object | None:
        ends = [self._edges[name] for name in sorted(names) if name in self._edges]
        return lines(np.concatenate(ends), color) if ends else None
