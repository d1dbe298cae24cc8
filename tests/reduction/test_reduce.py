"""The reduction as a function, without Drake."""

import tomllib
from collections import Counter
from functools import cache
from itertools import pairwise
from math import comb
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ddenv
from ddenv.environment import NOTHING, Environment
from ddenv.reduction.guide import make_guide
from ddenv.reduction.reduce import Step
from ddenv.reduction.round import Candidate
from ddenv.schemas import names
from tests.command import loaded, python
from tests.conftest import ROOT
from tests.reduction.worlds import line
from tests.tiers import examples

ELEMENTS = tuple("abcdefgh")
POSITIONS = {name: (float(index), 0.5, 0.0) for index, name in enumerate(ELEMENTS)}
TRAJECTORY = np.array([[0.1 * step, 8 - 0.1 * step, 0.0, 0.0, np.pi] for step in range(81)])
SENSED = {"a": 3.0, "h": 0.1}
ALL = {
    "positions": POSITIONS,
    "trajectory": TRAJECTORY,
    "first_sensed": SENSED,
    "touched": ["a", "b"],
    "traits": {name: ddenv.Traits(size) for size, name in enumerate(ELEMENTS, start=1)},
}


def needs(*needed):
    return lambda kept: kept >= set(needed)


@pytest.mark.parametrize("algorithm", names("algorithm"))
@pytest.mark.parametrize("partitioning", names("partitioning"))
@pytest.mark.parametrize("prioritization", names("prioritization"))
def test_every_combination_finds_the_needed_ones(algorithm, partitioning, prioritization):
    found = ddenv.reduce(
        ELEMENTS,
        needs("b", "g"),
        algorithm=algorithm,
        partitioning=partitioning,
        prioritization=prioritization,
        **ALL,
    )
    assert found.kept == ("b", "g")


def test_it_counts_the_tests_it_makes_and_makes_none_twice():
    made = []

    def test(kept):
        made.append(kept)
        return kept >= {"b", "g"}

    found = ddenv.reduce(ELEMENTS, test, iterations=0, **ALL)
    assert found.tests == len(made) == len(set(made))
    assert made[0] == frozenset(ELEMENTS)
    assert found.rounds > 1


def test_its_history_goes_from_all_to_what_is_kept():
    found = ddenv.reduce(ELEMENTS, needs("b", "g"), **ALL)
    assert found.history[0] == Step(0, ELEMENTS)
    assert found.history[-1].kept == found.kept
    tests = [step.tests for step in found.history]
    assert tests == sorted(tests)
    assert tests[-1] <= found.tests
    for before, after in zip(found.history, found.history[1:], strict=False):
        assert set(after.kept) < set(before.kept)


def four_of_five(salt):
    """Needs b and g, and then shows in four of five runs."""
    rng = np.random.default_rng(salt)
    return lambda kept: kept >= {"b", "g"} and rng.random() < 0.8


@given(salt=st.integers(0, 2**31))
@examples(0.3)
def test_a_failure_that_shows_in_four_of_five_runs_is_never_lost_and_minimal_is_true(salt):
    found = ddenv.reduce(ELEMENTS, four_of_five(salt), iterations=12, **ALL)
    assert set(found.kept) >= {"b", "g"}
    assert not found.minimal or found.kept == ("b", "g")


@pytest.mark.parametrize(
    "options", [{}, {"iterations": 3}, {"iterations": 3, "accept_rate": "first"}]
)
def test_a_world_that_does_not_fail_is_refused(options):
    with pytest.raises(ddenv.UserError, match="does not show with all elements"):
        ddenv.reduce(ELEMENTS, lambda _: False, algorithm="ddmin", **options)


def drifting(salt):
    """Needs b; c and g are enough to show the failure now and then, both show it always."""
    rng = np.random.default_rng(salt)
    return lambda kept: "b" in kept and rng.random() < (0.0, 0.25, 1.0)[len(kept & {"c", "g"})]


