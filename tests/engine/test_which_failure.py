"""Which failure it is: two within epsilon, ends that scatter, one that does not repeat, another
epsilon or failure midway.
"""

import pytest

from ddenv.engine.driver import Driver
from ddenv.engine.notes import note_start
from ddenv.errors import UserError
from ddenv.evidence.claims import is_minimal
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import read_subject
from ddenv.words.claims import verdict_on
from ddenv.words.explain import _offered
from ddenv.world.scenario import Oracle
from tests.engine.fake import FakePool, drive, engine, new_run
from tests.engine.guided import Guided, until
from tests.engine.oracles import needs
from tests.engine.reading import state_of


def two(keep, seed):
    """The wall stops most runs; else the beam stops the robot a little farther."""
    return "similar" if ("wall" in keep and seed % 10 < 6) or "beam" in keep else "pass"


def where(keep, seed):
    return 0.0 if "wall" in keep and seed % 10 < 6 else 0.3


def slipped(path, jobs=1):
    pool = FakePool(two, jobs)
    pool.shifted = where
    return drive(path, pool)


@pytest.mark.parametrize("jobs", [1, 3])
def test_two_failures_within_epsilon_are_named_and_none_takes_the_place_of_the_other_unnoticed(
    tmp_path, jobs
):
    state = slipped(new_run(tmp_path, accept_rate="kept", baseline_runs=10, keep_rate=0.8), jobs)
    assert dict(state.notes)["two failures"] == (
        "the ends of f form two groups 0.3 m apart (6, 4 runs): these may be different failures; "
        "--epsilon 0.15 tells them apart"
    )
    assert state.environment == ("beam",)
    certificate = state.certificate
    runs = certificate.claims[0].shown
    # However many work.
    assert (
        certificate.elsewhere.whole,
        certificate.elsewhere.left,
        certificate.elsewhere.of_left,
    ) == (6, 0, runs)
    assert not is_minimal(certificate)
    assert not state.minimal
    assert verdict_on(certificate).startswith(
        "what is left may show another failure within epsilon: of the runs of the whole world "
        f"with f 6 of 10 ended in one place, of what is left 0 of {runs} did, and others ended "
        "0.3 m away; --epsilon 0.15 tells them apart; "
    )


def scattered(_, seed):
    return 0.02 * (seed * 37 % 127)


def test_ends_that_scatter_are_told_with_the_epsilon_that_joins_them_and_the_run_goes_on(tmp_path):
    path = new_run(tmp_path, accept_rate="kept", baseline_runs=10)
    pool = FakePool(lambda keep, _: "similar" if "wall" in keep else "pass", 1)
    pool.shifted = scattered
    state = drive(path, pool)
    assert "--epsilon 1.4 makes them one failure" in dict(state.notes)["scatter"]
    assert "rare" not in dict(state.notes)
    # Nobody is there to choose.
    assert state.status == "finished"


def test_somebody_who_looks_on_can_choose_before_the_search_begins(tmp_path, monkeypatch):
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)

    def guide():
        state = yield from until(lambda state: state.paused)
        paused.append(state)
        yield "change", {"settings": {"epsilon": 1.4}}
        yield "resume", {}

    paused = []
    path = new_run(tmp_path, accept_rate="kept", baseline_runs=10)
    pool = Guided(path, lambda keep, _: "similar" if "wall" in keep else "pass", guide())
    pool.shifted = scattered
    state = drive(path, pool, attended=True)
    assert {test.phase for test in paused[0].tests} == {"baseline"}
    assert any(
        words.endswith("makes them one failure. Press c to change it.")
        for words in _offered(paused[0])
    )
    assert (state.baseline.failures, state.environment) == (10, ("wall",))


def warm(pool, shows=lambda made: made <= 10):
    """An oracle of which the calls decide: it shows f in its first ones alone."""
    return lambda keep, _: "similar" if shows(len(pool.made)) else "pass"


def simulated_elsewhere(path, pool):
    """To its end, where the simulator is not ddenv's own."""
    with engine(path, pool) as one:
        there = one.scenario.model_copy(update={"oracle": Oracle(command="true")})
        Driver(there, *one[1:]).reduce()
        return one.journal.state


def test_a_failure_that_stops_to_show_ends_the_search_after_a_round_in_vain(tmp_path):
    path, pool = new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(lambda *_: "", 1)
    pool.oracle = warm(pool)
    with pytest.raises(
        UserError,
        match=(
            r"f does not repeat: it showed only in the first 10 runs, and in none of 3 replays; "
            r"does"
        ),
    ):
        simulated_elsewhere(path, pool)
    assert len(pool.made) <= 30
    # A failure that repeats is replayed once a round.
    path, pool = (
        new_run(tmp_path, accept_rate="kept", baseline_runs=10),
        FakePool(needs("wall", "ball", "deck"), 1),
    )
    state = simulated_elsewhere(path, pool)
    assert state.environment == ("deck", "wall", "ball")
    assert len(pool.made) - len(state.tests) <= state.rounds_done


def test_a_certificate_ends_once_f_does_not_show_any_more(tmp_path):
    path, pool = new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(lambda *_: "", 1)
    pool.oracle = warm(pool)
    state = drive(path, pool)
    assert state.reason.startswith("f does not repeat; not shown that what is left keeps ")
    assert [(claim.without, claim.shown, claim.runs) for claim in state.certificate.claims] == [
        (None, 0, 30)
    ]


