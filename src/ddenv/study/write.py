"""Writes what came of a study: a page, Markdown with its figures beside it, and a table of all cells for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from ddenv.report.html import html
from ddenv.report.markdown import markdown, pictures
from ddenv.study.bound import least_to_find, least_to_show
from ddenv.study.content import content
from ddenv.study.folder import Sitting, run_path
from ddenv.study.found import Found, read_cell
from ddenv.study.paper import theirs
from ddenv.study.plan import Plan
from ddenv.study.rows import least_of
from ddenv.world.files.whole import write_file

STEM = "study"
# The columns of the table of all cells.
HEADER = (
    *("scenario", "algorithm", "partitioning", "prioritization", "seed", "minimal", "problem"),
    *("models", "left", "reduction", "names", "tests", "reruns", "ahead", "taken_over", "seconds"),
    *(
        "baseline_runs",
        "baseline_f",
        "least_to_show",
        "least_to_find",
        "check_runs",
        "check_f",
        "check_without",
        "check_without_f",
    ),
    *("paper_tests", "paper_reduction", "paper_minutes", "ddenv", "simulator", "run"),
)


def write_study(plan: Plan, folder: Path, sittings: Sequence[Sitting]) -> tuple[Path, tuple[Found, ...]]:
    """Writes `study.html`, `study.md` with its figures, and `study.csv`; returns the page and what it is of. Raises UserError."""
    found = tuple(read_cell(folder, cell) for cell in plan.cells)
    report = content(plan, found, sittings, folder)
    texts = {f"{STEM}.csv": table(folder, found), **pictures(report, STEM)}
    texts |= {f"{STEM}.md": markdown(report, STEM), f"{STEM}.html": html(report)}
    for name, text in texts.items():
        write_file(folder / name, text.encode(errors="replace"))
    return folder / f"{STEM}.html", found


def table(folder: Path, found: Sequence[Found]) -> str:
    """All cells as CSV, a row each; what a cell does not have is empty."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows(_row(folder, each) for each in found)
    return out.getvalue()


def _row(folder: Path, each: Found) -> tuple[object, ...]:
    cell, base, check, paper = each.cell, each.baseline, each.check, theirs(each.cell)
    used = dict(zip(("partitioning", "prioritization"), cell.method.parts, strict=True))
    of_check = ("", "", "", "")
    if check is not None:
        without = check.runs * len(check.without), sum(check.without.values())
        of_check = (check.runs, check.shown, *without)
    return (
        *(cell.scenario.name, cell.method.algorithm, *used.values(), cell.seed, each.minimal, each.trouble),
        *(len(each.elements), len(each.left), round(each.smaller, 4), " ".join(each.left)),
        *(each.tests, each.reruns, each.ahead, each.taken, round(each.seconds, 2)),
        *(("", "") if base is None else (base.runs, base.failures)),
        *((least_of(each, least_to_show), least_of(each, least_to_find)) if each.minimal else ("", "")),
        *of_check,
        *(("", "", "") if paper is None else (paper.tests, paper.smaller, paper.minutes)),
        *(
            each.version,
            each.simulator if cell.scenario.oracle is None else "",
            run_path(folder, cell).relative_to(folder),
        ),
    )
