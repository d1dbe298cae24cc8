"""What a run was asked to do, and how it is done again."""

from __future__ import annotations

import shlex
from typing import Any

from ddenv.page.blocks import Block, Code, Name, Section, Table, plain, say, section
from ddenv.report.run_data import Record

# (title, part of the scenario, key, unit), in the order in which they are told.
TOLD = (
    ("algorithm", "reduction", "algorithm", ""),
    ("pair: partitioning/prioritization", "reduction", "pair", ""),
    ("parts in the first round", "reduction", "n_partitions", ""),
    ("candidates of each part", "reduction", "candidates", ""),
    ("order of complements", "reduction", "complement_order", ""),
    ("n grows", "reduction", "growth", ""),
    ("what is not tried again", "reduction", "skip", ""),
    ("re-runs of a candidate", "reduction", "iterations", ""),
    ("runs of the whole world", "reduction", "baseline_runs", ""),
    ("most tests in all", "reduction", "budget", ""),
    ("seed of the first run", "reduction", "seed", ""),
    ("a similar run ends within", "failure", "epsilon", "m"),
    ("what is compared", "failure", "similarity", ""),
    ("simulated time of a run", "failure", "timeout", "s"),
    ("ends when stuck for good", "failure", "early_stop", ""),
    ("who drives", "controller", "use", ""),
    ("time step", "simulation", "time_step", "s"),
    ("contact", "simulation", "contact", ""),
)
# Options of `ddenv run` by the part of the scenario and the key that they set.
OPTIONS = (
    ("algorithm", "reduction", "algorithm"),
    ("pair", "reduction", "pair"),
    ("iterations", "reduction", "iterations"),
    ("n-partitions", "reduction", "n_partitions"),
    ("candidates", "reduction", "candidates"),
    ("complement-order", "reduction", "complement_order"),
    ("growth", "reduction", "growth"),
    ("skip", "reduction", "skip"),
    ("seed", "reduction", "seed"),
    ("epsilon", "failure", "epsilon"),
    ("timeout", "failure", "timeout"),
)
LONGEST_VALUE = 120


def settings(record: Record) -> Section:
    """The section on what was asked for."""
    scenario = record.state.scenario
    rows = [_row(scenario, record.asked, *each) for each in TOLD]
    others = [("start", _place(section(scenario, "robot").get("spawn"))), ("goal", _place(scenario.get("goal")))]
    others += [("workers at the same time", str(record.state.jobs) if record.state.jobs else "")]
    if isinstance(scenario.get("oracle"), dict):
        others.append(("simulator", _value(scenario["oracle"].get("command", ""))))
    table = Table(("setting", "value"), tuple((title, Name(value)) for title, value in [*rows, *others] if value))
    blocks: list[Block] = [table]
    if dump := _dump(scenario):
        blocks.append(Code(dump, folded="The whole scenario, as YAML"))
    return Section("Settings", tuple(blocks))


def _row(scenario: dict, asked: dict, title: str, part: str, key: str, unit: str) -> tuple[str, str]:
    value = _value(section(scenario, part).get(key))
    if not value:
        return title, ""
    told = f"{value} {unit}".strip()
    first = _value(section(asked, part).get(key))
    return title, told if first == value else f"{told} (changed on the way; at first {first or 'none'})"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or isinstance(value, (dict, list)):
        return ""
    return plain(f"{value:g}" if isinstance(value, float) else value)[:LONGEST_VALUE]


def _place(values: Any) -> str:
    """x 1, y 2: what the file has of a place."""
    if not isinstance(values, dict):
        return ""
    units = {"yaw": "rad", "tolerance": "m", "x": "m", "y": "m", "z": "m"}
    told = [f"{key} {_value(value)} {units[key]}" for key, value in values.items() if key in units and _value(value)]
    return ", ".join(told)


def _dump(scenario: dict) -> tuple[str, ...]:
    import yaml

    try:
        text = yaml.safe_dump(scenario, sort_keys=False, allow_unicode=True, width=100)
    except (yaml.YAMLError, RecursionError):
        return ()
    return tuple(text.splitlines())


def repeat(record: Record) -> Section:
    """The section on what to type."""
    state, run = record.state, shlex.quote(plain(record.path))
    blocks: list[Block] = []
    if state.baseline is not None:
        kept = "minimal world" if state.minimal else "world that is left"
        blocks += [
            say(f"See the failure in the {kept}, and that it needs each of its models:"),
            Code((f"ddenv test {run} --minimal --leave-each-out",)),
            say(f"Take the {kept} elsewhere, with a scenario that runs the robot in it:"),
            Code((f"ddenv export {run} --sdf minimal.sdf --scenario minimal.yaml",)),
        ]
    again = "Reduce it again from the beginning"
    again += " (without what was decided by hand):" if state.decisions else ":"
    if not (bundled := _is_bundled(record)):
        again = f"{again[:-1]}, with the scenario's own file:"
    return Section("Repeat it", (*blocks, say(again), Code((_command(record, bundled),))))


def _is_bundled(record: Record) -> bool:
    from ddenv.world.load import bundled_names

    return record.asked.get("name") in bundled_names()


def _command(record: Record, bundled: bool) -> str:
    """`ddenv run` with what was asked for first, whatever the scenario's file says today."""
    name = plain(record.asked.get("name", "scenario"))
    words = ["ddenv", "run", name if bundled else f"{name}.yaml"]
    for option, part, key in OPTIONS:
        if value := _value(section(record.asked, part).get(key)):
            words += [f"--{option}", value]
    early = section(record.asked, "failure").get("early_stop")
    if isinstance(early, bool):
        words.append("--early-stop" if early else "--no-early-stop")
    return shlex.join(words)
