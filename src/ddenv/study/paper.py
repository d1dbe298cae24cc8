"""The numbers of the paper's Tables II to IV."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.study.plan import Cell


@dataclass(frozen=True, slots=True)
class Theirs:
    """A row of the paper: tests, which part of the models was removed, and minutes."""

    tests: int
    smaller: float
    minutes: int


TABLES = {"ditch": "II", "rubble": "III", "friction": "IV"}
_ROWS = {
    "ditch": {
        "model2model/failure-proximal": Theirs(268, 0.84, 420),
        "model2model/avg-trajectory-proximal": Theirs(82, 0.95, 108),
        "timeseg/avg-trajectory-proximal": Theirs(359, 0.84, 487),
    },
    "rubble": {
        "model2model/failure-proximal": Theirs(179, 0.81, 274),
        "model2model/avg-trajectory-proximal": Theirs(178, 0.78, 277),
        "timeseg/avg-trajectory-proximal": Theirs(162, 0.89, 231),
    },
    "friction": {
        "model2model/failure-proximal": Theirs(727, 0.44, 1098),
        "model2model/avg-trajectory-proximal": Theirs(116, 0.76, 183),
        "timeseg/avg-trajectory-proximal": Theirs(430, 0.68, 641),
    },
}


def theirs(cell: Cell) -> Theirs | None:
    """What the paper has for a cell; None where it has nothing."""
    if cell.method.algorithm != "ddenv":
        return None
    return _ROWS.get(cell.scenario.name, {}).get(cell.method.pair)
