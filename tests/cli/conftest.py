"""What tests of commands share."""

import pytest

from ddenv.runfile.state import RunState


@pytest.fixture
def started(monkeypatch):
    """The engines that were asked for, each with its run, options and job; none starts."""
    asked = []
    monkeypatch.setattr("ddenv.runs.programs.start_engine", lambda *words: asked.append(words))
    monkeypatch.setattr("ddenv.cli.follow.follow", lambda *_: None)
    monkeypatch.setattr("ddenv.cli.follow.follow_to_summary", lambda *_: (0, RunState()))
    return asked
