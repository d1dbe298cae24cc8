"""The pages of a study: the result in a few words, a section for each scenario, a comparison of methods, how it was made."""

from __future__ import annotations

import csv
import io
import shlex
from collections.abc import Sequence
from pathlib import Path
from statistics import mean

import yaml

from ddenv import __version__
from ddenv.page.blocks import (
    Block,
    Code,
    Name,
    Paragraph,
    Report,
    Section,
    Table,
    duration,
    moment,
    percent,
    say,
    thousands,
)
from ddenv.page.html import html
from ddenv.page.markdown import markdown, pictures
from ddenv.settings import SETTINGS, Setting
from ddenv.study.plan import Plan
from ddenv.study.results import Found, groups, least_of, least_to_find, least_to_show, read_cell, theirs
from ddenv.study.study_folder import RUNS, Sitting, run_path
from ddenv.study.tables import best, section
from ddenv.text import count, plain
from ddenv.world.access import write_file
from ddenv.world.scenario import Scenario

STEM = "study"
# These differ between cells.
OF_A_CELL = ("algorithm", "pair", "seed", "budget", "slice")
# What the columns of the tables mean.
COLUMNS = Path(__file__).with_name("columns.yaml")


def content(plan: Plan, found: Sequence[Found], sittings: Sequence[Sitting], folder: Path) -> Report:
    """The page of a study; `found` are the cells of `plan` in its order."""
    rows = groups(plan, found)
    minimal = [each for each in found if each.minimal]
    sections = [best(rows), *(section(folder, group) for group in rows), making(plan, found, sittings, folder)]
    return Report(
        name="ddenv study",
        verdict=_verdict(found, minimal),
        lead=tuple(_lead(found, minimal)),
        figures=_figures(found, minimal, sittings),
        sections=tuple(each for each in sections if each is not None),
        foot=f"Written by ddenv {__version__}. Lengths in m, times in UTC.",
    )


def _verdict(found: Sequence[Found], minimal: Sequence[Found]) -> str:
    if not minimal:
        open_ones = any(not each.ended for each in found)
        return f"None of {count(len(found), 'world')} is minimal{' yet' if open_ones else ''}"
    every = "Every" if len(minimal) == len(found) else f"{len(minimal)} of {len(found)}"
    worlds = "world is" if len(minimal) == len(found) else "worlds are"
    return f"{every} {worlds} minimal: {percent(mean(each.smaller for each in minimal))} smaller on average"


def _lead(found: Sequence[Found], minimal: Sequence[Found]) -> list[Paragraph]:
    lead = [
        say(
            "A robot fails in a world of many models. Each cell of this study reduces such a world, by one method, to the few "
            "models that make the robot fail: it runs smaller and smaller parts, keeps those that show the same failure f, "
            "and stops when no single model can be left out. Runs with fresh seeds then show what that is worth: it is "
            f"certified if it keeps at least {_shares(found)} of the whole world's failure rate, and less without any one of its "
            "models."
        )
    ]
    pairs = [(each, theirs(each.cell)) for each in minimal]
    beside = [(each, paper) for each, paper in pairs if paper is not None]
    if beside:
        better = sum(each.smaller >= paper.smaller for each, paper in beside)
        fewer = sum(each.tests <= paper.tests for each, paper in beside)
        ours, hours = sum(each.seconds for each, _ in beside), sum(paper.minutes for _, paper in beside) / 60
        more = sum(each.certificate_seconds for each, _ in beside)
        lead.append(
            say(
                f"Compared with the same {count(len(beside), 'cell')} of the paper: at least as much removed in {better}, not more "
                f"tests in {fewer}. They took {hours:.0f} hours there; here the searches take {duration(ours)}, one test after "
                f"another, and the certificates, which the paper does not have, {duration(more)}. "
                "The worlds follow the paper's descriptions but are not its worlds, and the simulator differs: compare the methods "
                "with each other, and the minutes only roughly with the paper's."
            )
        )
    if missing := len(found) - len(minimal):
        lead.append(say(f"{count(missing, 'cell')} not certified: the tables say why.", notice=True))
    return lead


def _shares(found: Sequence[Found]) -> str:
    """The shares of the whole world's rate that have to be kept."""
    return " or ".join(
        percent(share) for share in sorted({each.cell.scenario.reduction.certify_rate for each in found})
    )


