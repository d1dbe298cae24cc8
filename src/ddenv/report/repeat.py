"""The settings of a run, and the commands that repeat it."""

from __future__ import annotations

import shlex
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from ddenv.page.blocks import Block, Code, Name, Section, Table, say, section
from ddenv.report.run_data import Record
from ddenv.settings import JOBS, OPTIONS, PRINTED, SETTINGS, read
from ddenv.text import plain
from ddenv.world.access import ending_of
from ddenv.world.load import bundled_names

LONGEST_VALUE = 120
# Settings of our own simulation; a simulator of the user's own has others.
OF_DRAKE = ("time_step", "contact")


def settings(record: Record) -> Section:
    scenario = record.state.scenario
    jobs = record.state.jobs
    oracle = section(scenario, "oracle")
    rows: list[tuple[str, Name, str]] = []
    for one in SETTINGS.values():
        if (one.name in section(scenario, one.section) or not one.stored) and not (
            oracle and one.name in OF_DRAKE
        ):
            # With the first value, if it was changed during the run.
            now, first = (
                value_words(read(each, one)) or one.none for each in (scenario, record.asked)
            )
            value = now if first == now else f"{now} (changed during the run; initially {first})"
            rows += [(one.label, Name(value), one.meaning)] if value else []
    rows += [(JOBS.label, Name(str(jobs)), JOBS.meaning)] if jobs else []
    blocks: list[Block] = [Table(("setting", "value", "meaning"), rows)]
    with suppress(yaml.YAMLError, RecursionError):
        dump = yaml.safe_dump(scenario, sort_keys=False, allow_unicode=True, width=100)
        blocks.append(Code(tuple(dump.splitlines()), folded="The whole scenario, as YAML"))
    return Section("Settings", tuple(blocks))


def value_words(value: Any) -> str:
    """The value of a setting as people write it; "" for none."""
    if isinstance(value, bool):
        if value:
            return "yes"
        return "no"
    if value is None or isinstance(value, (dict, list)):
        return ""
    return plain(f"{value:g}" if isinstance(value, float) else value)[:LONGEST_VALUE]


def repeat(record: Record) -> Section:
    state = record.state
    run = shlex.quote(plain(record.path))
    blocks: list[Block] = []
    if state.baseline is not None:
        kept = "minimal world" if state.certified else "world that is left"
        world = f"minimal{ending_of(Path(str(state.scenario.get('world', ''))))}"
        blocks += [
            say(f"Show the failure in the {kept}, and that each of its models is needed:"),
            Code((f"ddenv test {run} --minimal --leave-each-out",)),
            say("Run it more often with fresh seeds, for a narrower interval:"),
            Code((f"ddenv certify {run} --runs 100",)),
            say(f"Take the {kept} elsewhere, with a scenario that runs the robot in it:"),
            Code((f"ddenv export {run} --sdf {world} --scenario minimal.yaml",)),
        ]
    again = "Reduce it again from the beginning"
    again += " (without the decisions made by hand):" if state.decisions else ":"
    # With options, if it is a bundled scenario with no other changes.
    without = (one for one in SETTINGS.values() if one.section == "reduction" and not one.option)
    usual = PRINTED if read(record.asked, SETTINGS["as_printed"]) else {}
    others = [one for one in without if read(record.asked, one) != usual.get(one.name, one.default)]
    bundled = record.asked.get("name") in bundled_names() and not others
    if not bundled:
        again = f"{again[:-1]}, with the scenario's own file:"
    # The first settings, even if the scenario's file has changed since.
    name = plain(record.asked.get("name", "scenario"))
    words = ["ddenv", "run", name if bundled else f"{name}.yaml"]
    for one in OPTIONS:
        if one.name in section(record.asked, one.section) or (bundled and not one.stored):
            words += one.words(read(record.asked, one))
    return Section("Repeat it", (*blocks, say(again), Code((shlex.join(words),))))
