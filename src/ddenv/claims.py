"""What a run may claim of its result, in words: made here alone, from the runs that show it, with their number and interval."""

from __future__ import annotations

from ddenv.runfile.progress import Certificate, Claim
from ddenv.runfile.state import RunState
from ddenv.words import count, first_of, percent

MOST_NAMES = 3


def is_minimal(certificate: Certificate) -> bool:
    """Whether a certificate shows that what is left keeps the rate, and that each model in it is needed."""
    claims = certificate.claims
    return bool(claims) and all(claim.verdict == ("kept" if claim.without is None else "needed") for claim in claims)


def verdict_on(certificate: Certificate, pinned: int = 0, each: str = "single model") -> str:
    """What a finished certificate shows, in one sentence without a full stop.

    `pinned` models could not be left out; `each` is what was left out at a time.
    """
    left, *removals = certificate.claims
    share = percent(certificate.keep_rate)
    if left.verdict == "lost":
        return f"f is too rare in what is left: {rate(left)}; it has to keep {share} of {_whole_rate(certificate)}"
    if left.verdict != "kept":
        return f"not shown that what is left keeps {share} of {_whole_rate(certificate)}: {rate(left)}"
    for word, start in (
        ("unknown", "not shown that each model is needed: tests broke without"),
        ("not shown", "not shown that each model is needed: undecided without"),
        ("not needed", "not minimal: f shows as often without"),
    ):
        names = [claim.without for claim in removals if claim.verdict == word and claim.without is not None]
        if names:
            return f"{start} {first_of(names, MOST_NAMES)}; with all that is left {rate(left)}"
    but = f" except pinned ones ({pinned})" if pinned else ""
    if not removals:
        return f"nothing is left that can be removed{but}: {rate(left)}"
    most = max(removals, key=lambda claim: claim.high)
    return f"no {each} can be removed{but}: {rate(left)}; without any one of them at most {rate(most)}"


def rate(claim: Claim) -> str:
    """How often a claim's runs showed f: "f in 23 of 23 fresh runs (86 % to 100 %)"."""
    interval = f" ({percent(claim.low)} to {percent(claim.high)})" if claim.runs else ""
    return f"f in {claim.shown} of {count(claim.runs, 'fresh run')}{interval}"


def meaning(claim: Claim, certificate: Certificate) -> str:
    """What the verdict of a claim means, in plain words."""
    rate = f"{percent(certificate.keep_rate)} of {_whole_rate(certificate)}"
    share = rate.removesuffix(" rate")
    return {
        "kept": f"keeps {rate}",
        "lost": f"has lost the rate: below {share}",
        "needed": f"needed: without it the rate falls below {share}",
        "not needed": f"not needed: without it the rate keeps {share}",
        "not shown": "not shown: the runs do not decide",
        "unknown": "unknown: too many runs broke",
    }.get(claim.verdict, "")


def _whole_rate(certificate: Certificate) -> str:
    """The rate that what is left has to keep a part of."""
    return "the rate where its branch begins" if certificate.branch else "the whole world's rate"


def current(state: RunState) -> Certificate | None:
    """The finished certificate of the current environment, if there is one."""
    last = state.certificate
    return last if last is not None and last.claims else None
