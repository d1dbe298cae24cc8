"""The tables of a study from its results: the paper's numbers, medians and ranges, and which method
is best where.
"""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from ddenv.page.blocks import Paragraph, Strong, Table
from ddenv.runfile.events import BaselineFinished, Outcomes
from ddenv.runfile.progress import Certificate, Claim
from ddenv.study.plan import PAIRS, make_plan
from ddenv.study.results import Result, rows_of
from ddenv.study.study_page import content
from ddenv.study.tables import best, chart, numbers, section
from tests.study.made import crates, plan_of

MODELS = tuple(f"m{number}" for number in range(16))
FIVE = "model2model/random,model2model/sequential,model2model/timestep,timeseg/random,timeseg/sequential"
FOUR = FIVE.rpartition(",")[0]
SVG = "{http://www.w3.org/2000/svg}"


def certificate(left, *verdicts):
    """A certificate of the models `left`: with other `verdicts` for some claims, first for what is
    left.
    """
    names = (None, *MODELS[:left])
    verdicts = (*verdicts, *("kept", *["needed"] * left)[len(verdicts) :])
    claims = [
        Claim(
            without=name,
            verdict=verdict,
            shown=0 if name else 20,
            runs=10 if name else 20,
            low=0.0 if name else 0.84,
            high=0.28 if name else 1.0,
        )
        for name, verdict in zip(names, verdicts, strict=True)
    ]
    return Certificate(
        number=1,
        node=1,
        first_run=10_000,
        keep_rate=0.8,
        rate=0.95,
        error=0.03,
        at_least=10,
        certify_rate=2 / 3,
        claims=tuple(claims),
    )


def result_of(cell, tests, left=1, **other):
    """A minimal cell of 16 models, half of whose tests are re-runs, of 3 s each; 40 more of its
    certificate.
    """
    baseline = BaselineFinished(
        runs=10,
        failures=9,
        rate=0.9,
        low=0.6,
        high=1.0,
        failure_test=1,
        position=(0.0, 0.0, 0.0),
        miss_chance=0.0,
        iterations_95=1,
        judged=Outcomes({}, {}),
    )
    values = {
        "ended": True,
        "minimal": True,
        "problem": "",
        "elements": MODELS,
        "left": MODELS[:left],
    }
    values |= {
        "tests": tests,
        "reruns": tests // 2,
        "seconds": 3.0 * tests,
        "baseline": baseline,
        "misses": 4,
    }
    values |= {
        "certificate": certificate(left),
        "certificate_tests": 40,
        "certificate_seconds": 120.0,
    }
    values |= {"whole_f": 19, "whole_runs": 20, "sizes": ((10, 16), (tests, left))}
    return Result(cell=cell, **(values | other))


def cells(tmp_path, *tests, pairs=FIVE, seeds=1):
    """The rows of two scenarios; `tests` are those of each cell in the order of the tables: None
    where there is no end, below zero where the certificate fails.
    """
    plan = plan_of(crates(tmp_path, "one"), crates(tmp_path, "two"), pairs=pairs, seeds=seeds)
    made = [
        Result(cell=cell)
        if each is None
        else result_of(cell, abs(each), **(UNCERTIFIED if each < 0 else {}))
        for cell, each in zip(plan.cells, tests, strict=True)
    ]
    return plan, made, rows_of(plan, made)


def words_of(folder, group):
    """All words of a scenario's section."""
    blocks = (block for block in section(folder, group).blocks if isinstance(block, Paragraph))
    return " ".join(part for block in blocks for part in block.parts if isinstance(part, str))


# Its certificate does not show that the rate is kept.
UNCERTIFIED = {
    "minimal": False,
    "problem": "it is not shown",
    "certificate": certificate(1, "not shown"),
}


def ranking(both):
    """The rows of the comparison below the bound, by method, in their order; and this bound."""
    (table,) = (block for block in best(both).blocks if isinstance(block, Table))
    return {row[0]: row[1:] for row in table.rows[1:]}, table.rows[0]


