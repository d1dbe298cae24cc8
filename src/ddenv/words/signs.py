"""Signs and short words: for how a run stands, how a test ended, and the verdicts of candidates and
claims.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ddenv.runfile.failure_words import DEEDS
from ddenv.runfile.state import Test
from ddenv.text import shortened

SETTLING = "finding models that support others"
# Every status and verdict has its own sign, so that nothing depends on colour alone.
STATUS = {
    "created": ("○", "not started"),
    "starting": ("◌", "engine starts"),
    "settling": ("▶", SETTLING),
    "baseline": ("▶", "baseline"),
    "running": ("▶", "running"),
    "certifying": ("▶", "certificate"),
    "isolating": ("▶", "isolation"),
    "margins": ("▶", "margins"),
    "paused": ("‖", "paused"),
    "waiting": ("?", "waiting"),
    "finished": ("■", "finished"),
    "stopped": ("□", "stopped"),
    "failed": ("✗", "failed"),
    "lost": ("✗", "engine is gone"),
}
OUTCOME = {
    "similar": "● similar",
    "other": "◇ other failure",
    "pass": "○ pass",
    "error": "✗ error",
    "timeout": "◷ timeout",
    "failed": "◆ failed",
    "lost": "– lost",
}
VERDICT = {
    "similar": "● similar",
    "missed": "○ missed",
    "dissimilar": "○ dissimilar",
    "unknown": "✗ unknown",
    "vetoed": "⊘ vetoed",
    "rejected": "✗ rejected",
    "undone": "↶ undone",
}
# The signs of the verdicts of a certificate.
CLAIM = {
    "kept": "●",
    "exact": "●",
    "lost": "✗",
    "needed": "●",
    "helps": "◐",
    "rarer": "◐",
    "not needed": "○",
    "not shown": "?",
    "unknown": "✗",
}
# How a run came to an environment, by the `how` of its node: in few words, and in a line.
CAME_BY = {
    "start": ("", "where the run began"),
    "reduced": ("", "reduced to what shows f"),
    "adopted": ("adopted by hand", "a try by hand that showed f"),
    "accepted": ("another failure, accepted by hand", "another failure, accepted as f, too"),
    "instead": ("a branch to its failure", "a branch: the failure of this test is f here"),
    "certified": ("by a certificate", "reduced by a certificate: fresh runs show f as often"),
    "left_out": ("left out by hand", "left out by hand: it only helped (certificate)"),
    "sliced": ("without a test", "reduced to the models that affected runs"),
}
# What would fall once one of its supports is gone, on the map and in the table.
DROPS = "↓"
_SIGNED = ("similar", "other", "pass", "error", "timeout", "failed")


def bar(part: float, aim: float) -> str:
    """A share as a bar of 20 cells, with a mark where it has to come."""
    filled = round(part * 20)
    mark = min(19, round(aim * 20))
    cells = f"{'█' * filled:░<20}"
    return f"{cells[:mark]}┃{cells[mark + 1 :]}"


def signs(counts: Mapping[str, int]) -> str:
    """How tests ended, in signs with their counts, from the number of each outcome."""
    said = [f"{counts[name]}{OUTCOME[name][0]}" for name in _SIGNED if counts.get(name)]
    spaced = " ".join(said)
    if len(spaced) < 9:
        return spaced
    return "".join(said)


def outcome(test: Test) -> str:
    """How a test ended, with the kind of failure if known."""
    words = OUTCOME.get(test.outcome, "")
    if words and test.failure in DEEDS:
        return f"{words[0]} {test.failure}"
    return words


def brief(seconds: float) -> str:
    """`seconds` in a maximum of seven characters: 0.4 s, 312 s, 25 min, 3 h."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    if seconds < 599.5:
        return f"{seconds:.0f} s"
    if seconds < 36_000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h"


def simulated(seconds: float | None, timeout: float) -> str:
    """How far a running test is, in simulated time, marked so that it is not taken for real
    time.
    """
    if seconds is None:
        return ""
    return f" {seconds:.1f}/{timeout:g} s"


def metres(value: Any, digits: int = 1) -> str:
    """A distance in m, or "" for None."""
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        return ""
    return f"{value:.{digits}f} m"


def dropping(names: Sequence[str], width: int) -> str:
    """That models drop, the first one by a name of at most `width` cells; "" for none."""
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    if names:
        return f"drops {shortened(names[0], width)}{more}"
    return ""
