"""The algorithms step by step, on examples worked by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ddenv.environment import Environment
from tests.reduction.worlds import evidence, line, needing, run, tried

LETTERS = "abcdefgh"


def letters(models):
    """Models by letters: number 0 is a."""
    return "".join(LETTERS[model] for model in models)


def words(candidates):
    return [letters(one.models) for one in candidates]


def test_ddenv_in_a_world_of_six_models_line_by_line():
    """Models on a line at x = 0, 1, 5, 6, 20, 21, the failure at 0; f needs a and e. The numbers
    are Algorithm 1's lines.
    """
    known = line(a=0, b=1, c=5, d=6, e=20, f=21)
    kept, rounds = run(known, needing(known, "a", "e"))
    steps = [
        (
            letters(round.environment),
            round.n_partitions,
            list(map(letters, round.partitions)),
            words(tried(round, won)),
            won and letters(won.models),
        )
        for round, won in rounds
    ]
    assert steps == [
        # 2: two clusters, abcd (2.5 to 3 m around) and ef. 3: abcd is nearer to f. 4-9: p0 lacks e;
        # c0 is ef, which lacks a; p1 and c1 are these two again. 14: n = 3. 15: nothing similar,
        # but 3 != 6.
        ("abcdef", 2, ["abcd", "ef"], ["abcd", "ef"], None),
        # 2: ab, cd, ef. 3: by their centroids 0.5, 5.5 and 20.5 m from f. 4-9: p0 = ab lacks e, c0
        # = cdef lacks a, p1 = cd lacks both, c1 = abef holds a and e. 10-12: E is abef. 14: n = 4.
        ("abcdef", 3, ["ab", "cd", "ef"], ["ab", "cdef", "cd", "abef"], "abef"),
        # 2: four models, four partitions. 4-9: p0 = a, c0 = bef and p1 = b fail, c1 = aef is
        # similar. 14: n = 5. 17: cut to 3.
        ("abef", 4, ["a", "b", "e", "f"], ["a", "bef", "b", "aef"], "aef"),
        # p0 = a (known), c0 = ef (known), p1 = e and c1 = af fail, p2 = f fails, c2 = ae is
        # similar. 14: n = 4. 17: n = 2.
        ("aef", 3, ["a", "e", "f"], ["a", "ef", "e", "af", "f", "ae"], "ae"),
        # p0 = a and c0 = e, which is p1, fail. 15: nothing similar and n = |E|: 16, and 21 returns
        # E' = ae.
        ("ae", 2, ["a", "e"], ["a", "e"], None),
    ]
    assert letters(kept) == "ae"


def test_far_first_leaves_the_farthest_out_first():
    _, rounds = run(
        line(a=0, b=1, c=2), lambda _: False, n_partitions=3, complement_order="far-first"
    )
    complements = [one for one in rounds[0][0].candidates if one.kind == "complement"]
    assert words(complements) == ["ab", "ac", "bc"]


def test_steady_growth_keeps_n_after_a_success():
    known = evidence(12, 4)
    for growth, grows in (("paper", True), ("steady", False)):
        rounds = run(known, needing(known, "m3", "m8"), growth=growth)[1]
        wins = [(round, after) for (round, won), (after, _) in pairwise(rounds) if won is not None]
        grown = {
            after.n_partitions > round.n_partitions
            for round, after in wins
            if len(after.environment) > round.n_partitions
        }
        assert grown == {grows}


def test_ddmin_does_what_its_paper_prints():
    """Zeller and Hildebrandt 2002: eight changes, of which 1, 7 and 8 together fail. A test with *
    was made before.
    """
    known = evidence(8, 0)
    failing = Environment.of((0, 6, 7))
    seen, trace = set(), []
    kept, rounds = run(known, failing.__le__, algorithm="ddmin")
    for round, winner in rounds:
        for one in tried(round, winner):
            mark = "*" if one.models in seen else ""
            trace.append(
                "".join(str(1 + model) for model in one.models)
                + mark
                + ("!" if one is winner else "")
            )
            seen.add(one.models)
    # Two halves, then four quarters and their complements, of which 1-2, 5-8 still fails.
    assert trace[:8] == ["1234", "5678", "12", "34", "56", "78", "345678", "125678!"]
    # Three parts; all that was tested before is not tested again. Without 5 and 6 it still fails.
    assert trace[8:13] == ["12*", "56*", "78*", "5678*", "1278!"]
    # Two parts were tested, too; then four single changes. Without 2 it still fails.
    assert trace[13:21] == ["12*", "78*", "1", "2", "7", "8", "278", "178!"]
    # Three single changes, and then none can be left out.
    assert trace[21:] == ["1*", "7*", "8*", "78*", "18", "17"]
    assert kept == failing


def test_splitting_halves_what_holds_a_needed_model():
    """Of eight models on a line the nearest is needed; far to near."""
    known = line(**{name: index for index, name in enumerate("abcdefgh")})
    kept, rounds = run(known, needing(known, "a"), algorithm="splitting", prior="uniform")
    assert letters(kept) == "a"
    # With one chance in ten each, six models hold none that is needed with even chances, and then
    # the two that are left are one too many. The sweep at the end shows that a is needed.
    assert [(letters(sorted(round.partitions[0])), won is not None) for round, won in rounds] == [
        ("cdefgh", True),
        ("b", True),
        ("a", False),
    ]


def test_probdd_leaves_out_what_promises_most():
    """With a chance of 0.1 each, nine of twenty models promise most, and so it goes on: 1 / 0.1
    less one, Wang et al. 2021.
    """
    known = evidence(20, 3)
    rounds = run(known, needing(known, "m0"), algorithm="probdd", prior="uniform")[1]
    assert len(rounds[0][0].partitions[0]) in (9, 10)
    failed = [
        round.partitions[0] for round, won in rounds if won is None and len(round.partitions[0]) > 1
    ]
    assert all(0 in group for group in failed)


def test_steady_growth_halves_what_a_split_leaves_together():
    """A robot that stood still saw all models at one instant: near and far are separated all the
    same.
    """
    still = line(a=1, b=2, c=3, d=4, e=5, f=6, g=7, h=8)
    standing = replace(still, trajectory=np.array([[0.0, 0, 0, 0, 0]]))
    pair = ("timeseg", "failure-proximal")
    steady = run(standing, needing(standing, "c"), pair, growth="steady")[1]
    assert words(steady[0][0].candidates) == ["abcd", "efgh"]
    # As the paper has it, a split that leaves all together becomes one of single models.
    assert run(standing, needing(standing, "c"), pair)[1][0][0].exhaustive


def test_what_was_missed_by_chance_implies_nothing_once_it_is_gone():
    """Without e and f the failure is missed once, but shows when more is gone: then the two say
    nothing any more.
    """
    known = line(a=0, b=1, c=2, d=3, e=8, f=9, g=20, h=21)
    kept, rounds = run(
        known,
        lambda models: 0 in models and letters(models) != "abcdgh",
        growth="steady",
        skip="implied",
    )
    assert letters(kept) == "a"
    # It goes on in steps of several models, and not one by one.
    assert len(rounds) < 7
