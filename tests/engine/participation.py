"""A simulator in which a run looks at some models, one after another: these take part, and no
others.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

from tests.conftest import DATA
from tests.engine.fake import FakePool, new_run

MODELS = tuple(f"box_{number}" for number in range(24))
Keep = frozenset[str]


def wide_world(folder: Path) -> Path:
    """A world of `MODELS`, of which one can move: so the simulator is asked for ties."""
    before, _ = (DATA / "wall.sdf").read_text().split('<model name="wall">')
    inertial = "<inertial><mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>"
    collision = (
        '<collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision>'
    )
    boxes = "".join(
        f'<model name="{name}"><static>{str(number > 0).lower()}</static><pose>{2 + number % 6} '
        f"{number // 6 - 2} 0.3 0 0 0</pose>"
        f'<link name="link">{inertial}{collision}</link></model>'
        for number, name in enumerate(MODELS)
    )
    path = folder / "wide.sdf"
    path.write_text(f"{before}{boxes}</world></sdf>")
    return path


@dataclass(frozen=True)
class Participation:
    """f shows where all of `needed` are there, in `tenths` of ten runs. Where a tie is broken, a
    model falls at once.

    A run also looks at `looks` other models, and what it finds decides where it looks next. Of
    `hidden` models it does not say that they took part.
    """

    salt: int
    needed: tuple[str, ...]
    ties: tuple[tuple[str, str], ...] = ()
    tenths: int = 10
    looks: int = 3
    hidden: Keep = frozenset()

    def run(self, keep: Keep, seed: int) -> tuple[str, Keep, int]:
        """The outcome, what took part, and all bits in one number."""
        broken = [name for name, other in self.ties if name in keep and other not in keep]
        bits, met = crc32(f"{self.salt} {seed} {broken}".encode()), set[str]()

        def finds(name: str) -> bool:
            nonlocal bits
            bits = crc32(f"{bits} {name} {name in keep}".encode())
            met.update({name} & keep)
            return name in keep

        met.update(broken)
        for _ in range(self.looks):
            # Few of them are near the robot's way.
            finds(MODELS[bits % 97 % 9])
        outcome = (
            "similar"
            if all(finds(name) for name in self.needed) and bits % 10 < self.tenths
            else "pass"
        )
        return "other" if outcome == "pass" and bits % 7 == 0 else outcome, frozenset(met), bits

    def pool(self, jobs: int = 1, seed: int = 0) -> FakePool:
        return self.told(FakePool(self.outcome, jobs, seed))

    def outcome(self, keep: Keep, seed: int) -> str:
        return self.run(keep, seed)[0]

    def senses(self, keep: Keep, seed: int) -> dict[str, float]:
        """When each model is in view. For models that did not affect the run this differs between
        worlds with equal runs.
        """
        met = self.run(keep, seed)[1]
        order = {
            name: crc32(f"{seed} {name} {'' if name in met else sorted(keep)}".encode()) % 100
            for name in keep
        }
        return {name: place / 10 for name, place in order.items() if name in met or place % 2}

    def told(self, pool: FakePool) -> FakePool:
        """A pool that knows who took part."""
        pool.sensed = self.senses
        pool.took_part = lambda keep, seed: self.run(keep, seed)[1] - self.hidden
        pool.aside = lambda keep, seed: self.run(keep, seed)[2] / 2**32
        pool.ties = list(self.ties)
        pool.moves = frozenset(MODELS[-2:])
        return pool


def sliced_run(folder: Path, **reduction) -> Path:
    """A run of the wide world that may use slices."""
    return new_run(folder, **{"world": wide_world(folder), "slice": True} | reduction)
