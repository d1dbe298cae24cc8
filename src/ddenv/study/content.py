"""What a study says: the claim in a few words, a section for each scenario, which method is best where, and how it was made."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import mean

from ddenv.report.blocks import Paragraph, Report, say
from ddenv.report.numbers import duration, percent, thousands
from ddenv.study.best import best
from ddenv.study.folder import Sitting
from ddenv.study.found import Found
from ddenv.study.making import making
from ddenv.study.paper import theirs
from ddenv.study.plan import Plan
from ddenv.study.rows import groups
from ddenv.study.tables import section
from ddenv.version import __version__
from ddenv.words import count


def content(plan: Plan, found: Sequence[Found], sittings: Sequence[Sitting], folder: Path) -> Report:
    """The page of a study; `found` are the cells of `plan` in its order."""
    rows = groups(plan, found)
    minimal = [each for each in found if each.holds]
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
    told = [
        say(
            "A robot fails in a world of many models. Each cell of this study reduces such a world, by one method, to the few "
            "models that make the robot fail: smaller and smaller parts of it are run, and kept while the same failure f shows, "
            "until no single model can be left out."
        )
    ]
    pairs = [(each, theirs(each.cell)) for each in minimal]
    beside = [(each, paper) for each, paper in pairs if paper is not None]
    if beside:
        better = sum(each.smaller >= paper.smaller for each, paper in beside)
        fewer = sum(each.tests <= paper.tests for each, paper in beside)
        ours, hours = sum(each.seconds for each, _ in beside), sum(paper.minutes for _, paper in beside) / 60
        told.append(
            say(
                f"Beside the same {count(len(beside), 'cell')} of the paper: at least as much removed in {better}, not more "
                f"tests in {fewer}. They took {hours:.0f} hours there; here their tests take {duration(ours)}, one after another. "
                "The worlds follow the paper's descriptions but are not its worlds, and the simulator is another one: the methods "
                "can be compared with each other, the minutes only roughly with the paper's."
            )
        )
    if missing := len(found) - len(minimal):
        told.append(
            say(
                f"{count(missing, 'cell')} without a world that is shown to be minimal: the tables say why.",
                notice=True,
            )
        )
    return told


def _figures(
    found: Sequence[Found], minimal: Sequence[Found], sittings: Sequence[Sitting]
) -> tuple[tuple[str, str], ...]:
    seconds, jobs = sum(each.seconds for each in sittings), sorted({each.jobs for each in sittings})
    figures = [(f"{len(minimal)} of {len(found)}", "minimal")]
    if minimal:
        figures.append((percent(mean(each.smaller for each in minimal)), "smaller, mean"))
    figures.append((thousands(sum(each.tests for each in found)), "tests"))
    if sittings:
        workers = count(jobs[0], "worker") if len(jobs) == 1 else f"{jobs[0]} to {jobs[-1]} workers"
        made = thousands(sum(each.tests for each in sittings))
        figures.append((duration(seconds), f"with {workers}, {made} made"))
    return tuple(figures)