@given(salt=st.integers(0, 2**31), algorithm=st.sampled_from(names("algorithm")))
@examples(0.5)
def test_the_rate_is_kept_and_each_claim_says_what_its_fresh_runs_showed(salt, algorithm):
    made, test = [], drifting(salt)

    def counted(kept):
        made.append((kept, test(kept)))
        return made[-1][1]

    found = ddenv.reduce(ELEMENTS, counted, algorithm=algorithm, accept_rate="kept", **ALL)
    assert found.kept == ("b", "c", "g")
    assert found.minimal
    assert (
        found.tests
        == len(made)
        == found.baseline_tests + found.search_tests + found.certificate_tests
    )
    assert [(claim.without, claim.verdict) for claim in found.claims] == [
        (None, "kept"),
        ("b", "needed"),
        ("c", "needed"),
        ("g", "needed"),
    ]
    assert set(found.history[-1].kept) >= set(found.kept)
    fresh = made[-found.certificate_tests :]
    for claim in found.claims:
        shown = [
            result for kept, result in fresh if kept == frozenset(found.kept) - {claim.without}
        ][-claim.runs :]
        assert (claim.shown, claim.runs) == (sum(shown), len(shown))
        assert claim.low <= claim.shown / claim.runs <= claim.high


def test_the_certificate_calls_each_world_once_in_a_block_and_draws_the_order():
    """Six needed elements and a failure that always shows: 11 pairs for the rate, 7 for each
    element, 64 calls in all.
    """
    needed, first = set("abcdef"), set()
    for seed in range(8):
        made = []
        found = ddenv.reduce(
            ELEMENTS,
            lambda kept, made=made: made.append(kept) or kept >= needed,
            iterations=3,
            seed=seed,
            **ALL,
        )
        assert found.minimal
        fresh = made[-found.certificate_tests :]
        assert len(fresh) == 64
        blocks = [[]]
        for kept in fresh:
            if kept in blocks[-1]:
                blocks.append([])
            blocks[-1].append(kept)
        assert all(frozenset(needed) in block for block in blocks)
        first.update(block[0] for block in blocks)
        assert found == ddenv.reduce(ELEMENTS, needs(*needed), iterations=3, seed=seed, **ALL)
    assert first == {
        frozenset(ELEMENTS),
        frozenset(needed),
        *(frozenset(needed - {name}) for name in needed),
    }


@cache
def stepping_back(salt):
    """A reduction that drifts: what is found, its rounds, and the environments to which it went
    back.
    """
    rounds, options = [], {"skip": "known", "accept_rate": "kept"}
    found = ddenv.reduce(ELEMENTS, drifting(salt), on_round=rounds.append, **options, **ALL)
    steps = zip(found.history, found.history[1:], strict=False)
    return (
        found,
        rounds,
        [after.kept for before, after in steps if set(after.kept) > set(before.kept)],
    )


def test_after_a_certificate_the_chosen_algorithm_goes_on_with_the_n_that_it_had():
    """A round of ddenv begins with a partition; one that leaves out again what had gone has one
    candidate; a sweep does neither.
    """
    again = 0
    for salt in range(20):
        _, rounds, reached = stepping_back(salt)
        assert all(
            len(one.candidates) == 1 or one.candidates[0][0] == "partition" for one in rounds
        )
        for environment in reached:
            there = [one for one in rounds if one.environment == environment]
            # What leaves out again has two parts: the group and the rest.
            assert all(
                len(before.partitions) <= len(after.partitions)
                for before, after in pairwise(there)
                if len(after.candidates) > 1
            )
            again += any(len(after.candidates) > 1 for after in there[1:])
    assert again


def test_what_lost_the_rate_is_not_taken_again():
    backs = 0
    for salt in range(20):
        lost, chain = [], []
        for kept in (set(step.kept) for step in stepping_back(salt)[0].history):
            assert not any(kept <= one for one in lost)
            if chain and kept > chain[-1]:
                place = chain.index(kept)
                lost.append(chain[place + 1])
                del chain[place:]
                backs += 1
            chain.append(kept)
    assert backs


