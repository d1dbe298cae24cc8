"""Short ways to write worlds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from ddenv.world.model import World
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import parse_world

BOX = "<collision name='c'><geometry><box><size>1 2 3</size></box></geometry></collision>"


def world_text(inside: str, version: str = "1.9") -> bytes:
    return f"<sdf version='{version}'><world name='w'>{inside}</world></sdf>".encode()


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., World]:
    """Reads what stands inside a `<world>`; other files are looked for in the test's own folder."""

    def make(inside: str, /, version: str = "1.9", **reading) -> World:
        return parse_world(world_text(inside, version), tmp_path / "here.sdf", Reading(**reading))

    return make
