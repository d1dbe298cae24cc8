"""The pages of a study: the result in a few words, a section for each scenario, a comparison of
methods, how it was made.
"""

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
from ddenv.study.folder import Session
from ddenv.study.plan import RUNS, Plan, run_path
from ddenv.study.results import Result, paper_row, read_cell, rows_of
from ddenv.study.tables import best, section
from ddenv.text import count, percent_at_least, plain
from ddenv.world.access import write_file

STEM = "study"
# These differ between cells.
OF_A_CELL = ("algorithm", "pair", "seed", "budget", "slice")
# Numbers of a cell in the table for programs.
TIMES = ("seconds", "certificate_seconds")
COUNTED = (
    *(
        "tests",
        "simulated",
        "reruns",
        "certificate_tests",
        "certificate_simulated",
        "ahead",
        "taken_over",
    ),
    *TIMES,
    "steps_back",
)
# What the columns of the tables mean.
COLUMNS = Path(__file__).with_name("columns.yaml")


def content(
    plan: Plan, results: Sequence[Result], sessions: Sequence[Session], folder: Path
) -> Report:
    """The page of a study; `results` are those of the plan's cells in their order."""
    scenarios = rows_of(plan, results)
    minimal = [result for result in results if result.minimal]
    ranking = best(scenarios)
    sections = [section(folder, rows) for rows in scenarios]
    yet = " yet" if any(not result.ended for result in results) else ""
    verdict = f"None of {count(len(results), 'world')} is minimal{yet}"
    figures = [(f"{len(minimal)} of {len(results)}", "certified")]
    if minimal:
        smaller = percent(mean(result.smaller for result in minimal))
        if len(minimal) == len(results):
            worlds = "Every world is"
        else:
            worlds = f"{len(minimal)} of {len(results)} worlds are"
        verdict = f"{worlds} minimal: {smaller} smaller on average"
        figures.append((smaller, "smaller, mean"))
    figures += [
        (thousands(sum(result.simulated for result in results)), "search tests"),
        (thousands(sum(result.certificate_simulated for result in results)), "certificate tests"),
    ]
    if sessions:
        jobs = sorted({session.jobs for session in sessions})
        workers = count(jobs[0], "worker") if len(jobs) == 1 else f"{jobs[0]} to {jobs[-1]} workers"
        made = thousands(sum(session.tests for session in sessions))
        figures.append(
            (duration(sum(session.seconds for session in sessions)), f"with {workers}, {made} made")
        )
    return Report(
        name="ddenv study",
        verdict=verdict,
        lead=tuple(_lead(results, minimal)),
        figures=tuple(figures),
        sections=(
            *([ranking] if ranking else []),
            *sections,
            making(plan, results, sessions, folder),
        ),
        foot=f"Written by ddenv {__version__}. Lengths in m, times in UTC.",
    )


def _lead(results: Sequence[Result], minimal: Sequence[Result]) -> Iterator[Paragraph]:
    shares = sorted({result.cell.scenario.reduction.certify_rate for result in results})
    yield say(
        "A robot fails in a world of many models. Each cell of this study reduces such a world, "
        "by one method, to the few models that make the robot fail: it runs smaller and smaller "
        "parts, keeps those that show the same failure f, and stops when no single model can be "
        "left out. Runs with fresh seeds then check the result: it is certified if it keeps at "
        f"least {' or '.join(map(percent_at_least, shares))} of the whole world's failure rate, "
        "and less without any one of its models."
    )
    beside = [
        (result, paper) for result in minimal if (paper := paper_row(result.cell)) is not None
    ]
    if beside:
        better = sum(result.smaller >= paper.smaller for result, paper in beside)
        fewer = sum(result.tests <= paper.tests for result, paper in beside)
        hours = sum(paper.minutes for _, paper in beside) / 60
        ours, more = (
            duration(sum(getattr(result, time) for result, _ in beside)) for time in TIMES
        )
        yield say(
            f"Compared with the same {count(len(beside), 'cell')} of the paper: at least as much "
            f"removed in {better}, no more tests in {fewer}. They took {hours:.0f} hours there; "
            f"here the searches take {ours}, and the certificates {more}. The worlds and the "
            "simulator differ from the paper's: compare the methods with each other."
        )
    if missing := len(results) - len(minimal):
        yield say(f"{count(missing, 'cell')} not certified: the tables say why.", notice=True)


def write_study(
    plan: Plan, folder: Path, sessions: Sequence[Session]
) -> tuple[Path, tuple[Result, ...]]:
    """Writes `study.html`, `study.md` with its figures, and `study.csv`; returns the page and its
    results. Raises UserError.
    """
    results = tuple(read_cell(folder, cell) for cell in plan.cells)
    report = content(plan, results, sessions, folder)
    texts = {f"{STEM}.csv": table(folder, results), **pictures(report, STEM)}
    texts |= {f"{STEM}.md": markdown(report, STEM), f"{STEM}.html": html(report)}
    for name, text in texts.items():
        write_file(folder / name, text.encode(errors="replace"))
    return folder / f"{STEM}.html", results