def test_the_papers_numbers_stand_beside_ours():
    plan = make_plan(("ditch",), slice=False)
    (group,) = rows_of(plan, [result_of(cell, 60, left=2) for cell in plan.cells])
    table = numbers(group)
    assert table.head == (
        *(
            "partitioning, prioritization",
            "certified",
            "search tests",
            "paper",
            "certificate tests",
        ),
        *("% reduction", "paper", "search minutes", "paper", "certificate minutes"),
    )
    assert table.rows[0] == (
        PAIRS[0],
        "yes",
        "60",
        "268",
        "40",
        "88 %",
        "84 %",
        "3.0",
        "420",
        "2.0",
    )
    assert table.rows[1] == (PAIRS[1], "yes", "60", "82", "40", "88 %", "95 %", "3.0", "108", "2.0")


def test_what_slices_save_stands_beside_the_papers_way():
    plan = make_plan(("ditch",), PAIRS[0], seeds=2)
    numbers_of = {False: {"simulated": 60}, True: {"simulated": 21, "certificate_simulated": 12}}
    made = [result_of(cell, 60, left=2, **numbers_of[cell.slices]) for cell in plan.cells]
    made[-1] = replace(made[-1], left=MODELS[:3], minimal=False, problem="it is not shown")
    (group,) = rows_of(plan, made)
    table = numbers(group)
    assert table.head == (
        *("partitioning, prioritization", "certified", "search tests", "paper", "with slices"),
        *(
            "certificate tests",
            "with slices",
            "% reduction",
            "paper",
            "search minutes",
            "paper",
            "certificate minutes",
        ),
    )
    assert table.rows[0][1:8] == ("2 of 2", "60", "268", "21", "40", "12", "88 %")
    told = words_of(Path("nowhere"), group)
    assert f"Not certified: {PAIRS[0]}, seed 100000, with slices: it is not shown." in told


def test_the_claim_counts_what_is_better_than_the_paper():
    plan = make_plan(("ditch",), slice=False)
    # Of 84, 95 and 84 % and of 268, 82 and 359 tests.
    made = [
        result_of(cell, tests, left=2)
        for cell, tests in zip(plan.cells, (269, 82, 30), strict=True)
    ]
    report = content(plan, made, (), Path("nowhere"))
    told = " ".join(part for each in report.lead for part in each.parts)
    assert (
        "the same 3 cells of the paper: at least as much removed in 2, no more tests in 2. They "
        "took 17 hours"
    ) in told
    assert report.verdict == "Every world is minimal: 88 % smaller on average"


def test_what_is_not_certified_is_shown_and_is_no_success(tmp_path):
    """The cell with the fewest tests has lost the rate."""
    plan, made, both = cells(tmp_path, *(-10, 20, 30, 90), *(40, 50, 60, 70), pairs=FOUR)
    assert [row[1] for row in numbers(both[0]).rows] == ["no", "yes", "yes", "yes"]
    assert numbers(both[0]).rows[0][2] == "10"
    rows, _ = ranking(both)
    assert next(iter(rows)) == "model2model/sequential" and rows["model2model/sequential"][
        0
    ] == Strong("20 ◂")
    assert list(rows)[-1] == "model2model/random"
    assert rows["model2model/random"] == ("not certified", Strong("40 ◂"), "–")
    report = content(plan, made, (), tmp_path)
    assert report.verdict == "7 of 8 worlds are minimal: 94 % smaller on average"
    assert report.figures[0] == ("7 of 8", "certified")
    assert "1 cell not certified: the tables say why." in report.lead[-1].parts
    words = [text.text for text in ElementTree.fromstring(chart(both[0])).iter(f"{SVG}text")]
    assert "model2model/random: 1 model left after 10 tests, not certified" in words


@pytest.mark.parametrize("second", [-12, None])
def test_half_a_success_is_none(tmp_path, second):
    tests = (*(10, second), *(20, 22), *(30, 30), *(90, 90), *([50] * 8))
    _, _, both = cells(tmp_path, *tests, pairs=FOUR, seeds=2)
    assert numbers(both[0]).rows[0][1] == "1 of 2"
    rows, _ = ranking(both)
    assert (
        list(rows)[-1] == "model2model/random"
        and rows["model2model/random"][0] == "10 (1 of 2 certified)"
    )
    assert rows["model2model/sequential"][0] == Strong("21 ◂")


