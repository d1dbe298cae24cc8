"""A run that is resumed with other software or on another processor: its first test is made again
and compared.
"""

import sqlite3
from contextlib import suppress

import pytest

from ddenv.engine import shared
from ddenv.engine.control import Stopped
from ddenv.errors import UserError
from ddenv.report.report import write_report
from ddenv.runs import processor
from tests.command import ddenv
from tests.conftest import DATA
from tests.engine import fake
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import needs
from tests.engine.reading import send, state_of

FIRST = (frozenset(ELEMENTS), 0)


@pytest.fixture
def begun(tmp_path):
    """A run whose engine was killed in the rounds."""
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        drive(path, FakePool(needs("wall", "beam"), 1), prepare=lambda file: kill_after(file, 60))
    assert state_of(path).round is not None
    return path


def resumed(path, kill=True, **options):
    """What an engine makes that goes on with the run, until it is killed, and the state after
    it.
    """
    pool = FakePool(needs("wall", "beam"), 1)
    with suppress(Killed):
        drive(path, pool, prepare=lambda file: kill and kill_after(file, 20), **options)
    return pool.made, state_of(path)


def another_drake(monkeypatch):
    monkeypatch.setattr(
        processor, "versions", lambda *names: ", ".join(f"{name} 0.9" for name in names)
    )


def other_bits(monkeypatch):
    """From now on robots stop a hair further away: by far less than epsilon."""
    monkeypatch.setitem(fake.ENDS, "similar", ("failed", 2.0 + 1e-12))


CHANGES = {
    "Drake": another_drake,
    "Python": lambda patch: patch.setattr(shared.platform, "python_version", lambda: "3.99.0"),
    "processor": lambda patch: patch.setattr(processor, "name", lambda: "Abacus, 10 beads"),
}


def test_an_ordinary_resume_costs_nothing(begun):
    made, state = resumed(begun)
    assert made and FIRST not in made
    assert state.physics.now == state.physics.proven


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_with_the_same_bits_a_run_goes_on_and_is_compared_once(begun, monkeypatch, change):
    change(monkeypatch)
    made, state = resumed(begun)
    assert made[0] == FIRST and made.count(FIRST) == 1 and len(made) > 1
    assert state.physics.now == state.physics.proven and not state.physics.mixed
    made, state = resumed(begun, kill=False)
    assert made and FIRST not in made
    assert state.minimal


def test_with_other_bits_no_test_is_made_until_the_user_has_chosen(begun, monkeypatch):
    another_drake(monkeypatch)
    other_bits(monkeypatch)
    before = state_of(begun).tests
    # A second engine does not trust the first one, which was refused.
    for _ in range(2):
        with pytest.raises(
            UserError, match=r"gives a different trajectory: the tests were made with ddenv .*drake"
        ) as refused:
            resumed(begun)
        assert f"'ddenv resume {begun} --mixed'" in str(refused.value) and "\n" not in str(
            refused.value
        )
        assert ", drake 0.9, numpy 0.9, scipy 0.9, Python" in str(refused.value)
    assert [test.outcome for test in state_of(begun).tests if test.is_finished] == [
        test.outcome for test in before if test.is_finished
    ]


def test_mixed_it_goes_on_and_says_so(begun, monkeypatch, tmp_path):
    another_drake(monkeypatch)
    other_bits(monkeypatch)
    made, _ = resumed(begun, mixed=True)
    assert made[0] == FIRST and len(made) > 1
    made, state = resumed(begun, kill=False)
    assert FIRST not in made and state.status == "finished"
    (mixed,) = state.physics.mixed
    assert ", drake 0.9, numpy 0.9, scipy 0.9" in mixed.partition(", then ")[2]
    write_report(begun, report := tmp_path / "report.md")
    assert "Mixed tests." in report.read_text() and ", drake 0.9" in report.read_text()


def test_where_the_first_run_breaks_now_it_says_why(begun, monkeypatch):
    another_drake(monkeypatch)
    with pytest.raises(UserError, match=r"the first run of the whole world broke \(it broke\)"):
        drive(begun, FakePool(lambda keep, seed: "error", 1))


def test_a_run_without_tests_belongs_to_the_engine_that_makes_the_first(tmp_path, monkeypatch):
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        drive(path, FakePool(needs("wall"), 1), prepare=lambda file: kill_after(file, 1))
    another_drake(monkeypatch)
    made, state = resumed(path, kill=False)
    assert made.count(FIRST) == 1 and state.minimal


def test_a_stop_ends_the_comparison(begun, monkeypatch):
    another_drake(monkeypatch)
    pool = FakePool(needs("wall", "beam"), 1)

    def finished(seconds):
        send(begun, "stop")
        return []

    monkeypatch.setattr(pool, "finished", finished)
    with pytest.raises(Stopped):
        drive(begun, pool)


@pytest.mark.programs
def test_the_command_offers_to_go_on_or_to_make_all_tests_again(home):
    run = home / "runs" / "wall-1.ddenv"
    assert ddenv("run", DATA / "wall.yaml", "--budget", 6).returncode == 1
    with sqlite3.connect(run) as db:
        text = (
            'UPDATE event SET data = replace(data, \'"simulator":"drake \', \'"simulator":"drake '
            "0.')"
        )
        db.execute(f"{text} WHERE kind = 'engine_started'")
        db.execute(
            "UPDATE motion SET samples = (SELECT samples FROM motion WHERE test = 2 AND model = "
            "'') WHERE test = 1"
        )
    refused = ddenv("resume", run)
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1
    assert ", drake 0." in refused.stderr
    assert "give one of them" in ddenv("resume", run, "--mixed", "--again").stderr
    mixed = ddenv("resume", run, "--mixed")
    assert mixed.returncode == 1, mixed.stderr
    assert "different bits: from here on the tests are mixed" in mixed.stdout
    refused = ddenv("resume", run, "--timeout", 7)
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1
    assert (
        f"'ddenv resume {run} --again --timeout 7' makes all tests in a new run" in refused.stderr
    )
    again = ddenv("resume", run, "--again", "--timeout", 7)
    assert "wall-2.ddenv" in again.stderr and again.returncode == 1
    state = state_of(home / "runs" / "wall-2.ddenv")
    assert state.tests_done == 6 and not state.physics.mixed
    assert state.scenario["failure"]["timeout"] == 7.0
