"""Slices: what took part in a run is recorded, and a test that it implies is not made."""

import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from tests.conftest import DATA
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.test_driver import needs


def state_of(path):
    with RunFile(path) as file:
        return fold(file.events())


def test_who_took_part_is_recorded_with_each_test(tmp_path):
    path, pool = new_run(tmp_path, budget=3), FakePool(needs("wall"), 1)
    pool.took_part = lambda keep, seed: keep & {"wall", "ball"} | {"ground_plane"} if seed else None
    with pytest.raises(Exception, match="budget"):
        drive(path, pool)
    took_part = [test.took_part for test in state_of(path).tests]
    assert took_part == [None, frozenset({"wall", "ball"}), frozenset({"wall", "ball"})]


def test_an_old_run_file_has_no_slices():
    state = state_of(DATA / "format4.ddenv")
    assert state.ties is None
    assert state.tests and all(test.took_part is None for test in state.tests)