def line_of(count):
    """A world of so many models on a line at whose end the robot fails."""
    path = np.array([[0.0, 0.0, 0.0, 0.0, 0.0], [10.0, count, 0.0, 0.0, 0.0]])
    return {
        "positions": {f"m{index}": (float(index), 0.0, 0.0) for index in range(count)},
        "trajectory": path,
    }


def test_splitting_looks_once_where_the_failure_is_flaky_and_confirms_the_end():
    """Within 1.6 times the bits that name the needed models, at what a run tells of them (0.618
    bits at a rate of 0.8).
    """
    needed, tests = {"m30", "m33", "m35"}, []
    for salt in range(30):
        rng, made = np.random.default_rng(salt), []

        def flaky(kept, rng=rng, made=made):
            made.append(kept)
            return kept >= needed and rng.random() < 0.8

        options = {"algorithm": "splitting", "iterations": 3, "accept_rate": "first"}
        found = ddenv.reduce([f"m{index}" for index in range(36)], flaky, **options, **line_of(36))
        assert set(found.kept) == needed
        assert found.minimal is None
        assert all(made.count(frozenset(needed - {name})) == 4 for name in needed)
        tests.append(found.search_tests)
    assert np.mean(tests) <= 1.6 * np.log2(comb(36, 3)) / 0.618


def test_the_papers_rule_is_content_with_a_rarer_failure_and_claims_nothing():
    ends = [
        ddenv.reduce(ELEMENTS, drifting(salt), iterations=3, accept_rate="first", **ALL)
        for salt in range(20)
    ]
    assert any(found.kept != ("b", "c", "g") for found in ends)
    assert all(not found.claims and not found.certificate_tests for found in ends)


@given(
    needed=st.sets(st.sampled_from(ELEMENTS), min_size=1),
    algorithm=st.sampled_from(names("algorithm")),
)
def test_minimal_is_said_only_if_each_element_was_left_out(needed, algorithm):
    tested = []

    def test(kept):
        tested.append(kept)
        return kept >= needed

    for candidates in ("both", "partitions", "complements"):
        tested.clear()
        found = ddenv.reduce(ELEMENTS, test, algorithm=algorithm, candidates=candidates, **ALL)
        left = frozenset(found.kept)
        assert found.minimal == all(left - {name} in tested for name in left)
        assert not found.minimal or left == needed
        assert found.minimal or candidates == "partitions"


def in_any_way(salt):
    """Shows the failure in a third of all sets, without any order in it."""
    return lambda kept: kept == set(ELEMENTS) or crc32(f"{salt} {sorted(kept)}".encode()) % 3 == 0


@pytest.mark.parametrize("salt", range(8))
def test_what_a_search_does_not_try_again_the_certificate_does(salt):
    test = in_any_way(salt)
    found = ddenv.reduce(ELEMENTS, test, iterations=1, accept_rate="kept", **ALL)
    assert found.minimal
    assert not any(test(frozenset(found.kept) - {name}) for name in found.kept)


@given(
    salt=st.integers(0, 2**31),
    rate=st.sampled_from([0.3, 0.5, 0.7, 0.9]),
    algorithm=st.sampled_from(names("algorithm")),
)
@examples(0.5)
@pytest.mark.filterwarnings("ignore:the failure shows in about")
def test_a_flaky_test_is_noticed_or_shows_the_same_in_all_replays(salt, rate, algorithm):
    """With the defaults: one miss, even the first, neither ends the reduction nor makes it
    minimal.
    """
    rng, made = np.random.default_rng(salt), []

    def test(kept):
        made.append((kept, bool(kept >= {"b", "g"} and rng.random() < rate)))
        return made[-1][1]

    try:
        found = ddenv.reduce(ELEMENTS, test, algorithm=algorithm, **ALL)
    except ddenv.UserError:
        assert made == [(frozenset(ELEMENTS), False)] * 10
        return
    assert found.tests == len(made)
    assert found.flaky == (len(set(made)) > len({kept for kept, _ in made}))
    if found.flaky:
        assert found.claims
        assert not found.minimal or found.kept == ("b", "g")
    else:
        answers = Counter(made)
        left = frozenset(found.kept)
        assert answers[left, True] >= 3
        assert found.minimal == all(answers[left - {name}, False] == 2 for name in left)