def widened(tmp_path, before, epsilon, jobs=1, algorithm="ddenv"):
    """A run whose epsilon the user changes at the end of round 2, and the runs that were made."""

    def guide():
        yield from until(lambda state: state.round is not None and state.round.number == 2)
        yield "change", {"settings": {"epsilon": epsilon}}

    path = new_run(
        tmp_path, accept_rate="kept", baseline_runs=10, keep_rate=0.8, algorithm=algorithm
    )
    with RunFile(path) as file:
        assert read_subject(file).scenario.failure.epsilon == before
    pool = Guided(path, two, guide(), jobs)
    pool.shifted = where
    return path, drive(path, pool), pool.made


@pytest.mark.parametrize("jobs", [1, 2])
def test_with_another_epsilon_stored_ends_are_judged_again_and_no_test_is_repeated(
    tmp_path, monkeypatch, jobs
):
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)
    path, state, made = widened(tmp_path, 0.4, 0.15, jobs)
    # Now only the failure of the wall is f, and the beam's is another one.
    assert (state.baseline.failures, state.baseline.runs, len(state.baseline.seen)) == (6, 10, 2)
    assert state.environment == ("wall",)
    assert state.certificate.elsewhere is None
    assert {test.outcome for test in state.tests if abs(test.end_pose[0] - 2.3) < 0.01} == {"other"}
    assert len(made) == len(set(made))
    assert [decision.words for decision in state.decisions] == ["changed epsilon from 0.4 to 0.15"]
    # All that is read from the file has it.
    with RunFile(path) as file:
        assert read_subject(file).scenario.failure.epsilon == 0.15
    assert state_of(path).failures == state.failures


@pytest.mark.parametrize("jobs", [1, 2])
def test_with_another_failure_stored_ends_are_judged_again_and_no_test_is_repeated(
    tmp_path, monkeypatch, jobs
):
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)
    refused = []

    def guide():
        yield from until(lambda state: state.round is not None and state.round.number == 2)
        yield "change", {"settings": {"failure": 2}}
        yield from until(lambda state: state.refusal[0] == 1)
        refused.append(state_of(path).refusal[1])
        yield "change", {"settings": {"failure": 3, "epsilon": 0.15}}
        yield from until(lambda state: state.refusal[0] == 2)
        refused.append(state_of(path).refusal[1])
        yield "change", {"settings": {"failure": 2, "epsilon": 0.15}}

    path = new_run(tmp_path, accept_rate="kept", baseline_runs=10)
    pool = Guided(path, two, guide(), jobs)
    pool.shifted = where
    state = drive(path, pool)
    assert refused[0] == "failure: the whole world showed 1 failure; choose one of these"
    assert refused[1].startswith(
        "there is no failure number 3; 10 runs of the whole world showed these: 1. "
    )
    # The wall's failure was the first one, and now that of the beam is f.
    assert (state.baseline.failures, state.baseline.runs) == (4, 10)
    assert state.environment == ("beam",)
    assert {test.outcome for test in state.tests if abs(test.end_pose[0] - 2.0) < 0.01} == {"other"}
    assert len(pool.made) == len(set(pool.made))
    assert [decision.words for decision in state.decisions] == [
        "changed failure from 1 to 2, epsilon from 0.4 to 0.15"
    ]


def test_an_epsilon_that_is_changed_before_f_is_known_counts_in_the_baseline(tmp_path, monkeypatch):
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)

    def guide():
        yield from until(lambda state: len(state.tests) == 3)
        yield "change", {"settings": {"epsilon": 0.15}}

    path = new_run(tmp_path, accept_rate="kept", baseline_runs=10)
    pool = Guided(path, two, guide())
    pool.shifted = where
    assert drive(path, pool).baseline.failures == 6


def test_a_very_rare_failure_asks_who_looks_on_how_to_go_on_and_can_be_reduced_exactly(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)

    def guide():
        state = yield from until(lambda state: state.paused)
        assert dict(state.notes)["rare"].startswith("f shows in 3 of 70 runs: ")
        yield "change", {"settings": {"accept_rate": "exact"}}
        yield "resume", {}

    def rare(keep, seed):
        return "similar" if "wall" in keep and seed in (20, 30, 40) else "pass"

    path = new_run(tmp_path, accept_rate="kept", baseline_runs=70)
    state = drive(path, Guided(path, rare, guide()), attended=True)
    assert state.environment == ("wall",)
    assert state.certificate.seeds == (20, 30, 40)
    assert sum(test.phase == "baseline" for test in state.tests) == 70


def test_an_epsilon_wider_than_the_way_is_told(tmp_path):
    path = new_run(tmp_path)
    with RunFile(path) as file:
        subject = read_subject(file)
    wide = subject.scenario.model_copy(
        update={"failure": subject.scenario.failure.model_copy(update={"epsilon": 1000.0})}
    )
    with engine(path, FakePool(two, 1)) as one:
        note_start(wide, subject.world, subject.robot, one.journal)
        assert dict(one.journal.state.notes)["epsilon"].startswith(
            "epsilon (1000 m) is wider than the way to the goal ("
        )


def test_a_robot_that_fails_without_any_model_is_told(tmp_path):
    state = drive(
        new_run(tmp_path, accept_rate="kept", growth="steady"), FakePool(lambda *_: "similar", 1)
    )
    assert not state.environment
    assert state.reason.startswith(
        "fails without any model: look at the ground, the robot, its controller, or something "
        "that is "
    )
