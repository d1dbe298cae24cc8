"""What each field of the setup screen means, and what it costs: the words for the field that has the focus. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ddenv.schemas import uses
from ddenv.workbench.setup.form import Field
from ddenv.workbench.wording import count, plain

# In place of what the scenario's model says, where a choice needs more words than it has.
WORDS = {
    "budget": "The most tests in all.",
    "seed": "Run i of every candidate uses seed + i: the same seed repeats the same runs.",
    "jobs": "How many tests run at the same time.",
    "spawn_x": "Where the robot starts, m.",
    "spawn_y": "Where the robot starts, m.",
    "spawn_z": "Height of the robot's frame at the start, m; a place picked on the map fills it in.",
    "spawn_yaw": "Heading at the start, rad, counterclockwise from x.",
    "goal_x": "Where the robot has to go, m.",
    "goal_y": "Where the robot has to go, m.",
    "name": "What the run is called: a file in the runs folder, or a path that ends in .ddenv.",
    "accept": "Whether each reduction is taken at once (automatic), or waits for your accept or reject (ask).",
    "similarity": "What makes two failures the same: where they end (end-pose), or also how they got there (trajectory).",
    "candidates": "What is tried in a round: each part, each complement (the world without the part), or both.",
    "complement_order": "Each complement after its part (paper), or those first that leave out what is farthest (far-first).",
    "growth": "When the parts become smaller: after every round (paper), or only after a round without success (steady).",
    "skip": "What is not tried: what was judged before (known), or also all that has less than it (implied).",
}
COSTS = {
    "epsilon": "Wider takes more failures for the same one; narrower misses f more often.",
    "seed": "Costs nothing.",
    "early_stop": "Saves the rest of a test that is stuck; two full runs or more at the end confirm what is left.",
    "similarity": "Costs no tests by itself; trajectory is stricter, so that less may be removed.",
    "growth": "steady mostly needs fewer tests.",
    "skip": "implied saves tests.",
    "delta": "Smaller cuts more often. Costs nothing.",
    "prior": "spatial mostly needs fewer tests.",
    "accept": "Asking costs your time, and no tests.",
}
# What only some algorithms look at.
ONLY: dict[str, tuple[str, ...]] = {
    "n_partitions": ("ddenv",),
    "candidates": ("ddenv",),
    "complement_order": ("ddenv",),
    "growth": ("ddenv",),
    "skip": ("ddenv",),
    "prior": ("probdd", "splitting"),
}
OURS = ("ddenv", "ddmin", "probdd", "splitting")


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What a cost depends on: the chosen `algorithm` and `pair`, `seconds` of real time a test, if known, and `processors`."""

    algorithm: str = "ddenv"
    pair: str = ""
    seconds: float | None = None
    processors: int = 1


def meaning(field: Field) -> str:
    """What a field is, in a sentence."""
    words = WORDS.get(field.id) or _described(field.key)
    return f"{words[:1].upper()}{words[1:].rstrip('.')}."


def _described(key: str) -> str:
    """What the scenario's model says of a key."""
    from ddenv.world.scenario import Scenario

    model, field = Scenario, None
    for part in key.split("."):
        field = model.model_fields[part]
        model = field.annotation
    return field.description or ""


def not_used(field: Field, now: Circumstances) -> str:
    """Why a field has no effect, or ""."""
    only = ONLY.get(field.id)
    if only is not None and now.algorithm in OURS and now.algorithm not in only:
        return f"Not used: {plain(now.algorithm)} does not look at it."
    segmented = now.pair.startswith("trajectoryseg/") and "partitioning" in uses(now.algorithm)
    if field.id == "delta" and not segmented:
        return "Not used: only the partitioning trajectoryseg looks at it."
    return ""


def cost(field: Field, texts: Mapping[str, str], now: Circumstances) -> str:
    """What the value that stands in a field costs, or ""."""
    number = _number(texts.get(field.id, ""))
    match field.id:
        case "iterations" if number is not None:
            return f"A candidate without f costs {count(1 + int(number), 'test')}."
        case "baseline_runs" if number is not None:
            return f"{count(int(number), 'test')} before the first round; more make the failure rate surer."
        case "timeout" if number is not None:
            real = f", here about {now.seconds:.1f} s of real time" if now.seconds else ""
            return f"A test without success takes {number:g} simulated s{real}."
        case "n_partitions" if number is not None:
            return f"The first round has up to {count(_candidates(int(number), texts), 'candidate')}."
        case "candidates":
            return "both has up to twice as many in a round; partitions alone may end far from minimal."
        case "jobs":
            return f"This machine has {count(now.processors, 'processor')}; more than that saves no time."
        case "budget":
            return "The reduction stops there with what is left then; empty is no limit."
    return COSTS.get(field.id, "")


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0 <= number < 1e6 else None


def _candidates(parts: int, texts: Mapping[str, str]) -> int:
    # Of two parts each is the other's complement.
    return 2 * parts if parts > 2 and texts.get("candidates") == "both" else parts
