"""The cost of a field's value on the setup screen, and why a field has no effect. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ddenv.text import plain
from ddenv.workbench.setup.form import Field
from ddenv.workbench.shared.wording import count

OURS = ("ddenv", "ddmin", "probdd", "splitting")


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What a cost depends on: the chosen `algorithm` and `pair`, `seconds` of real time a test, if known, and `processors`."""

    algorithm: str = "ddenv"
    pair: str = ""
    seconds: float | None = None
    processors: int = 1


def not_used(field: Field, now: Circumstances) -> str:
    """Why a field has no effect, or ""."""
    only = field.setting.used_by if field.setting else ()
    if only and now.algorithm in OURS and now.algorithm not in only:
        return f"Not used by {plain(now.algorithm)}."
    return ""


def cost(field: Field, texts: Mapping[str, str], now: Circumstances) -> str:
    """The cost of a field's value, or ""."""
    number = _number(texts.get(field.id, ""))
    match field.id:
        case "iterations" if number is not None:
            return f"A candidate without f costs at most {count(1 + int(number), 'test')}."
        case "baseline_runs" if number is not None:
            return f"Costs {count(int(number), 'test')}; more make the failure rate more certain."
        case "timeout" if number is not None:
            real = f", here about {now.seconds:.1f} s of real time" if now.seconds else ""
            return f"A test without success takes {number:g} simulated s{real}."
        case "jobs":
            return f"This machine has {count(now.processors, 'processor')}; more jobs save no time."
        case "accept":
            return "Asking costs your time, and no tests."
    return field.setting.cost if field.setting else ""


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0 <= number < 1e6 else None
