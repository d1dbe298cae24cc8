"""`ddenv reproduce`, for `git bisect run`: what is no answer is never taken for one."""

import pytest

from ddenv.cli.terminal import CANNOT_SAY
from ddenv.engine import single_test
from tests.command import in_process


@pytest.mark.parametrize(
    "words", [["no-such-run"], [], ["--most", "none"], ["--no-such-option"], ["run", "--folder", "/nowhere"]]
)
def test_whatever_is_wrong_it_says_that_it_cannot_say(monkeypatch, capsys, home, words):
    said = in_process(monkeypatch, capsys, "reproduce", *words)
    assert said.returncode == CANNOT_SAY
    assert said.stderr
    assert "Traceback" not in said.stderr


@pytest.mark.parametrize("error", [RuntimeError("no simulator"), PermissionError(13, "denied", "file")])
def test_a_crash_is_no_failure_of_the_robot(monkeypatch, capsys, home, error):
    def crash(*_):
        raise error

    monkeypatch.setattr(single_test, "subject_in", crash)
    assert in_process(monkeypatch, capsys, "reproduce", "run").returncode == CANNOT_SAY
