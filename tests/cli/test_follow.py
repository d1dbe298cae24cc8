"""Following a run without a screen."""

import io
import sys
from types import SimpleNamespace

import pytest

from ddenv.cli.follow import follow
from tests.workbench import fake_moments


class Unread(io.StringIO):
    """An output that nobody reads any more, as after `| head`."""

    def write(self, _):
        raise BrokenPipeError


def test_where_nobody_reads_any_more_it_says_that_the_engine_goes_on_and_how_to_stop_it(run, monkeypatch, capsys):
    fake_moments.mid_round(run).hold()
    monkeypatch.setattr(sys, "stdout", Unread())
    engine = SimpleNamespace(pid=77, poll=lambda: run.write("paused"))
    with pytest.raises(BrokenPipeError):
        follow(run.path, engine, as_json=False)
    assert f"the engine keeps working on {run.path}" in (said := capsys.readouterr().err)
    assert "'kill 77' stops it" in said
