"""What every sign and letter on the run's screens means, in one list: one key away from each of
them.
"""

from __future__ import annotations

from typing import ClassVar

from ddenv.runfile import branches
from ddenv.words.signs import CLAIM, DROPS, OUTCOME, STATUS, VERDICT
from ddenv.workbench.help.dialogs import Reading
from ddenv.workbench.map.map_words import LEGEND, MORE_SIGNS, NO_PART, OF_WAYS, PARTS
from ddenv.workbench.shared.bindings import keys

Signs = tuple[tuple[str, str], ...]


def signs() -> dict[str, Signs]:
    claims: dict[str, list[str]] = {}
    for verdict, sign in CLAIM.items():
        claims.setdefault(sign, []).append(verdict)
    return {
        "On the map": (
            PARTS,
            (
                "a b",
                "not in the candidate shown; with the layer participants: no effect on the run",
            ),
            *(sign for sign in MORE_SIGNS if sign not in (PARTS, NO_PART)),
            *LEGEND,
        ),
        "On the map of tests played back": (*OF_WAYS, ("a", "in only one of the two")),
        "On the time of a test": (
            ("●", "the instant shown"),
            ("┤", "its end"),
            ("▾", "touches a model"),
            OF_WAYS[-1],
        ),
        "On the chart": (
            ("╌", "at least this many models seem to be needed"),
            ("▲", "you decided something"),
        ),
        "How a test ended": (*_split(OUTCOME), ("▶", "running")),
        "Verdicts of candidates": (
            *_split(VERDICT),
            (DROPS, "it drops a model that rests on one that is gone"),
        ),
        "Verdicts of a certificate": tuple(
            (sign, " or ".join(words)) for sign, words in claims.items()
        ),
        "What a certificate has shown": (
            ("≥", "what is left keeps at least this share of the rate of f"),
            ("≤", "without the model f shows at most this often, as a share of the rate with it"),
            ("whole, missed", "the whole world, with the seeds for which what is left missed f"),
            ("step 3", "what was left after reduction 3: the history has its number"),
        ),
        "States of a run": tuple((sign, words) for sign, words in STATUS.values()),
        "In the history": (
            (branches.HERE, "where the run is"),
            (branches.MINIMAL, "a minimal environment"),
            (branches.REJECTED, "taken back, or f is too rare in it"),
            (branches.OTHER, "another environment that the run reached"),
        ),
        "In the status line": (
            ("◂", "an earlier moment of the run is shown"),
            ("▼", "f is rarer than it should be"),
        ),
    }


def _split(words: dict[str, str]) -> Signs:
    return tuple((each[0], each[2:]) for each in words.values())


class SignsDialog(Reading):
    """All signs with their meanings."""

    BINDINGS: ClassVar = keys(
        "signs", ("close", "escape,k,q,enter", "dismiss", "close", "close this dialog")
    )

    def __init__(self) -> None:
        super().__init__("Signs", signs().items())
