"""Speculation must never change a verdict."""

import random

from hypothesis import given
from hypothesis import strategies as st

from ddenv.reduction.verdict import standing


def finished(known):
    return lambda candidate, run: known.get((candidate, run))


tables = st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=5)


def in_order(table, iterations):
    """What one worker finds: the winner, its run, and the tests it makes."""
    made = []
    for candidate, row in enumerate(table):
        for run in range(1 + iterations):
            made.append((candidate, run))
            if row[run]:
                return candidate, run, made
    return None, None, made


@given(
    table=tables,
    iterations=st.integers(0, 3),
    workers=st.integers(1, 4),
    seed=st.integers(0, 10**6),
    enough=st.sampled_from([None, 16]),
)
def test_any_number_of_workers_in_any_order_finds_what_one_worker_finds(table, iterations, workers, seed, enough):
    rng = random.Random(seed)
    candidates = list(range(len(table)))
    winner, evidence, made = in_order(table, iterations)
    known, running = {}, []
    for _ in range(1000):
        now = standing(candidates, finished(known), iterations, enough=enough)
        if not now.wanted:
            break
        running += [test for test in now.wanted if test not in running][: workers - len(running)]
        done = running.pop(rng.randrange(len(running)))
        known[done] = table[done[0]][done[1]]
    assert not now.wanted
    assert now.winner == winner
    if winner is not None:
        assert now.evidence[winner] == evidence
    assert set(made) <= set(known)
    if workers == 1:
        assert list(known) == made


@given(table=tables, refused=st.sets(st.integers(0, 4)))
def test_refused_candidates_need_no_test_and_cannot_win(table, refused):
    known = {(candidate, run): shown for candidate, row in enumerate(table) for run, shown in enumerate(row)}
    now = standing(range(len(table)), finished(known), 3, frozenset(refused))
    assert now.winner not in refused
    assert standing(range(len(table)), finished({}), 3, frozenset(range(5))).wanted == ()
    rest = [candidate for candidate in range(len(table)) if candidate not in refused and any(table[candidate])]
    assert now.winner == (rest[0] if rest else None)


@given(table=tables, judged=st.integers(0, 4))
def test_candidates_that_are_judged_need_not_be_looked_at_again(table, judged):
    known = {(candidate, run): shown for candidate, row in enumerate(table) for run, shown in enumerate(row)}
    whole = standing(range(len(table)), finished(known), 3)
    judged = min(judged, len(whole.verdicts) - 1)
    rest = standing(range(judged, len(table)), finished(known), 3, first=judged)
    assert rest.verdicts == whole.verdicts[judged:]
    assert rest.winner == whole.winner


def test_no_more_is_looked_at_than_workers_can_do():
    seen = []

    def candidates():
        for number in range(10_000):
            seen.append(number)
            yield number

    assert len(standing(candidates(), finished({}), 3, enough=8).wanted) == 8
    assert seen == [0, 1]
