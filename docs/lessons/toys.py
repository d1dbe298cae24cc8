"""The toy worlds of the lessons, and the runs that are recorded in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

SIMULATOR = "driving.py"
# Name, x, y, size along x and y, m; a model may have several boxes, and so several entries.
Box = tuple[str, float, float, float, float]


@dataclass(frozen=True)
class Toy:
    """A world of boxes in which a robot drives by a `rule`, a file beside this one. `walls` always
    stay.
    """

    rule: str
    walls: tuple[Box, ...]
    models: tuple[Box, ...]
    scenario: dict[str, Any]

    @property
    def names(self) -> tuple[str, ...]:
        """The models that can be removed."""
        return tuple(dict.fromkeys(name for name, *_ in self.models))


_YARD_WALLS = (
    ("wall_left", 0, 2.6, 14, 0.3),
    ("wall_right", 0, -2.6, 14, 0.3),
    ("island", 1, 0, 4.6, 0.5),
)
_YARD_MODELS = (
    ("bench", -5.2, 1.6, 1.2, 0.6),
    ("sign", -2.9, 1.9, 0.4, 0.4),
    ("plant", -3.9, -1.9, 0.7, 0.7),
    ("crate", 0.75, 1.4, 0.5, 1.8),
    ("barrel", 1.5, 1.85, 0.9, 0.9),
    ("cone", 1.5, 0.85, 0.7, 0.7),
    ("pallet", 1.9, -1.4, 1.2, 1.8),
    ("bin", 5.2, -1.7, 0.8, 0.8),
)
_MORE_OF_YARD = (
    ("hedge", -5.9, 2.2, 0.5, 0.4),
    ("lamp", -4.2, 2.2, 0.3, 0.3),
    ("bike", -4.3, 1.4, 0.8, 0.3),
    ("hose", -5.6, -2.2, 0.6, 0.3),
    ("ladder", -4.9, -1.5, 0.8, 0.3),
    ("bucket", -2.4, -2.2, 0.3, 0.3),
    ("tarp", -1.6, 2.25, 0.6, 0.3),
    ("post", -0.6, 2.3, 0.2, 0.2),
    ("drum", -1.2, -2.2, 0.4, 0.4),
    ("bricks", 0.2, -2.25, 0.6, 0.3),
    ("pump", 2.7, 2.2, 0.4, 0.4),
    ("tyre", 3.0, -2.25, 0.4, 0.3),
    ("cart", 3.9, 2.1, 0.7, 0.5),
    ("sack", 4.2, -2.2, 0.4, 0.3),
    ("planks", 5.0, 1.9, 1.0, 0.3),
    ("shelf", 5.9, 1.2, 0.3, 0.8),
)


def _scenario(name: str, description: str, rule: str, **sections: dict[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "description": description,
        "world": "world.sdf",
        "robot": {"model": "robot.sdf", "spawn": {"x": -6.0, "y": 0.0, "z": 0.2}},
        "goal": {"x": 6.0, "y": 0.0, "tolerance": 0.3},
        "oracle": {"command": f"./{SIMULATOR} {rule} {{world}} {{seed}}"},
        "failure": {"timeout": 40, "epsilon": 0.5},
        **sections,
    }


_DELIVERY = (
    "A delivery robot drives from one end of a yard to the other. It gets stuck in the left lane."
)
DELIVERY = Toy(
    "delivery",
    _YARD_WALLS,
    _YARD_MODELS,
    _scenario(
        "delivery",
        _DELIVERY,
        "delivery",
        reduction={"as_printed": True, "baseline_runs": 3, "iterations": 1},
    ),
)
# In this yard nothing is random: one run settles a candidate.
YARD = Toy(
    "delivery",
    _YARD_WALLS,
    (*_YARD_MODELS, *_MORE_OF_YARD),
    _scenario(
        "yard",
        _DELIVERY,
        "delivery",
        reduction={"accept_rate": "first", "baseline_runs": 1, "iterations": 0},
    ),
)
_SIGN = tuple(box for box in YARD.models if box[0] == "sign")
# The same yard, with a sign that always stays: all that f needs then is near to where the robot
# gets stuck.
NAILED = replace(
    YARD, walls=(*YARD.walls, *_SIGN), models=tuple(box for box in YARD.models if box not in _SIGN)
)
QUAY = Toy(
    "quay",
    (("kerb_left", 0, 2.6, 14, 0.3), ("kerb_right", 0, -2.6, 14, 0.3)),
    (
        ("bench", -4.9, 1.8, 1.2, 0.6),
        ("bin", -4.3, -1.8, 0.7, 0.7),
        ("oil", -3.2, 0.0, 1.0, 0.8),
        ("plant", -1.9, 1.8, 0.7, 0.7),
        ("ramp", -0.7, 0.0, 0.9, 1.2),
        ("barrel", 0.5, -1.8, 0.8, 0.8),
        ("gate", 2.2, 0.65, 0.2, 0.5),
        ("gate", 2.2, -0.65, 0.2, 0.5),
        ("cone", 2.4, 1.9, 0.5, 0.5),
        ("pallet", 3.6, -1.7, 1.1, 0.8),
        ("crate", 4.5, 0.7, 0.6, 0.6),
        ("lamp", 5.3, 1.9, 0.3, 0.3),
    ),
    _scenario(
        "quay", "A robot drives along a quay. Off its line it gets stuck at the gate.", "quay"
    ),
)
TOYS = {"delivery": DELIVERY, "yard": YARD, "nailed": NAILED, "quay": QUAY}