def _figures(
    found: Sequence[Found], minimal: Sequence[Found], sittings: Sequence[Sitting]
) -> tuple[tuple[str, str], ...]:
    seconds, jobs = sum(each.seconds for each in sittings), sorted({each.jobs for each in sittings})
    figures = [(f"{len(minimal)} of {len(found)}", "certified")]
    if minimal:
        figures.append((percent(mean(each.smaller for each in minimal)), "smaller, mean"))
    figures.append((thousands(sum(each.simulated for each in found)), "search tests"))
    figures.append((thousands(sum(each.certificate_simulated for each in found)), "certificate tests"))
    if sittings:
        workers = count(jobs[0], "worker") if len(jobs) == 1 else f"{jobs[0]} to {jobs[-1]} workers"
        made = thousands(sum(each.tests for each in sittings))
        figures.append((duration(seconds), f"with {workers}, {made} made"))
    return tuple(figures)


def write_study(plan: Plan, folder: Path, sittings: Sequence[Sitting]) -> tuple[Path, tuple[Found, ...]]:
    """Writes `study.html`, `study.md` with its figures, and `study.csv`; returns the page and its cells. Raises UserError."""
    found = tuple(read_cell(folder, cell) for cell in plan.cells)
    report = content(plan, found, sittings, folder)
    texts = {f"{STEM}.csv": table(folder, found), **pictures(report, STEM)}
    texts |= {f"{STEM}.md": markdown(report, STEM), f"{STEM}.html": html(report)}
    for name, text in texts.items():
        write_file(folder / name, text.encode(errors="replace"))
    return folder / f"{STEM}.html", found


def table(folder: Path, found: Sequence[Found]) -> str:
    """All cells as CSV, a row each; missing values are empty."""
    rows = [_row(folder, each) for each in found]
    out = io.StringIO()
    writer = csv.DictWriter(out, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def _row(folder: Path, each: Found) -> dict[str, object]:
    cell, base, paper = each.cell, each.baseline, theirs(each.cell)
    partitioning, prioritization = cell.method.parts
    left, *removals = each.certificate.claims if each.certificate is not None else (None,)
    most = max((claim.shown / claim.runs for claim in removals if claim and claim.runs), default=None)
    return {
        "scenario": cell.scenario.name,
        "algorithm": cell.method.algorithm,
        "partitioning": partitioning,
        "prioritization": prioritization,
        "seed": cell.seed,
        "slices": cell.slices,
        "certified": each.minimal,
        "problem": each.problem,
        "models": len(each.elements),
        "left": len(each.left),
        "reduction": round(each.smaller, 4),
        "names": " ".join(each.left),
        "tests": each.tests,
        "simulated": each.simulated,
        "reruns": each.reruns,
        "certificate_tests": each.certificate_tests,
        "certificate_simulated": each.certificate_simulated,
        "ahead": each.ahead,
        "taken_over": each.taken,
        "seconds": round(each.seconds, 2),
        "certificate_seconds": round(each.certificate_seconds, 2),
        "steps_back": each.steps_back,
        "baseline_runs": base and base.runs,
        "baseline_f": base and base.failures,
        "least_to_show": least_of(each, least_to_show) if each.minimal else None,
        "least_to_find": least_of(each, least_to_find) if each.minimal else None,
        "keep_rate": each.certificate and each.certificate.keep_rate,
        "whole_runs": each.certificate and each.whole_runs,
        "whole_f": each.certificate and each.whole_shown,
        "left_runs": left and left.runs,
        "left_f": left and left.shown,
        "left_low": left and round(left.low, 4),
        "left_high": left and round(left.high, 4),
        # The highest rate without one of the models that are left.
        "without_most": None if most is None else round(most, 4),
        "paper_tests": paper and paper.tests,
        "paper_reduction": paper and paper.smaller,
        "paper_minutes": paper and paper.minutes,
        "ddenv": each.version,
        "simulator": each.simulator if cell.scenario.oracle is None else "",
        "run": run_path(folder, cell).relative_to(folder),
    }


def making(plan: Plan, found: Sequence[Found], sittings: Sequence[Sitting], folder: Path) -> Section:
    """The section on how the study was made."""
    blocks: list[Block] = [
        *_settings(plan),
        *_sittings(sittings),
        *_computed(found),
        say("What the columns mean:"),
        Table(("column", "meaning"), tuple(yaml.safe_load(COLUMNS.read_text()).items())),
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
