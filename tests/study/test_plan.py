"""Which cells a study consists of, and what is told of names that make no sense."""

from itertools import pairwise

import pytest

from ddenv import schemas
from ddenv.errors import UserError
from ddenv.evidence.certificate import MOST_BROKEN, MOST_PAIRS
from ddenv.reduction.procedure import MOST_STEPS_BACK
from ddenv.reduction.verdict import LONGEST_BASELINE, MOST_RUNS
from ddenv.run_numbers import CERTIFICATES
from ddenv.study.plan import PAIRS, make_plan, run_path
from ddenv.study.results import paper_row
from tests.study.made import LONGEST, crates, plan_of

LONGEST_FILE_NAME = 255


def test_by_default_it_is_the_papers_three_by_three_in_its_order():
    cells, sliced = make_plan().cells[::2], make_plan().cells[1::2]
    assert [(cell.scenario.name, cell.method.pair) for cell in cells] == [
        (scenario, pair) for scenario in ("ditch", "rubble", "friction") for pair in PAIRS
    ]
    assert PAIRS == (
        "model2model/failure-proximal",
        "model2model/avg-trajectory-proximal",
        "timeseg/avg-trajectory-proximal",
    )
    assert {cell.method.algorithm for cell in cells} == {"ddenv"}
    # Each is made with slices, too, which the paper does not have.
    assert [cell.label for cell in sliced] == [f"{cell.label} with slices" for cell in cells]
    assert not any(cell.slices for cell in cells)
    assert {paper_row(cell) for cell in sliced} == {None}
    # Tests, % reduction and minutes of each row of Tables II to IV.
    paper = [paper_row(cell) for cell in cells]
    assert [(each.tests, round(100 * each.smaller), each.minutes) for each in paper] == [
        *((268, 84, 420), (82, 95, 108), (359, 84, 487)),
        *((179, 81, 274), (178, 78, 277), (162, 89, 231)),
        *((727, 44, 1098), (116, 76, 183), (430, 68, 641)),
    ]


def test_a_cell_has_all_that_is_asked_for(tmp_path):
    plan = plan_of(crates(tmp_path, seed=40), seeds=2, iterations=2, epsilon=0.7)
    first, second = plan.cells[:2]
    assert (first.scenario.reduction.pair, first.scenario.reduction.seed) == (
        "model2model/failure-proximal",
        40,
    )
    assert (first.scenario.reduction.iterations, first.scenario.failure.epsilon) == (2, 0.7)
    assert (second.method, second.scenario.reduction.seed) == (first.method, second.seed)
    assert plan.cells[2].method.pair == "model2model/sequential"


def test_names_come_in_lists_and_count_once(tmp_path):
    files = [str(crates(tmp_path, name)) for name in ("one", "two", "three")]
    plan = make_plan(
        (f"{files[1]}, {files[0]}", files[2], files[0]),
        "timeseg/random,paper, timeseg/random",
        "ddenv,ddenv",
    )
    assert [scenario.name for scenario in plan.scenarios] == ["two", "one", "three"]
    assert [method.pair for method in plan.methods] == ["timeseg/random", *PAIRS]


def test_all_is_all_that_is_installed(tmp_path):
    plan = plan_of(crates(tmp_path), pairs="all", algorithms="all")
    assert [each.pair for each in plan.methods if each.algorithm == "ddenv"] == list(
        schemas.pairs()
    )
    assert {each.algorithm for each in plan.methods} == set(schemas.names("algorithm"))


def test_methods_that_differ_only_in_what_is_not_looked_at_are_one(tmp_path):
    plan = plan_of(crates(tmp_path), pairs="all", algorithms="ddmin,splitting,ddenv")
    labels = [method.label for method in plan.methods]
    assert labels[0] == "ddmin"
    orders = [f"splitting {name}" for name in schemas.names("prioritization")]
    assert labels[1:] == [*orders, *schemas.pairs()]
    assert [cell.name for cell in plan.cells[:2]] == [
        "crates_ddmin_seed-0",
        "crates_splitting_failure-proximal_seed-0",
    ]


