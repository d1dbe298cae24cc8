"""Speculation must never change a verdict, whatever the rule."""

import random

from hypothesis import given
from hypothesis import strategies as st

from ddenv.reduction.verdict import Acceptance, decided_by, standing

firsts = st.builds(Acceptance, st.integers(1, 4))
keeping = st.builds(Acceptance, st.integers(1, 12), st.floats(0.05, 1), st.floats(0.3, 0.95), st.integers(0, 3))
rules = firsts | keeping
rates = st.lists(st.sampled_from([0.0, 0.3, 0.8, 1.0]), min_size=1, max_size=5)
salts = st.integers(0, 10**6)


def outcomes(rates, salt, breaks=0.0):
    """The outcome of each run of each candidate, the same whenever it is asked for."""

    def shown(candidate, run):
        draw = random.Random(f"{salt} {candidate} {run}")
        return "broken" if draw.random() < breaks else draw.random() < rates[candidate]

    return shown


def in_order(shown, candidates, rule):
    """What one worker finds: the winner, the verdicts, and the tests it makes."""
    made, verdicts = [], []
    for candidate in candidates:
        hits = misses = 0
        while not (verdict := rule.verdict(hits, misses)):
            made.append((candidate, hits + misses))
            result = shown(*made[-1])
            if result == "broken":
                verdict = "unknown"
                break
            hits, misses = hits + result, misses + (not result)
        verdicts.append(verdict)
        if verdict == "similar":
            return candidate, verdicts, made
    return None, verdicts, made


@given(
    rates=rates,
    salt=salts,
    rule=rules,
    breaks=st.sampled_from([0.0, 0.2]),
    workers=st.integers(1, 4),
    enough=st.sampled_from([None, 16]),
)
def test_any_number_of_workers_in_any_order_finds_what_one_worker_finds(rates, salt, rule, breaks, workers, enough):
    order, shown, candidates = random.Random(salt), outcomes(rates, salt, breaks), range(len(rates))
    winner, verdicts, made = in_order(shown, candidates, rule)
    known, running = {}, []
    while (now := standing(candidates, lambda *test: known.get(test), rule, enough=enough)).wanted:
        running += [test for test in now.wanted if test not in running][: workers - len(running)]
        done = running.pop(order.randrange(len(running)))
        known[done] = shown(*done)
    assert now.winner == winner
    assert list(now.verdicts) == verdicts
    assert set(made) <= set(known)
    if workers == 1:
        assert list(known) == made


@given(rates=rates, salt=salts, rule=rules, breaks=st.sampled_from([0.0, 0.2]))
def test_the_runs_that_decided_are_those_that_one_worker_makes(rates, salt, rule, breaks):
    shown = outcomes(rates, salt, breaks)
    _, verdicts, made = in_order(shown, range(len(rates)), rule)
    for candidate in range(len(verdicts)):
        runs = decided_by(lambda run, candidate=candidate: shown(candidate, run), rule)
        assert runs == sum(one == candidate for one, _ in made)


@given(rates=rates, salt=salts, rule=rules, refused=st.sets(st.integers(0, 4)))
def test_refused_candidates_need_no_test_and_cannot_win(rates, salt, rule, refused):
    shown, candidates = outcomes(rates, salt), range(len(rates))
    now = standing(candidates, shown, rule, frozenset(refused))
    assert now.winner == in_order(shown, [one for one in candidates if one not in refused], rule)[0]
    assert standing(candidates, lambda *_: None, rule, frozenset(range(5))).wanted == ()


@given(rates=rates, salt=salts, rule=rules, judged=st.integers(0, 4))
def test_candidates_that_are_judged_need_not_be_looked_at_again(rates, salt, rule, judged):
    shown, count = outcomes(rates, salt), len(rates)
    whole = standing(range(count), shown, rule)
    judged = min(judged, len(whole.verdicts) - 1)
    rest = standing(range(judged, count), shown, rule, first=judged)
    assert rest.verdicts == whole.verdicts[judged:]
    assert rest.winner == whole.winner


@given(salt=salts, rule=rules, broken=st.integers(0, 3))
def test_a_broken_run_that_decides_leaves_a_candidate_unknown_and_the_next_one_may_win(salt, rule, broken):
    hits = outcomes([1.0, 1.0], salt)
    runs = decided_by(lambda _: True, rule)

    def shown(candidate, run):
        return "broken" if (candidate, run) == (0, broken) else hits(candidate, run)

    now = standing([0, 1], shown, rule)
    assert now.verdicts == (("unknown", "similar") if broken < runs else ("similar",))
    assert now.winner == int(broken < runs)


def test_no_more_is_looked_at_than_workers_can_do():
    seen = []

    def candidates():
        for number in range(10_000):
            seen.append(number)
            yield number

    assert len(standing(candidates(), lambda *_: None, Acceptance(4), enough=8).wanted) == 8
    assert seen == [0, 1]