@pytest.mark.parametrize("options", [{"iterations": 0}, {"iterations": 3, "accept_rate": "first"}])
def test_where_one_call_decides_minimal_is_not_said(options):
    assert ddenv.reduce(ELEMENTS, needs("b", "g"), **options, **ALL).minimal is None
    partitions = ddenv.reduce(ELEMENTS, needs("b", "g"), candidates="partitions", **options, **ALL)
    assert partitions.minimal in (None, False)


def graded(rng):
    """Shows in 95 % with all elements; without "a" never, and without each of "b" to "f" 0.9 times
    as often.
    """
    return lambda kept: "a" in kept and rng.random() < 0.95 * 0.9 ** len(set("bcdef") - kept)


@pytest.mark.parametrize("algorithm", ["ddenv", "splitting"])
def test_where_many_elements_take_a_bit_it_ends_within_its_calls_with_what_is_not_lost(algorithm):
    for salt in range(5):
        found = ddenv.reduce(
            ELEMENTS, graded(np.random.default_rng(salt)), algorithm=algorithm, iterations=3, **ALL
        )
        assert found.tests < 1500
        assert found.claims[0].verdict != "lost"
        assert found.claims[0].bound
        left = {claim.without for claim in found.claims} - {None}
        assert left <= set(found.kept) == set(found.history[-1].kept)


def test_what_a_rare_failure_costs_is_said_before():
    """And what the calls show by then is returned."""
    rng = np.random.default_rng(3)
    with pytest.warns(
        UserWarning,
        match="to certify what is left takes about .* of them, and most_tests allows 300",
    ):
        found = ddenv.reduce(
            ELEMENTS, lambda kept: "a" in kept and rng.random() < 0.3, most_tests=300, **ALL
        )
    assert found.flaky
    assert found.certificate_tests <= 400


def test_where_a_certificate_follows_a_search_needs_fewer_tests():
    kept, first = (
        ddenv.reduce(ELEMENTS, needs("b", "g"), iterations=1, accept_rate=rule, **ALL)
        for rule in ("kept", "first")
    )
    assert kept.kept == first.kept
    assert kept.search_tests < first.search_tests


def test_without_a_check_the_first_test_is_already_a_smaller_one():
    made = []
    ddenv.reduce(
        ELEMENTS,
        lambda kept: bool(made.append(kept)) or kept >= {"a"},
        check=False,
        algorithm="ddmin",
    )
    assert made[0] != frozenset(ELEMENTS)


def test_rounds_are_reported_before_they_are_tested():
    reported = []
    found = ddenv.reduce(ELEMENTS, needs("b"), on_round=reported.append, **ALL)
    assert len(reported) == found.rounds
    assert reported[0].environment == ELEMENTS


