"""Which seed a run has: unlike those of its neighbours, the same for all candidates, and in old
files as it was there.
"""

import pytest

from ddenv.engine.control import Stopped
from ddenv.engine.single_test import plan
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import open_experiment, read_subject
from ddenv.world.scenario import Reduction, seed_of
from tests.conftest import DATA
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.oracles import needs
from tests.engine.reading import state_of

RULES = pytest.mark.parametrize("seeds", ["hashed", "consecutive"])


def half(keep, seed):
    """f in half of all runs, by the first number of the simplest generator: it hardly differs for
    seeds in a row.
    """
    return "similar" if (16_807 * seed + 1) % (2**31 - 1) < 2**30 else "pass"


def test_a_simulator_with_poor_random_numbers_shows_its_rate(tmp_path):
    path = new_run(tmp_path, seeds=Reduction().seeds, baseline_runs=200, budget=200)
    with pytest.raises(Stopped):
        drive(path, FakePool(half, 2))
    assert state_of(path).baseline.rate == pytest.approx(0.5, abs=0.1)


def test_another_base_has_other_seeds():
    of_zero, of_one = (
        {seed_of(Reduction(seed=base), run) for run in range(12_000)} for base in (0, 1)
    )
    assert min(len(of_zero), len(of_one)) >= 11_998
    assert len(of_zero & of_one) <= 2
    assert max(of_zero | of_one) < 2**31


@RULES
def test_each_run_has_its_own_seed_which_all_environments_share(tmp_path, seeds):
    state = drive(new_run(tmp_path, seed=40, seeds=seeds), FakePool(needs("wall"), 2))
    by_run = {test.run: test.seed for test in state.tests}
    assert {(test.run, test.seed) for test in state.tests} == set(by_run.items())
    assert len(set(by_run.values())) == len(by_run)
    assert (seeds == "consecutive") == ({seed - run for run, seed in by_run.items()} == {40})


@RULES
def test_single_runs_of_a_scenario_are_those_of_its_baseline(tmp_path, seeds):
    state = drive(path := new_run(tmp_path, seed=7, seeds=seeds), FakePool(needs("wall"), 1))
    baseline = [test.seed for test in state.tests if test.phase == "baseline"]
    with RunFile(path) as file:
        subject = read_subject(file)
    assert [trial.seed for trial in plan(subject, repeat=len(baseline))] == baseline


def test_seeds_that_the_user_types_count_up():
    given = dict.fromkeys(("spawn", "goal", "world", "timeout")) | dict.fromkeys(
        ("model_path", "stand_in", "ignore"), ()
    )
    subject = open_experiment(str(DATA / "wall.yaml"), given)
    assert [trial.seed for trial in plan(subject, seed=5, repeat=3)] == [5, 6, 7]
