"""What is happening, in words, in runs by each algorithm."""

import fake_run
import pytest

from ddenv.schemas import names
from ddenv.words.explain import explain
from ddenv.words.methods import ANY, LISTINGS, listing
from tests.workbench.test_explain import snapshot, told


@pytest.mark.parametrize("shown", [*LISTINGS.values(), ANY], ids=[*LISTINGS, "any"])
def test_lines_of_a_listing_are_in_order_and_every_step_has_one(shown):
    numbers = [number for number, _ in shown.lines]
    assert numbers == sorted(set(numbers))
    steps = (
        "baseline",
        "split",
        "next",
        "test",
        "rerun",
        "waiting",
        "reduced",
        "nothing",
        "returned",
    )
    assert {shown.line(step, None) for step in steps} <= set(numbers)
    # The panel of the run screen is so wide inside, without the mark and the number.
    assert all(len(code) <= 49 for _, code in shown.lines)


def test_the_listing_says_when_n_grows():
    assert (15, " n_partitions ← n_partitions + 1") in listing("ddenv").lines
    assert (15, " if none similar: n_partitions + 1, or splitting") in listing(
        "ddenv", "steady"
    ).lines


def test_every_bundled_algorithm_has_its_own_listing():
    assert set(LISTINGS) == set(names("algorithm"))
    assert listing("theirs") is ANY


@pytest.fixture
def run_by(runs):
    """Makes a run by an algorithm, after its baseline."""
    made = []

    def make(algorithm):
        data = fake_run.scenario()
        data["reduction"]["algorithm"] = algorithm
        made.append(fake_run.FakeRun(runs / f"{algorithm}.ddenv", data))
        return made[-1].created().baseline()

    yield make
    for each in made:
        each.close()


def leave_out(run, *groups, kept=tuple(range(11))):
    """A round that leaves out each of the groups (places in the kept models) in turn."""
    run.round += 1
    rest = [place for place in kept if len(groups) == 1 and place not in groups[0]]
    partitions = [*map(list, groups), *([rest] if rest else [])]
    candidates = [["complement", index, 0.0] for index in range(len(groups))]
    parts = {"n_partitions": len(partitions), "environment": list(kept), "partitions": partitions}
    run.write("round_started", round=run.round, **parts, candidates=candidates)


BEGINNINGS = {
    "ddmin": "the 11 models of E are cut into parts of equal size, in the order of the world file",
    "probdd": "of the 11 models of E, the group with the greatest expected gain is left out",
    "splitting": "the farthest undecided ones are left out; failure-proximal defines how far",
    "theirs": "theirs chooses candidates from the 11 models of E",
}


@pytest.mark.parametrize(("algorithm", "words"), BEGINNINGS.items())
def test_before_a_round_each_algorithm_says_where_its_candidates_come_from(
    run_by, algorithm, words
):
    line, told_words = told(run_by(algorithm))
    assert line == listing(algorithm).steps["split"]
    assert words in told_words
    assert "split by" not in told_words


@pytest.mark.parametrize("algorithm", ["ddmin", "probdd", "splitting", "theirs"])
def test_tests_and_reruns_are_marked_in_the_listing_of_the_algorithm(run_by, algorithm):
    run = run_by(algorithm)
    leave_out(run, [0, 1])
    first = run.start(0)
    explanation = explain(snapshot(run))
    assert explanation.lines is listing(algorithm).lines
    assert "R(" in dict(explanation.lines)[explanation.line]
    assert "First run of without A (9 models), candidate 1 of 1." in explanation.sentences
    run.finish(first, "pass")
    run.start(0, 1)
    explanation = explain(snapshot(run))
    assert "deflake" in dict(explanation.lines)[explanation.line]
    assert "Re-run 1 of 3" in explanation.sentences[0]


def test_ddmin_says_how_n_changes(run_by):
    run = run_by("ddmin")
    run.start_round(3)
    for candidate in range(6):
        run.dissimilar(candidate)
    assert "n doubles" in told(run)[1]
    run.write("round_finished")
    assert "so n doubles" in told(run)[1]
    run.start_round(3)
    run.reduce(0, run.elements[:4], run.similar(0))
    assert "n doubles" not in told(run)[1]


FRUITLESS = {
    ("probdd", 2): "each model left out is now more likely to be needed",
    (
        "splitting",
        2,
    ): "at least one of the models left out is needed; of several, half are left out next",
}


@pytest.mark.parametrize(
    ("algorithm", "size", "words"), [(*what, words) for what, words in FRUITLESS.items()]
)
def test_a_group_that_is_needed_is_followed_by_what_that_means(run_by, algorithm, size, words):
    run = run_by(algorithm)
    leave_out(run, list(range(size)))
    run.dissimilar(0)
    line, told_words = told(run)
    assert line == 6
    assert f"E stays as it is; {words}." in told_words
    run.write("round_finished")
    assert words in told(run)[1]


@pytest.mark.parametrize("algorithm", ["probdd", "splitting"])
def test_the_last_sweep_is_named(run_by, algorithm):
    run = run_by(algorithm)
    leave_out(run, [0], [1], [2], kept=[0, 1, 2])
    run.start(0)
    line, words = told(run)
    assert line == 7
    assert "without A (2 models), candidate 1 of 3" in words
    run.finish(5, "pass")
    for candidate in range(3):
        run.dissimilar(candidate)
    line, words = told(run)
    assert line == 7
    assert "Each model was left out once: nothing more can be removed." in words
    run.write("round_finished")
    run.write("finished", minimal=True, reason="no candidate showed f")
    assert told(run, "absent")[0] == 8
