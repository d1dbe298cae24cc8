"""The time limit of a test follows the speed of the baseline, and a slow world is noted during its first run."""

from contextlib import suppress
from dataclasses import replace

import pytest

from ddenv.engine.limits import FACTOR, GENEROUS, KNOWN_AFTER, LEAST, MOST_LATE
from ddenv.engine.worker import Broken
from ddenv.errors import UserError
from ddenv.report.report import content
from ddenv.report.run_data import read_run
from ddenv.runfile.fold import fold
from ddenv.runfile.store import Live, RunFile
from ddenv.runs.creation import create_run
from ddenv.settings import SETTINGS
from ddenv.words.news import news
from ddenv.world.load import load_scenario
from tests.conftest import DATA
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.killing import Killed, kill_after, story
from tests.engine.oracles import needs

# Of the small world's scenario.
BASELINE, TIMEOUT = 3, 5.0


class Timed(FakePool):
    """A pool whose tests take `real` s for each simulated one."""

    def __init__(self, real: float) -> None:
        super().__init__(needs("wall"), 1)
        self.real = real

    def finished(self, seconds):
        ended = super().finished(seconds)
        return [(test, replace(each, wall_seconds=self.real * each.simulated_seconds)) for test, each in ended]


def events(path):
    with RunFile(path) as file:
        return list(file.events())


@pytest.mark.parametrize(("real", "later"), [(0.1, LEAST), (30.0, FACTOR * 30 * TIMEOUT)])
def test_the_baseline_has_a_long_time_and_later_tests_a_multiple_of_what_it_took(tmp_path, real, later):
    assert f"{GENEROUS:g} in the baseline" in SETTINGS["wall_timeout"].meaning
    path = new_run(tmp_path)
    with suppress(Killed):
        drive(path, first := Timed(real), prepare=lambda file: kill_after(file, 20))
    assert first.limits[:BASELINE] == [GENEROUS] * BASELINE
    # The machine is another one now: the limit stays.
    drive(path, again := Timed(real / 7))
    assert again.made
    assert {*first.limits[BASELINE:], *again.limits} == {later}


def test_how_long_tests_take_changes_no_verdict(tmp_path):
    assert story(drive(new_run(tmp_path), Timed(0.01))) == story(drive(new_run(tmp_path), Timed(1000.0)))


def test_a_number_of_the_users_holds_for_all_tests(tmp_path):
    scenario = load_scenario(DATA / "wall.yaml")
    asked = scenario.simulation.model_copy(update={"wall_timeout": 33.0})
    create_run(scenario.model_copy(update={"simulation": asked}), path := tmp_path / "run.ddenv")
    drive(path, pool := Timed(30.0))
    assert set(pool.limits) == {33.0}


def pace(simulated, real, slot=0):
    return Live(slot, 1, simulated, (0.0,) * 7), real


def test_a_slow_world_is_told_once_while_its_first_run_goes_on(tmp_path):
    path, pool = new_run(tmp_path), FakePool(needs("wall"), 2)
    pool.pace = [pace(50.0, 12.0), pace(3.0, 12.0, 1)]
    drive(path, pool)
    written = events(path)
    kinds = [event.kind for event in written]
    assert kinds.count("noted") == 1
    assert kinds.index("noted") < kinds.index("baseline_finished")
    before, after = (fold(written[: kinds.index("noted") + more]) for more in (0, 1))
    said = news("noted", before, after)
    assert said.startswith(
        "this world is slow: 0.25 s simulated in each second; at this rate a test of 5 s takes 20 s, "
    )
    assert "the baseline of 3 runs about 40 s" in said
    assert "what helps: fewer models that can move" in said
    # The report keeps it.
    assert said[1:] in str(content(read_run(path)).lead)


@pytest.mark.parametrize(("simulated", "real"), [(11.0, 10.0), (0.5, KNOWN_AFTER - 0.1)])
def test_a_fast_world_is_not_called_slow_and_one_that_has_just_begun_neither(tmp_path, simulated, real):
    path, pool = new_run(tmp_path), FakePool(needs("wall"), 2)
    pool.pace = [pace(simulated, real)]
    assert drive(path, pool).notes == ()


def test_a_world_whose_runs_all_take_too_long_is_given_up_soon(tmp_path):
    class Late(FakePool):
        def finished(self, seconds):
            return [
                (test, Broken("timeout", "took longer than 1800 s of wall clock"))
                for test, _ in super().finished(seconds)
            ]

    path, pool = new_run(tmp_path, baseline_runs=10), Late(needs("wall"), 1)
    with pytest.raises(
        UserError, match=r"3 runs of the whole world took longer than 1800 s .*, and none has ended; what helps"
    ):
        drive(path, pool)
    assert len(pool.made) == MOST_LATE
