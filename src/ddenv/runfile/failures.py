"""The words for how a robot failed, and what to say with each."""

from __future__ import annotations

# Each word that a test's `failure` may be, as what the robot did. What is none of them is why the simulation broke.
DEEDS = {
    "stuck": "got stuck",
    "tipped over": "tipped over",
    "fell": "fell",
    "lost": "was lost",
    "out of time": "ran out of time",
}
# What files of versions 1 and 2 say of every robot that did not fall.
_EARLIER = {"timeout": "out of time"}


def as_now(failure: str) -> str:
    """A word of an older file as it is today."""
    return _EARLIER.get(failure, failure)


def deed(failure: str) -> str:
    """What the robot did, such as "tipped over"; "failed" where nothing more is known."""
    return DEEDS.get(failure, "failed")
