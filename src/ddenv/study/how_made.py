"""How a study was made: its settings, when and on which machine it ran, what its columns mean, and how to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from ddenv.page.blocks import Block, Code, Name, Section, Table, duration, moment, say, thousands
from ddenv.settings import SETTINGS, Setting
from ddenv.study.plan import Plan
from ddenv.study.results import Found
from ddenv.study.study_folder import RUNS, Sitting
from ddenv.text import plain
from ddenv.world.scenario import Scenario

# These differ between cells.
OF_A_CELL = ("algorithm", "pair", "seed", "budget", "slice")
COLUMNS = (
    (
        "search tests",
        "runs of the robot: the baseline, and those behind each verdict of the search. Runs that idle workers made ahead of time "
        "and that were not needed do not count.",
    ),
    (
        "certificate tests",
        "runs with fresh seeds that the certificate rests on: of what is left, of that without each of its models, and of the "
        "whole world; with steps back, those of all certificates.",
    ),
    (
        "with slices",
        "the tests of another reduction, which makes no test that a finished run implies: those that were simulated, with the "
        "audits. All other columns are without slices, as the paper's.",
    ),
    ("% reduction", "the part of the models that was removed."),
    ("search minutes, certificate minutes", "the time of these tests, one after another, as the paper made its tests."),
    (
        "certified",
        "whether the certificate shows that what is left keeps the rate of f (keep rate, above), and that it does not without any "
        "one of its models.",
    ),
    ("re-runs", "the share of the search tests that repeat a candidate (the paper's deflaking)."),
    ("f in the whole world", "all runs of the whole world that ended as f did, with Wilson's 95 % interval."),
    ("f in what is left", "runs with fresh seeds that ended so, with the interval."),
    ("f without one of them", "the highest of these rates without one of the models that are left."),
    ("steps back", "how often the search went back because a certificate showed that the rate of f was lost."),
    (
        "least tests",
        "the minimum for any search: the baseline, f once in what is left, and each of its models left out without success, with "
        "as many runs as a candidate without f takes.",
    ),
)


def making(plan: Plan, found: Sequence[Found], sittings: Sequence[Sitting], folder: Path) -> Section:
    """The section on how the study was made."""
    blocks: list[Block] = [
        *_settings(plan),
        *_sittings(sittings),
        *_computed(found),
        say("What the columns mean:"),
        Table(("column", "meaning"), COLUMNS),
        *_again(plan, folder),
    ]
    return Section("How it was made", tuple(blocks))


def _settings(plan: Plan) -> list[Block]:
    """A table with a column for each scenario."""
    asked = [one for one in SETTINGS.values() if one.section != "simulation" and one.name not in OF_A_CELL]
    said = [(one.label, [_value(scenario, one) for scenario in plan.scenarios]) for one in asked if _is_used(plan, one)]
    said.append(("seeds", [", ".join(map(str, _seeds(plan, scenario))) for scenario in plan.scenarios]))
    head = ("setting", *(plain(scenario.name) for scenario in plan.scenarios))
    rows = tuple((label, *values) for label, values in said)
    return [Table(head, rows, frozenset(range(1, len(head))))]


def _is_used(plan: Plan, one: Setting) -> bool:
    """Whether any method of the study uses the setting."""
    return not one.used_by or any({method.algorithm, *method.parts} & set(one.used_by) for method in plan.methods)


def _seeds(plan: Plan, scenario: Scenario) -> list[int]:
    return sorted({cell.seed for cell in plan.cells if cell.scenario.name == scenario.name})


def _value(scenario: Scenario, one: Setting) -> str:
    value = getattr(getattr(scenario, one.section), one.name)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _sittings(sittings: Sequence[Sitting]) -> list[Block]:
    rows = tuple(
        (
            f"{moment(each.begun)} UTC",
            duration(each.seconds),
            str(each.jobs),
            thousands(each.tests),
            Name(each.machine),
            Name(each.versions),
        )
        for each in sittings
    )
    head = ("worked on", "for", "workers", "tests made", "machine", "versions")
    return [Table(head, rows, frozenset({1, 2, 3}))] if rows else []


def _computed(found: Sequence[Found]) -> list[Block]:
    """The versions, since tests of different versions may differ."""
    drake = [each for each in found if each.simulator and each.cell.scenario.oracle is None]
    versions = sorted({f"ddenv {each.version}, {each.simulator}" for each in drake})
    taken = sum(each.taken for each in found)
    words = (
        f"Computed with {versions[0]}."
        if len(versions) == 1
        else f"Different versions computed parts of it: {'; '.join(versions)}."
    )
    blocks: list[Block] = [say(words, notice=len(versions) > 1)] if versions else []
    if taken:
        blocks.append(
            say(
                f"{thousands(taken)} tests were reused from another cell with the same models and the same seed: the simulation is "
                "deterministic to the last bit. They count in each cell, with their time."
            )
        )
    return blocks


def _again(plan: Plan, folder: Path) -> list[Block]:
    # A name that begins with a dash would be an option.
    start = f"./{folder}" if str(folder).startswith("-") else folder
    example = plain(f"{start}/{RUNS}/{plan.cells[0].name}.ddenv")
    return [
        say("Each cell is a run that can be watched, continued and reported:"),
        Code((f"ddenv open {shlex.quote(example)}", f"ddenv certify {shlex.quote(example)}")),
    ]
