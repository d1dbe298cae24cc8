"""What is written of a study: a page, Markdown with figures, and a table, of whatever its cells
came to and are called.
"""

import csv
import io
import re
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest
import yaml

from ddenv import __version__
from ddenv.study.folder import Session
from ddenv.study.plan import run_path
from ddenv.study.study_page import write_study
from tests.report.test_report import EVIL, Page
from tests.study.made import LONGEST, crates, holds, never_failed, plan_of, reduced
from tests.workbench import fake_run

SESSIONS = (
    Session(
        begun=1.6e9,
        seconds=90.0,
        jobs=2,
        tests=30,
        versions="ddenv 1",
        machine="<b>first</b> machine",
    ),
    Session(
        begun=1.7e9, seconds=30.0, jobs=4, tests=9, versions="ddenv 2", machine="second machine"
    ),
)


def written(plan, folder, sessions=SESSIONS):
    """The page, the Markdown and the rows of the table."""
    page, _ = write_study(plan, folder, sessions)
    rows = list(csv.DictReader(io.StringIO((folder / "study.csv").read_text())))
    return Page(page.read_text()), (folder / "study.md").read_text(), rows


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two methods with three seeds each: the second one never failed, is not shown to be minimal,
    and is not made.
    """
    folder = tmp_path_factory.mktemp("study")
    plan = plan_of(crates(folder), seeds=3)
    one, two, three, never, chance, _ = plan.cells
    reduced(folder, one, vain=2)
    reduced(folder, two, vain=3)
    reduced(folder, three, ["crate_03"], vain=1)
    never_failed(folder, never)
    chance_left = ["crate_03", "crate_07"]
    reduced(
        folder, chance, chance_left, claims=holds(chance_left) | {"crate_07": ("not shown", "spsp")}
    )
    return (*written(plan, folder), folder, plan)


def test_several_seeds_are_told_as_median_and_range(study):
    page, text, *_ = study
    row = (
        "3 of 3 | 13 (9 to 17) | 15 (11 to 15) | 82 % (82 % to 91 %) | 0.4 (0.3 to 0.6) | 0.5 "
        "(0.4 to 0.5)"
    )
    assert f"| model2model/failure-proximal | {row} |" in text
    assert row.replace(" |", "") in page.text
    # Behind it: re-runs, what is left, f in the whole world, in what is left and without a model,
    # steps back, and the bound.
    left = "`crate_00`, `crate_01` (2 of 3); `crate_03` (1 of 3)"
    rates = "9 of 12 (33 % to 97 %) | 15 of 15 (72 % to 100 %) | at most 0 of 4 (0 % to 66 %)"
    assert (
        f"| model2model/failure-proximal | 46 % (33 % to 53 %) | {left} | {rates} | 0 | 13 |"
        in text
    )


def test_what_went_wrong_is_told_with_its_seed(study):
    page, text, rows, *_ = study
    assert "3 cells not certified: the tables say why." in page.text
    doubt = (
        "not shown that each model is needed: undecided without crate_07; with everything that "
        "is left f in 5 of 5 fresh runs"
    )
    for words in (
        "Not certified: model2model/sequential, seed 0: there is no failure to reduce.",
        f"Not certified: model2model/sequential, seed 100000: {doubt} (41 % to 100 %).",
        "Not certified: model2model/sequential, seed 200000: not made yet.",
    ):
        assert words in page.text
        assert f"> {words.replace('_', chr(92) + '_')}" in text
    problems = [
        "",
        "",
        "",
        "there is no failure to reduce",
        f"{doubt} (41 % to 100 %)",
        "not made yet",
    ]
    assert [row["problem"] for row in rows] == problems
    assert (
        page.text.startswith("ddenv study")
        and "3 of 6 worlds are minimal: 85 % smaller on average" in page.text
    )
    # What has to be kept is said with the result.
    assert (
        "it is certified if it keeps at least 66 % of the whole world's failure rate" in page.text
    )


def test_the_table_for_programs_has_a_row_for_each_cell(study):
    *_, rows, folder, plan = study
    assert len(rows) == len(plan.cells)
    told = (
        *(
            "crates",
            "ddenv",
            "model2model",
            "failure-proximal",
            "0",
            "False",
            "True",
            "",
            "11",
            "2",
            "0.8182",
        ),
        "crate_00 crate_01",
        # The tests, their time, the baseline, the bound, the certificate, and the paper.
        *("13", "13", "6", "15", "15", "1", "0", "26.0", "30.0", "0", "4", "3", "13"),
        *("0.8", "4", "3", "5", "5", "0.415", "1.0", "0.0", "", "", "", __version__),
    )
    assert tuple(rows[0].values())[: len(told)] == told
    assert list(rows[0])[len(told) - 4 :] == [
        f"paper_{name}" for name in ("tests", "reduction", "minutes")
    ] + [*("ddenv", "simulator", "run")]
    assert (rows[4]["certified"], rows[4]["without_most"], rows[4]["least_to_show"]) == (
        "False",
        "0.5",
        "",
    )
    assert all((folder / row["run"]).is_file() for row in rows[:5])
    assert (rows[3]["certified"], rows[3]["baseline_runs"], rows[3]["left_runs"]) == (
        "False",
        "",
        "",
    )


def test_the_page_needs_nothing_else_and_the_markdown_shows_files_that_are_there(study):
    page, text, _, folder, _ = study
    assert not page.tags & {"script", "link", "img", "iframe", "a", "object"}
    assert not page.attributes & {"src", "href", "onload", "onclick"}
    assert {"svg", "table"} <= page.tags
    shown = [unquote(name) for name in re.findall(r"\]\((.*?)\)", text)]
    # The models by test, and a map of each world that is left.
    assert len(shown) == len(set(shown)) == 4
    assert {folder / name for name in shown} == set(folder.glob("*.svg"))
    for name in shown:
        assert ElementTree.fromstring((folder / name).read_text()).tag.endswith("svg")


def test_each_minimal_world_is_drawn_once_those_found_most_first(study):
    page, *_ = study
    first = "The minimal world (the paper's Figure 3), the end of 2 of 4 cells: crate_00, crate_01."
    second = page.text.index(
        "The minimal world (the paper's Figure 3), the end of 1 of 4 cells: crate_03."
    )
    unsure = (
        "What is left, not shown to be minimal (the paper's Figure 3), the end of 1 of 4 cells: "
        "crate_03, crate_07."
    )
    assert page.text.index(first) < second < page.text.index(unsure)


def test_where_and_when_it_was_made_is_told_and_written_again_it_is_the_same(study):
    page, *_, folder, plan = study
    assert "2020-09-13 12:26:40 UTC 1 min 30 s 2 30 <b>first</b> machine ddenv 1" in page.text
    assert "with 2 to 4 workers, 39 made 2 min 00 s" in page.text
    assert "seeds 0, 100000, 200000" in page.text
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    write_study(plan, folder, SESSIONS)
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_a_study_of_which_nothing_is_made_yet(tmp_path):
    page, _, rows = written(plan_of(crates(tmp_path)), tmp_path, ())
    assert "None of 2 worlds is minimal yet" in page.text
    assert [row["problem"] for row in rows] == ["not made yet"] * 2
    assert "svg" not in page.tags


def test_files_that_are_damaged_hide_no_other_cell(tmp_path):
    plan = plan_of(crates(tmp_path))
    one, two = plan.cells
    run_path(tmp_path, one).parent.mkdir()
    run_path(tmp_path, one).write_text("no run file")
    reduced(tmp_path, two)
    page, _, rows = written(plan, tmp_path)
    assert "is not a ddenv run file" in rows[0]["problem"] and rows[1]["certified"] == "True"
    assert "is not a ddenv run file" in page.text and "1 of 2 worlds are minimal" in page.text


def evil(folder: Path) -> Path:
    """A scenario whose names and words try everything."""
    file = crates(folder, '<i>&x</i> | `y` "')
    data = yaml.safe_load(file.read_text())
    data |= {"description": "</p><script>alert(1)</script> # *x*", "protected": []}
    file.write_text(yaml.safe_dump(data))
    names = [
        name.translate({ord("<"): "&lt;", ord("&"): "&amp;", ord('"'): "&quot;"}) for name in EVIL
    ]
    (folder / "crates.sdf").write_bytes(fake_run.world_text(names))
    return file


def test_names_are_shown_as_they_are_and_do_nothing(tmp_path):
    (cell,) = (plan := plan_of(evil(tmp_path), pairs="model2model/random")).cells
    left = reduced(
        tmp_path, cell, EVIL, claims=holds(EVIL) | {EVIL[0]: ("not needed", "ssss")}
    ).left
    page, text, (row,) = written(plan, tmp_path)
    assert not page.tags & {"script", "i", "b"}
    for name in EVIL[:2] + EVIL[3:5]:
        assert name in page.text
    assert "\u202e" not in page.text + text
    bare = re.sub(r"(?<![\\`])(`+)(?!`).*?(?<!`)\1(?!`)", "", text, flags=re.S)
    assert not re.search(r"(?<![\\`])<(script|i|b)\b", bare)
    assert row["scenario"] == '<i>&x</i> | `y` "' and row["names"] == " ".join(left)
    assert len(list(tmp_path.glob("*.svg"))) == text.count(".svg)") == 2


def test_the_longest_names_make_files_and_no_figure_takes_the_place_of_another(tmp_path):
    """One scenario left two worlds; another one is called as the first of them might be."""
    plan = plan_of(*(crates(tmp_path, name) for name in ("crates", "crates-1", LONGEST)))
    for cell, left in zip(
        plan.cells[::2], (["crate_00"], *[["crate_00", "crate_01"]] * 2), strict=True
    ):
        reduced(tmp_path, cell, left)
    reduced(tmp_path, plan.cells[1], ["crate_03"])
    page, text, _ = written(plan, tmp_path)
    assert LONGEST in page.text
    shown = re.findall(r"\]\((.*?\.svg)\)", text)
    assert len(shown) == len(set(shown)) == 7
