"""What is well and what is not: this installation, this machine, and one run file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Finding:
    """`says` what is so about `what`; `state` is "ok", "note" (worth knowing) or "wrong"; `advice`
    is what to do about it.
    """

    group: str
    what: str
    says: str
    state: str = "ok"
    advice: str = ""


def is_well(findings: Iterable[Finding]) -> bool:
    """Whether nothing is wrong."""
    return all(finding.state != "wrong" for finding in findings)
