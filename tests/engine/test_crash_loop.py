"""Engines that die again and again at one place are noticed, and told in one line."""

import pytest

from ddenv.engine.beginning import MOST_DEATHS, check_crash_loop
from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import needs


def dies(path, after):
    with pytest.raises(Killed):
        drive(path, FakePool(needs("wall"), 2), prepare=lambda file: kill_after(file, after))


def check(path):
    with RunFile(path) as file:
        check_crash_loop(Journal(file))


def test_engines_that_die_before_a_test_ends_are_told_with_the_way_on(tmp_path):
    path = new_run(tmp_path)
    # One more event each time, two tests begin: nothing of it is a step forward.
    for after in range(1, MOST_DEATHS):
        dies(path, after)
    check(path)
    dies(path, 1)
    with pytest.raises(UserError, match=rf"the last {MOST_DEATHS} engines died after event 1, .* --anyway") as told:
        check(path)
    assert "\n" not in str(told.value)
    # Nothing was written: it stays so.
    with pytest.raises(UserError):
        check(path)


def test_engines_that_get_on_may_die_as_often_as_they_like(tmp_path):
    path = new_run(tmp_path)
    for _ in range(2 * MOST_DEATHS):
        dies(path, 5)
        check(path)