WRONG = {
    "no positions": (
        {},
        "partitioning 'model2model' needs positions, which is missing; or use one of timeseg",
    ),
    "no trajectory": (
        {"positions": POSITIONS, "partitioning": "timeseg", "failure_pose": (0, 0, 0)},
        "partitioning 'timeseg' needs a trajectory",
    ),
    "no failure": (
        {"positions": POSITIONS},
        "prioritization 'failure-proximal' needs a failure_pose",
    ),
    "no times": (
        {"positions": POSITIONS, "prioritization": "timestep"},
        "prioritization 'timestep' needs first_sensed",
    ),
    "unknown algorithm": ({"algorithm": "ddmim"}, "no algorithm 'ddmim' (did you mean ddmin?)"),
    "unknown schema": (
        {"partitioning": "timesegs"},
        "no partitioning 'timesegs' (did you mean timeseg?)",
    ),
    "a place is missing": (
        {"positions": {"a": (0, 0, 0)}},
        "positions['b']: expected x, y, z m, found None",
    ),
    "a place is none": (
        {"positions": POSITIONS | {"a": (0, float("nan"), 0)}},
        "positions['a']: expected x, y, z m",
    ),
    "a place is text": (
        {"positions": POSITIONS | {"a": "near"}},
        "positions['a']: expected x, y, z m",
    ),
    "a trajectory of another shape": (
        {"trajectory": np.zeros((3, 4))},
        "shape (N, 5), found shape (3, 4)",
    ),
    "a trajectory of words": (
        {"trajectory": [["now", "here"]]},
        "trajectory: expected finite numbers",
    ),
    "a trajectory backwards": (
        {"trajectory": TRAJECTORY[::-1]},
        "its times, in the first column, must not decrease",
    ),
    "a time of sensing": (
        {"first_sensed": {"a": "soon"}},
        "first_sensed['a']: expected a time in s",
    ),
    "iterations": (
        {"iterations": -1},
        "iterations: expected a whole number from 0 to 1000, found -1",
    ),
    "n_partitions": (
        {"n_partitions": 1},
        "n_partitions: expected a whole number from 2 to 100000, found 1",
    ),
    "candidates": (
        {"candidates": "all"},
        "candidates: 'all' is not allowed; use one of both, partitions, complements",
    ),
    "accept_rate": (
        {"accept_rate": "often"},
        "accept_rate: 'often' is not allowed; use one of first, kept",
    ),
    "keep_rate": (
        {"keep_rate": 1.0},
        "keep_rate: expected a number, more than 0, at most 0.95, found 1.0",
    ),
    "most_tests": ({"most_tests": 0}, "most_tests: expected a whole number, at least 1, found 0"),
    "baseline_runs": (
        {"baseline_runs": 0},
        "baseline_runs: expected a whole number from 1 to 1000, found 0",
    ),
    "prior": ({"prior": "near"}, "prior: 'near' is not allowed"),
    "delta": ({"delta": 0}, "delta: expected a number, more than 0"),
    "no seed": ({"seed": None}, "seed: expected a whole number from 0 to 2147483647, found None"),
    "positions in a list": (
        {"positions": [(0, 0, 0)] * 8},
        "positions: expected a mapping from names to values, found list",
    ),
    "a place beyond all bounds": (
        {"positions": POSITIONS | {"a": (1e200, 0, 0)}},
        "positions['a']: expected x, y, z m",
    ),
    "a time before the beginning": (
        {"first_sensed": {"a": -1e6}},
        "first_sensed['a']: expected a time in s",
    ),
    "a time beyond all numbers": (
        {"first_sensed": {"a": 10**400}},
        "first_sensed['a']: expected a time in s",
    ),
    "a complex trajectory": (
        {"trajectory": TRAJECTORY + 1j},
        "trajectory: expected finite numbers",
    ),
    "no algorithm": (
        {"algorithm": None, **ALL},
        "algorithm: expected a name, found None; use one of ddenv",
    ),
    "a number as schema": ({"partitioning": 3}, "partitioning: expected a name, found 3"),
    "traits of another kind": (
        {"traits": dict.fromkeys(ELEMENTS, 1)},
        "traits['a']: expected ddenv.Traits, found 1",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_reported_in_one_line_before_any_test(case):
    options, words = WRONG[case]
    made = []
    with pytest.raises(ddenv.UserError) as error:
        ddenv.reduce(ELEMENTS, lambda kept: not made.append(kept), **options)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    assert not made


@pytest.mark.parametrize(
    ("elements", "words"),
    [*((one, "expected names") for one in (None, 3, [["a"]])), ("abca", "'a' occurs twice")],
)
def test_elements_that_are_no_names_or_have_one_twice_are_refused(elements, words):
    with pytest.raises(ddenv.UserError, match=f"elements: {words}"):
        ddenv.reduce(elements, needs("a"), algorithm="ddmin")


def test_numbers_of_numpy_are_numbers():
    numbers = {"iterations": np.int64(1), "seed": np.int32(2), "delta": np.float32(0.3)}
    facts = ALL | {"first_sensed": {"a": np.float32(1), "b": np.int64(2)}}
    assert ddenv.reduce(
        ELEMENTS, needs("b"), prioritization="timestep", **numbers, **facts
    ).kept == ("b",)


@pytest.mark.parametrize("error", [RuntimeError, StopIteration])
@pytest.mark.parametrize("where", ["test", "on_round"])
def test_whatever_is_raised_comes_through_also_the_end_of_an_iterator(where, error):
    def raises(*_):
        raise error

    calls = {"test": needs("b"), "on_round": None} | {where: raises}
    with pytest.raises(error):
        ddenv.reduce(ELEMENTS, algorithm="ddmin", **calls)


def test_the_library_needs_neither_drake_nor_a_screen():
    code = (
        "import ddenv; assert ddenv.reduce('abcdef', lambda kept: kept >= {'a', 'e'}, "
        "algorithm='ddmin').kept == ('a', 'e')"
    )
    assert loaded(code, "pydrake", "textual", "pydantic", "yaml") == []


@pytest.mark.examples
def test_the_guides_examples_run():
    """Each Python block of the library's page runs as printed, and prints what stands below it."""
    page = (ROOT / "docs" / "library.md").read_text()
    blocks = [part.split("```", 1)[0] for part in page.split("```python\n")[1:]]
    assert len(blocks) >= 2
    for block in blocks:
        done = python(block)
        assert done.returncode == 0, done.stderr
        shown = [
            line.split("# prints ", 1)[1] for line in block.splitlines() if "# prints " in line
        ]
        assert done.stdout.splitlines() == shown


@pytest.mark.examples
def test_the_guides_algorithm_works_as_printed():
    page = (ROOT / "docs" / "library.md").read_text()
    blocks = (part.split("```")[0] for part in page.split("```python\n"))
    found = {}
    exec(next(block for block in blocks if block.startswith("# file farthest_half.py")), found)
    known = line(a=0, b=1, c=2, d=3, e=4, f=5, g=6, h=7)
    searching = found["farthest_half"](
        tuple(range(8)), make_guide("model2model", "failure-proximal", lambda: known)
    )
    assert [one.models for one in next(searching).candidates] == [Environment.of(range(4))]
    assert [
        one.models
        for one in searching.send(
            Candidate(kind="", partition=0, part=(), models=Environment.of(range(4)), lacks=NOTHING)
        ).candidates
    ] == [Environment.of(range(2))]
    with pytest.raises(StopIteration) as end:
        searching.send(None)
    assert end.value.value == Environment.of(range(4))


@pytest.mark.examples
def test_the_guides_package_works_as_printed(tmp_path):
    """Put where pip would put it, its schema is used by name."""
    page = (ROOT / "docs" / "library.md").read_text()
    module = next(
        part.split("```")[0]
        for part in page.split("```python\n")
        if part.startswith("# file heavy_first.py")
    )
    project = tomllib.loads(page.split("```toml\n")[1].split("```")[0])["project"]
    (tmp_path / "heavy_first.py").write_text(module)
    info = tmp_path / f"{project['name']}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = project["entry-points"].items()
    points = "\n".join(
        f"[{group}]\n" + "\n".join(f"{k} = {v}" for k, v in entries.items())
        for group, entries in groups
    )
    (info / "entry_points.txt").write_text(points)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "import ddenv\n"
        "traits = {name: ddenv.Traits(size) for name, size in zip('abcd', (1, 9, 2, 3))}\n"
        "positions = {name: (float(x), 0, 0) for x, name in enumerate('abcd')}\n"
        "first = []\n"
        "ddenv.reduce('abcd', lambda kept: first.append(kept) or 'b' in kept, "
        "prioritization='heavy-first',\n"
        "             positions=positions, traits=traits, check=False, n_partitions=4)\n"
        "print(sorted(first[0]))"
    )
    done = python(code)
    assert done.stdout.strip() == "['b']", done.stderr
