"""`ddenv isolate`, and what `ddenv why` says of its result."""

import json

import pytest

from ddenv.cli.follow import Interrupted
from ddenv.runs.engine_job import EngineOptions, GiveUpIsolation, Isolate
from tests.command import is_one_line
from tests.workbench import fake_moments, fake_run

ALONE = EngineOptions(jobs=1)


def test_what_is_known_is_said_without_a_test(run, started, command):
    fake_moments.isolated(run)
    done = command("isolate", run.path)
    assert (done.returncode, started) == (0, [])
    assert done.stdout.startswith("A nearest world that passes lacks 1 model of 11 (crate_00)")
    found = json.loads(command("isolate", run.path, "--json").stdout)["nearest"]
    assert (found["gone"], found["shown"]) == (["crate_00"], True)
    command("isolate", run.path, "--again", "--jobs", 1)
    command("isolate", run.path, "--runs", 50, "--jobs", 1)
    assert started == [
        (run.path, ALONE, Isolate()),
        (run.path, ALONE, Isolate(at_least=50)),
    ]


def test_one_that_was_stopped_goes_on(run, started, command):
    fake_moments.isolating(run).write("engine_stopped", reason="stopped by the user")
    done = command("isolate", run.path, "--jobs", 1)
    assert started == [(run.path, ALONE, Isolate())]
    # No engine works here.
    stopped = (
        f"the search for a world that passes was stopped; continue with: ddenv isolate {run.path}"
    )
    assert (done.returncode, done.stderr) == (2, f"ddenv: {run.path}: {stopped}\n")


def test_who_is_interrupted_reads_how_to_go_on(run, started, monkeypatch, command):
    fake_moments.isolating(run)
    state = run.state

    def interrupted(*_):
        raise Interrupted(state)

    monkeypatch.setattr("ddenv.cli.follow.follow", interrupted)
    done = command("isolate", run.path, "--jobs", 1)
    assert (done.returncode, started) == (130, [(run.path, ALONE, Isolate())])
    assert f"continue with: ddenv isolate {run.path}" in done.stderr


def test_one_that_was_interrupted_can_be_given_up(run, started, command):
    fake_moments.isolating(run).write("engine_stopped", reason="stopped by the user")
    done = command("isolate", run.path, "--give-up")
    assert (done.returncode, started) == (0, [(run.path, ALONE, GiveUpIsolation())])
    run.write("isolation_given_up")
    assert (run.state.status, run.state.certified) == ("finished", True)
    again = command("isolate", run.path, "--give-up")
    is_one_line(again, "nothing to give up")
    assert len(started) == 1


def test_a_run_that_has_not_ended_is_refused_in_one_line(run, started, command):
    run.created()
    is_one_line(command("isolate", run.path), "no failure is known yet")
    fake_run.FakeRun.baseline(run)
    is_one_line(command("isolate", run.path), "its search is not over")
    assert started == []


def test_why_says_it_after_the_reasons(run, command):
    fake_moments.isolated(run)
    lines = command("why", run.path).stdout.splitlines()
    assert [line[:12] for line in lines] == ["- Without cr", "- Without cr", "A nearest wo"]
    found = json.loads(command("why", run.path, "--json").stdout)
    assert len(found["reasons"]) == 2
    assert found["nearest"]["gone"] == ["crate_00"]


def test_the_world_that_passes_is_drawn_and_written(run, tmp_path, command):
    fake_moments.isolated(run)
    shown = command("world", "show", run.path, "--passes").stdout
    assert shown.endswith("the nearest world that passes lacks 1 model of 11:\n  crate_00\n")
    file = tmp_path / "passes.sdf"
    command("export", run.path, "--sdf", file, "--passes")
    text = file.read_text()
    assert [name for name in run.elements if f'"{name}"' not in text] == ["crate_00"]


@pytest.mark.parametrize(
    "words", [("world", "show", "RUN", "--passes"), ("export", "RUN", "--sdf", "OUT", "--passes")]
)
def test_where_no_such_world_is_known_one_line_says_how_to_find_it(run, tmp_path, words, command):
    fake_moments.finished(run)
    there = {"RUN": run.path, "OUT": tmp_path / "passes.sdf"}
    done = command(*(there.get(word, word) for word in words))
    is_one_line(done, f"ddenv isolate {run.path}")
    assert not there["OUT"].exists()