def table(folder: Path, results: Sequence[Result]) -> str:
    """All cells as CSV, a row each; missing values are empty."""
    rows = [_row(folder, result) for result in results]
    out = io.StringIO()
    writer = csv.DictWriter(out, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def _row(folder: Path, result: Result) -> dict[str, object]:
    cell = result.cell
    base = result.baseline
    paper = paper_row(result.cell)
    partitioning, prioritization = cell.method.parts
    left, *removals = result.certificate.claims if result.certificate is not None else (None,)
    most = max(
        (claim.shown / claim.runs for claim in removals if claim and claim.runs), default=None
    )
    return {
        "scenario": cell.scenario.name,
        "algorithm": cell.method.algorithm,
        "partitioning": partitioning,
        "prioritization": prioritization,
        "seed": cell.seed,
        "slices": cell.slices,
        "certified": result.minimal,
        "problem": result.problem,
        "models": len(result.elements),
        "left": len(result.left),
        "reduction": round(result.smaller, 4),
        "names": " ".join(result.left),
        **{name: round(getattr(result, name), 2) for name in COUNTED},
        "baseline_runs": base and base.runs,
        "baseline_f": base and base.failures,
        "least_to_show": result.bound if result.minimal else None,
        "keep_rate": result.certificate and result.certificate.keep_rate,
        "whole_runs": result.certificate and result.whole_runs,
        "whole_f": result.certificate and result.whole_f,
        "left_runs": left and left.runs,
        "left_f": left and left.shown,
        "left_low": left and round(left.low, 4),
        "left_high": left and round(left.high, 4),
        # The highest rate without one of the models that are left.
        "without_most": None if most is None else round(most, 4),
        "paper_tests": paper and paper.tests,
        "paper_reduction": paper and paper.smaller,
        "paper_minutes": paper and paper.minutes,
        "ddenv": result.version,
        "simulator": result.simulator if cell.scenario.oracle is None else "",
        "run": run_path(folder, cell).relative_to(folder),
    }


def making(
    plan: Plan, results: Sequence[Result], sessions: Sequence[Session], folder: Path
) -> Section:
    # A name that begins with a dash would be an option.
    start = f"./{folder}" if str(folder).startswith("-") else folder
    example = shlex.quote(plain(f"{start}/{RUNS}/{plan.cells[0].name}.ddenv"))
    worked = [
        (
            *(
                f"{moment(session.begun)} UTC",
                duration(session.seconds),
                str(session.jobs),
                thousands(session.tests),
            ),
            *(Name(session.machine), Name(session.versions)),
        )
        for session in sessions
    ]
    head = ("worked on", "for", "workers", "tests made", "machine", "versions")
    blocks: list[Block] = [
        _settings(plan),
        *([Table(head, tuple(worked), {1, 2, 3})] if worked else []),
        *_computed(results),
        say("What the columns mean:"),
        Table(("column", "meaning"), tuple(yaml.safe_load(COLUMNS.read_text()).items())),
        say("Each cell is a run that can be watched, continued and reported:"),
        Code((f"ddenv open {example}", f"ddenv certify {example}")),
    ]
    return Section("How it was made", tuple(blocks))


def _settings(plan: Plan) -> Table:
    used = {part for method in plan.methods for part in (method.algorithm, *method.parts)}
    rows = [
        (
            item.label,
            *(
                value_words(getattr(getattr(scenario, item.section), item.name))
                for scenario in plan.scenarios
            ),
        )
        for item in SETTINGS.values()
        if item.section != "simulation"
        and item.name not in OF_A_CELL
        and (not item.used_by or used & set(item.used_by))
    ]
    seeds = (
        {cell.seed for cell in plan.cells if cell.scenario.name == scenario.name}
        for scenario in plan.scenarios
    )
    rows.append(("seeds", *(", ".join(map(str, sorted(numbers))) for numbers in seeds)))
    head = ("setting", *(plain(scenario.name) for scenario in plan.scenarios))
    return Table(head, tuple(rows), range(1, len(head)))


def _computed(results: Sequence[Result]) -> Iterator[Block]:
    # Tests of different versions may differ.
    drake = [
        result for result in results if result.simulator and result.cell.scenario.oracle is None
    ]
    versions = sorted({f"ddenv {result.version}, {result.simulator}" for result in drake})
    taken = sum(result.taken_over for result in results)
    if len(versions) == 1:
        yield say(f"Computed with {versions[0]}.")
    elif versions:
        yield say(f"Different versions computed parts of it: {'; '.join(versions)}.", notice=True)
    if taken:
        yield say(
            f"{thousands(taken)} tests were reused from another cell with the same models and the "
            "same seed: the simulation is deterministic to the last bit. They count in each "
            "cell, including their time."
        )
