"""numpy, which is loaded when something of it is first used: a first paint needs none of it, and it takes longest to load."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    import numpy

    value = globals()[name] = getattr(numpy, name)
    return value
