"""The pages of a study: the result in a few words, a section for each scenario, a comparison of methods, how it was made."""

from __future__ import annotations

import csv
import io
import shlex
from collections.abc import Iterator, Sequence
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
from ddenv.report.repeat import value_words
from ddenv.settings import SETTINGS
from ddenv.study.plan import RUNS, Plan, run_path
from ddenv.study.results import Found, groups, read_cell, theirs
from ddenv.study.tables import best, section
from ddenv.study.work import Sitting
from ddenv.text import count, plain
from ddenv.world.access import write_file

STEM = "study"
# These differ between cells.
OF_A_CELL = ("algorithm", "pair", "seed", "budget", "slice")
# Numbers of a cell in the table for programs.
TIMES = ("seconds", "certificate_seconds")
COUNTED = (
    *("tests", "simulated", "reruns", "certificate_tests", "certificate_simulated", "ahead", "taken_over"),
    *TIMES,
    "steps_back",
)
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


def _lead(found: Sequence[Found], minimal: Sequence[Found]) -> Iterator[Paragraph]:
    shares = sorted({each.cell.scenario.reduction.certify_rate for each in found})
    yield say(
        "A robot fails in a world of many models. Each cell of this study reduces such a world, by one method, to the few "
        "models that make the robot fail: it runs smaller and smaller parts, keeps those that show the same failure f, and "
        "stops when no single model can be left out. Runs with fresh seeds then show what that is worth: it is certified if "
        f"it keeps at least {' or '.join(map(percent, shares))} of the whole world's failure rate, and less without any one "
        "of its models."
    )
    beside = [(each, paper) for each in minimal if (paper := theirs(each.cell)) is not None]
    if beside:
        better = sum(each.smaller >= paper.smaller for each, paper in beside)
        fewer = sum(each.tests <= paper.tests for each, paper in beside)
        hours = sum(paper.minutes for _, paper in beside) / 60
        ours, more = (duration(sum(getattr(each, time) for each, _ in beside)) for time in TIMES)
        yield say(
            f"Compared with the same {count(len(beside), 'cell')} of the paper: at least as much removed in {better}, not more "
            f"tests in {fewer}. They took {hours:.0f} hours there; here the searches take {ours}, one test after another, and "
            f"the certificates, which the paper does not have, {more}. The worlds follow the paper's descriptions but are not "
            "its worlds, and the simulator differs: compare the methods with each other, and the minutes only roughly with the "
            "paper's."
        )
    if missing := len(found) - len(minimal):
        yield say(f"{count(missing, 'cell')} not certified: the tables say why.", notice=True)


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
    to_show, to_find = each.bounds if each.minimal else (None, None)
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
        **{name: round(getattr(each, name), 2) for name in COUNTED},
        "baseline_runs": base and base.runs,
        "baseline_f": base and base.failures,
        "least_to_show": to_show,
        "least_to_find": to_find,
        "keep_rate": each.certificate and each.certificate.keep_rate,
        "whole_runs": each.certificate and each.whole_runs,
        "whole_f": each.certificate and each.whole_f,
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
    # A name that begins with a dash would be an option.
    start = f"./{folder}" if str(folder).startswith("-") else folder
    example = shlex.quote(plain(f"{start}/{RUNS}/{plan.cells[0].name}.ddenv"))
    blocks: list[Block] = [
        _settings(plan),
        *([_sittings(sittings)] if sittings else []),
        *_computed(found),
        say("What the columns mean:"),
        Table(("column", "meaning"), tuple(yaml.safe_load(COLUMNS.read_text()).items())),
        say("Each cell is a run that can be watched, continued and reported:"),
        Code((f"ddenv open {example}", f"ddenv certify {example}")),
    ]
    return Section("How it was made", tuple(blocks))


def _settings(plan: Plan) -> Table:
    """The settings that any method uses, with a column for each scenario."""
    used = {part for method in plan.methods for part in (method.algorithm, *method.parts)}
    rows = [
        (one.label, *(value_words(getattr(getattr(each, one.section), one.name)) for each in plan.scenarios))
        for one in SETTINGS.values()
        if one.section != "simulation" and one.name not in OF_A_CELL and (not one.used_by or used & set(one.used_by))
    ]
    seeds = ({cell.seed for cell in plan.cells if cell.scenario.name == scenario.name} for scenario in plan.scenarios)
    rows.append(("seeds", *(", ".join(map(str, sorted(each))) for each in seeds)))
    head = ("setting", *(plain(scenario.name) for scenario in plan.scenarios))
    return Table(head, tuple(rows), frozenset(range(1, len(head))))


def _sittings(sittings: Sequence[Sitting]) -> Table:
    rows = tuple(
        (
            *(f"{moment(one.begun)} UTC", duration(one.seconds), str(one.jobs), thousands(one.tests)),
            *(Name(one.machine), Name(one.versions)),
        )
        for one in sittings
    )
    head = ("worked on", "for", "workers", "tests made", "machine", "versions")
    return Table(head, rows, frozenset({1, 2, 3}))


def _computed(found: Sequence[Found]) -> Iterator[Block]:
    # Tests of different versions may differ.
    drake = [each for each in found if each.simulator and each.cell.scenario.oracle is None]
    versions = sorted({f"ddenv {each.version}, {each.simulator}" for each in drake})
    taken = sum(each.taken_over for each in found)
    if len(versions) == 1:
        yield say(f"Computed with {versions[0]}.")
    elif versions:
        yield say(f"Different versions computed parts of it: {'; '.join(versions)}.", notice=True)
    if taken:
        yield say(
            f"{thousands(taken)} tests were reused from another cell with the same models and the same seed: the simulation is "
            "deterministic to the last bit. They count in each cell, with their time."
        )
