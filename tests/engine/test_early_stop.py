"""Tests that end early: what they accept is run to its end, and whoever refutes them turns early
stop off for the run.
"""

from dataclasses import replace

import pytest

from ddenv.cli.test import line
from ddenv.engine.single_test import plan, run_trials
from ddenv.runfile.events import EarlyStopEnded
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import read_subject
from ddenv.words.early_stop import why_off
from ddenv.words.news import NEWS
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.oracles import needs
from tests.engine.reading import state_of


def cut_as(outcome, *needed):
    """Ends each run early that has these models, as `outcome`; others as another failure."""
    return lambda keep, seed: outcome if set(needed) <= keep else "other"


def run_of(folder, **more):
    return new_run(folder, **{"early_stop": True, "accept_rate": "kept", "keep_rate": 0.8} | more)


def test_what_is_accepted_is_run_to_its_end(tmp_path):
    pool = FakePool(needs("wall", "beam"), 2, cut=cut_as("similar", "wall", "beam"))
    state = drive(run_of(tmp_path), pool)
    assert set(state.environment) == {"wall", "beam"} and state.minimal
    assert state.early_stop_ended is None and state.cut_tests
    reduced = [node for node in state.nodes if node.how == "reduced"]
    assert reduced
    for node in reduced:
        evidence = state.tests[node.evidence_test - 1]
        made = [one for one in state.tests if (one.environment, one.run) == (node.id, evidence.run)]
        # The first that showed f is made once more.
        assert [one.cut for one in made] == [True, False] and made[-1] == evidence


def test_a_test_that_shows_no_f_to_its_end_turns_early_stop_off(tmp_path):
    """Early, one board suffices for f. The first full run says that it does not."""
    pool = FakePool(needs("wall", "beam"), 1, cut=cut_as("similar", "wall"))
    path = run_of(tmp_path)
    state = drive(path, pool)
    assert state.minimal and set(state.environment) == {"wall", "beam"}
    ended = state.early_stop_ended
    early, full = (state.tests[test - 1] for test in (ended.test, ended.by))
    assert early.cut and early.outcome == "similar" and not full.cut and full.outcome == "pass"
    assert (early.environment, early.run) == (full.environment, full.run)
    assert not any(test.cut for test in state.tests[full.id :])
    # No verdict rests on what ended early any more, and a resumed run keeps that.
    assert state_of(path).early_stop_ended == ended


def test_a_certificate_that_refutes_what_early_tests_accepted_turns_early_stop_off(tmp_path):
    """With the seeds of the search any two of three suffice for f, in full, too. With fresh ones
    they do not.
    """
    needed = {"wall", "beam", "post"}

    def oracle(keep, seed):
        return "similar" if needed <= keep or ("wall" in keep and seed < 5_000) else "pass"

    path = run_of(tmp_path)
    state = drive(path, FakePool(oracle, 1, cut=cut_as("similar", "wall")))
    ended = state.early_stop_ended
    # The first one refutes what a single test accepted, which was run to its end.
    assert ended == EarlyStopEnded(certificate=2)
    verdicts = [one.claims[0].verdict for one in state.certificates]
    assert verdicts[:2] == ["lost", "lost"] and verdicts[-1] == "kept"
    assert set(state.environment) == needed
    last = max(test.id for test in state.tests if test.cut)
    assert {test.run for test in state.tests[:last] if test.phase == "certify"} < set(range(12_000))
    assert why_off(state) == (
        "certificate 2 refutes what tests that ended early accepted: from here on all tests run "
        "to their end"
    )
    with RunFile(path) as file:
        kinds = [recorded.kind for recorded in file.events()]
    at = kinds.index("early_stop_ended")
    assert kinds[:at].count("certificate_finished") == 2 and kinds[at - 1] == "certificate_finished"
    assert NEWS["early_stop_ended"](state, state) == f"  {why_off(state)}"


def test_early_tests_without_f_accept_nothing_that_a_certificate_could_refute(tmp_path):
    """Any two of three suffice with the seeds of the search. Some tests end early there, and show
    no f.
    """
    needed = {"wall", "beam", "post"}

    def oracle(keep, seed):
        return "similar" if needed <= keep or ("wall" in keep and seed < 5_000) else "pass"

    def cut(keep, seed):
        return "other" if needed - {"post"} <= keep and seed % 8 == 3 else ""

    state = drive(run_of(tmp_path), FakePool(oracle, 1, cut=cut))
    assert state.certificates[0].claims[0].verdict == "lost"
    accepted = {node.id for node in state.nodes if node.how == "reduced"}
    assert any(test.cut and test.environment in accepted for test in state.tests)
    assert state.early_stop_ended is None


@pytest.fixture
def recorded(tmp_path):
    """A run of the small world, and a test of it that ended early."""
    path = run_of(tmp_path)
    state = drive(path, FakePool(needs("wall", "beam"), 1, cut=cut_as("similar", "wall", "beam")))
    return path, next(test for test in state.tests if test.cut and test.outcome == "similar")


@pytest.mark.parametrize(
    ("shows", "said"),
    [
        ("similar", "up to there every bit is the same; in full: similar, stuck, 0.00 m from f"),
        ("other", "the trajectory differs; now: other, stuck, 7.00 m from f"),
        ("error", "the trajectory differs; now: error, it broke"),
    ],
)
def test_a_test_that_is_repeated_stands_beside_its_record(recorded, monkeypatch, shows, said):
    path, test = recorded
    monkeypatch.setattr("ddenv.engine.single_test.Pool", lambda *_: Closing(lambda *_: shows, 1))
    with RunFile(path) as file:
        subject = replace(read_subject(file), run=path)
    (found,) = run_trials(subject, plan(subject, test=test.id), 1)
    begins = f"recorded as test {test.id}: similar, stuck, 0.00 m from f, ended early at 2.0 s; "
    assert found["recorded"] == begins + said
    assert line(found | {"without": None}).endswith(f"\n  {begins}{said}")


class Closing(FakePool):
    def close(self):
        pass