def test_which_is_best_where(tmp_path):
    """In the first scenario the last method needs the fewest tests, on the whole the second one
    does.
    """
    _, _, both = cells(tmp_path, 40, 20, 30, 90, 19, *(40, 20, 30, 90, 80))
    rows, bound = ranking(both)
    # The baseline's four, f once, and the model left out without success.
    assert bound[1:] == ("9", "9", "1.0")
    assert list(rows) == [f"model2model/{name}" for name in ("sequential", "timestep")] + [
        *("timeseg/sequential", "model2model/random", "timeseg/random")
    ]
    assert rows["model2model/sequential"] == ("20", Strong("20 ◂"), "2.2")
    assert rows["timeseg/sequential"] == (Strong("19 ◂"), "80", "4.3")
    # What is not minimal everywhere comes last.
    *_, both = cells(tmp_path, 40, 20, 30, 90, 10, *(40, 20, 30, 90, None))
    assert list(ranking(both)[0].items())[-1] == (
        "timeseg/sequential",
        (Strong("10 ◂"), "not made yet", "–"),
    )


def test_of_few_methods_or_none_with_an_end_nothing_is_ranked(tmp_path):
    assert best(cells(tmp_path, *([20] * 6), pairs=",".join(PAIRS))[2]) is None
    assert best(cells(tmp_path, *([None] * 10))[2]) is None


def test_the_figure_has_a_line_for_each_method(tmp_path):
    plan, _, (one, two) = cells(tmp_path, 40, 20, 30, 90, None, *([None] * 5))
    root = ElementTree.fromstring(chart(one))
    lines = [path for path in root.iter(f"{SVG}path") if path.find(f"{SVG}title") is not None]
    assert [path.find(f"{SVG}title").text for path in lines] == [
        f"{cell.label}, seed 0" for cell in plan.cells[:4]
    ]
    # From the end of the baseline on, at the top, down to one model; each size holds until the next
    # one.
    places = [
        [tuple(map(float, at.split())) for at in path.get("d")[1:].split("L")] for path in lines
    ]
    assert all(
        start[1] == middle[1] < end[1] and middle[0] == end[0] for start, middle, end in places
    )
    longest = places[3]
    assert all(each[-1][0] < longest[-1][0] and each[0] == longest[0] for each in places[:3])
    words = [text.text for text in root.iter(f"{SVG}text")]
    assert "model2model/sequential: 1 model left after 20 tests" in words
    assert not any("timeseg/sequential" in word for word in words)
    assert not any(row.minimal for row in two)


def test_of_many_methods_the_figure_names_the_papers_and_the_best(tmp_path):
    plan = make_plan(("ditch",), "all", slice=False)
    (group,) = rows_of(
        plan, [result_of(cell, 100 - number) for number, cell in enumerate(plan.cells)]
    )
    words = [text.text for text in ElementTree.fromstring(chart(group)).iter(f"{SVG}text")]
    named = [word.partition(":")[0] for word in words if "left after" in word]
    labels = [method.label for method in plan.methods]
    assert (sorted(named[:3]), named[3:]) == (sorted(PAIRS), labels[:-4:-1])
    assert f"{len(labels) - 6} other methods" in words


def test_a_world_of_which_all_is_needed_is_drawn_too(tmp_path):
    plan, made, _ = cells(tmp_path, 20, 20, pairs="model2model/random")
    made = [
        replace(each, elements=("m0",), left=("m0",), sizes=((10, 1), (14, 1))) for each in made
    ]
    for group in rows_of(plan, made):
        text = chart(group)
        ElementTree.fromstring(text)
        assert "nan" not in text and "inf" not in text
    assert (
        content(plan, made, (), tmp_path).verdict
        == "Every world is minimal: 0 % smaller on average"
    )
