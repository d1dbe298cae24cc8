"""Which failure it is: two within epsilon, ends that scatter, one that does not repeat, and another epsilon midway."""

import pytest

from ddenv.engine.control import Stopped
from ddenv.engine.driver import Driver
from ddenv.errors import UserError
from ddenv.evidence.claims import is_minimal
from ddenv.words.claims import verdict_on
from ddenv.world.scenario import Oracle
from tests.engine.fake import FakePool, drive, engine, new_run
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
def test_two_failures_within_epsilon_are_named_and_none_takes_the_place_of_the_other_unnoticed(tmp_path, jobs):
    state = slipped(new_run(tmp_path, accept_rate="kept", baseline_runs=10, keep_rate=0.8), jobs)
    assert dict(state.notes)["two failures"] == (
        "the ends of f form two groups 0.3 m apart (6, 4 runs): these may be different failures; --epsilon 0.15 tells them apart"
    )
    assert state.environment == ("beam",)
    certificate = state.certificate
    runs = certificate.claims[0].shown
    # However many work.
    assert (certificate.elsewhere.whole, certificate.elsewhere.left, certificate.elsewhere.of_left) == (6, 0, runs)
    assert not is_minimal(certificate)
    assert not state.minimal
    assert verdict_on(certificate).startswith(
        f"another failure within epsilon took the place of f: 6 of 10 runs of the whole world with f ended together, 0 of {runs} "
        "fresh runs of what is left did there, and others 0.3 m away; --epsilon 0.15 tells them apart; "
    )


def test_ends_that_scatter_stop_the_run_with_the_epsilon_that_joins_them(tmp_path):
    path = new_run(tmp_path, accept_rate="kept", baseline_runs=10)
    pool = FakePool(lambda keep, _: "similar" if "wall" in keep else "pass", 1)
    pool.shifted = lambda _, seed: 0.02 * (seed * 37 % 127)
    with pytest.raises(Stopped, match="choose a wider epsilon"):
        drive(path, pool)
    state = state_of(path)
    assert "--epsilon 1.4 makes them one failure" in dict(state.notes)["scatter"]
    assert "rare" not in dict(state.notes)
    assert {test.phase for test in state.tests} == {"baseline"}
    # Who resumes it wants this one.
    assert drive(path, pool).status == "finished"


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
        UserError, match=r"f does not repeat: it showed only in the first 10 runs, and in none of 3 replays; does"
    ):
        simulated_elsewhere(path, pool)
    assert len(pool.made) <= 30
    # A failure that repeats is replayed once a round.
    path, pool = new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(needs("wall", "ball", "deck"), 1)
    state = simulated_elsewhere(path, pool)
    assert state.environment == ("deck", "wall", "ball")
    assert len(pool.made) - len(state.tests) <= state.rounds_done


def test_a_certificate_ends_once_f_does_not_show_any_more(tmp_path):
    path, pool = new_run(tmp_path, accept_rate="kept", baseline_runs=10), FakePool(lambda *_: "", 1)
    pool.oracle = warm(pool)
    state = drive(path, pool)
    assert state.reason.startswith(
        "f does not repeat: it showed only in the first 10 runs; not shown that what is left keeps "
    )
    assert [(claim.without, claim.shown, claim.runs) for claim in state.certificate.claims] == [(None, 0, 30)]