@pytest.mark.parametrize(("baseline_runs", "iterations"), [(10, 3), (1000, 1000), (1, 0)])
def test_no_run_of_one_seed_is_a_run_of_another(tmp_path, baseline_runs, iterations):
    plan = plan_of(
        crates(tmp_path, baseline_runs=baseline_runs, iterations=iterations, seed=7),
        pairs=PAIRS[0],
        seeds=4,
    )
    # The search, and all certificates that a run can make.
    one = max(baseline_runs, 1 + iterations, LONGEST_BASELINE, MOST_RUNS)
    assert one < CERTIFICATES.start
    steps = 1 + MOST_STEPS_BACK
    last = CERTIFICATES.start + steps * (MOST_PAIRS + MOST_BROKEN + 1)
    seeds = [cell.seed for cell in plan.cells]
    assert seeds[0] == 7
    assert all(after - before > last for before, after in pairwise(seeds))


def test_a_seed_beyond_the_last_one_is_refused(tmp_path):
    with pytest.raises(
        UserError, match="the last seed of crates would be 2147583647; the maximum is 2147483647"
    ):
        plan_of(crates(tmp_path, seed=2**31 - 1), seeds=2)


@pytest.mark.parametrize(
    "name", [LONGEST, "a b/../c\\d", "-rf ~", "\u202eabc\n", "..", ":|?*"], ids=ascii
)
def test_the_names_of_files_are_files_names(tmp_path, name):
    plan = plan_of(crates(tmp_path, name), pairs="all", algorithms="all", seeds=2)
    assert len({cell.name for cell in plan.cells}) == len(plan.cells)
    for cell in plan.cells:
        assert run_path(tmp_path, cell).parent == tmp_path / "runs"
        # Beside it lie its log and its lock, and for a moment what is being written.
        assert len(f".{cell.name}.ddenv.scene.log.01234567".encode()) <= LONGEST_FILE_NAME
        assert cell.name.isprintable() and not set(cell.name) & set("/\\ .:|?*~")


NAMES = "expected names separated by commas"
WRONG = (
    (
        {"scenarios": ("dich",)},
        r"no scenario 'dich' \(did you mean ditch\?\); bundled are ditch, friction",
    ),
    ({"scenarios": (" , ",)}, rf"--scenarios: {NAMES}; found ' , '"),
    (
        {"pairs": "model2model"},
        r"--pairs: 'model2model' is not a pair \(did you mean model2model/.*or give 'paper'",
    ),
    (
        {"pairs": "paper,timeseg/failur-proximal"},
        (
            r"--pairs: no prioritization 'failur-proximal' \(did you mean "
            r"failure-proximal\?\).*; or "
            r"give 'paper' or 'all'"
        ),
    ),
    (
        {"algorithms": "ddmni"},
        r"--algorithms: no algorithm 'ddmni' \(did you mean ddmin\?\).*; or give 'all'",
    ),
    ({"growth": "fast"}, r"options: reduction.growth: 'fast' is not allowed"),
)


@pytest.mark.parametrize(("words", "told"), WRONG, ids=[str(words) for words, _ in WRONG])
def test_names_that_make_no_sense_get_one_line_with_the_nearest(words, told):
    with pytest.raises(UserError, match=told):
        make_plan(**words)


def test_names_of_scenarios_that_cannot_be_told_apart_are_refused(tmp_path):
    for one, two, told in (
        ("crates", "crates", "the names of two of them make the same file names"),
        ("a b", "a?b", "the names of two of them make the same file names"),
        (LONGEST, LONGEST[:-1], "the names of two of them make the same file names"),
    ):
        with pytest.raises(UserError, match=told):
            plan_of(crates(tmp_path, one), crates(tmp_path, two))
