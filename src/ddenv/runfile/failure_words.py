"""What the robot did in a test that did not reach its goal, in words."""

from __future__ import annotations

from collections.abc import Sequence

from ddenv.text import coordinates

# What the robot did, by the `failure` of a test. Any other `failure` says why the simulation broke.
DEEDS = {
    "stuck": "got stuck",
    "tipped over": "tipped over",
    "fell": "fell",
    "lost": "was lost",
    "out of time": "ran out of time",
}


def deed(failure: str) -> str:
    """What the robot did, such as "tipped over"; "failed" if nothing more is known."""
    return DEEDS.get(failure, "failed")


def named(kinds: Sequence[str], position: Sequence[float]) -> str:
    """A failure in words, such as "stuck at (5.42, -0.56)"."""
    how = " or ".join(kind if kind in DEEDS else "failed" for kind in kinds) or "failed"
    return f"{how} at ({coordinates(position[:2])})"
