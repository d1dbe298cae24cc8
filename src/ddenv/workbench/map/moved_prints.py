"""The models of a place as they move: only those that have moved since the last look are drawn anew."""

from __future__ import annotations

from collections.abc import Mapping

from ddenv.map.footprints import Footprint, footprint
from ddenv.workbench.map.place import Place
from ddenv.world.pose import Pose


class MovedPrints:
    """The footprints of a place's models, with the movable ones wherever they are."""

    def __init__(self, place: Place) -> None:
        self.place = place
        self._prints = place.prints
        self._numbers = {each.name: number for number, each in enumerate(place.prints) if each.name in place.movable}
        self._poses: dict[str, Pose] = {}

    def at(self, poses: Mapping[str, Pose]) -> tuple[Footprint, ...]:
        """All footprints with the first links of these models at `poses`, and the others where they start.

        The same object if nothing has moved.
        """
        known = {name: pose for name, pose in poses.items() if name in self._numbers}
        changed = {
            self._numbers[name]: self.place.prints[self._numbers[name]] for name in set(self._poses) - set(known)
        }
        for name, pose in known.items():
            if pose != self._poses.get(name):
                model = self.place.movable[name]
                changed[self._numbers[name]] = footprint(model, moved=pose @ model.links[0].pose.inverse())
        self._poses = known
        if changed:
            self._prints = tuple(changed.get(number, each) for number, each in enumerate(self._prints))
        return self._prints
