"""`ddenv certify`, and the result of a run as lines and as JSON."""

from dataclasses import replace

import pytest

from ddenv.cli.summary import summary, summary_lines
from ddenv.runs.engine_job import Certify, EngineOptions
from ddenv.runs.folder import runs_folder
from tests.command import is_one_line
from tests.workbench import fake_moments, fake_run


def told(run) -> tuple[dict, str]:
    return summary(run.state, run.path), "\n".join(summary_lines(run.state, run.path))


def test_a_result_is_told_with_its_runs_and_what_they_mean(run):
    found, lines = told(fake_moments.finished(run))
    assert (found["minimal"], found["kept"]) == (True, ["crate_00", "crate_01"])
    assert (found["rate_left"]["shown"], found["rate_left"]["runs"]) == (24, 24)
    assert (found["rate_whole_world"]["shown"], found["rate_whole_world"]["runs"]) == (3, 4)
    left, first, second = found["certificate"]["claims"]
    assert (left["without"], left["verdict"], left["outcomes"]) == (None, "kept", {"similar": 23})
    assert left["means"] == "keeps at least 81 % of the whole world's rate"
    assert (first["without"], first["rate"], second["shown"], second["runs"]) == (
        "crate_00",
        0.0,
        1,
        12,
    )
    assert (left["keeps_at_least"], second["without_at_most"]) == pytest.approx(
        (0.81, 0.61), abs=0.01
    )
    assert found["certificate"]["whole_world"]["outcomes"] == {"similar": 22, "pass": 1}
    assert "minimal environment: 2 of 11 models" in lines
    assert (
        "what is left: f in 23 of 23 fresh runs (80 % to 100 %): keeps at least 81 % of the "
        "whole world's rate"
    ) in lines
    assert (
        "without crate_01: f in 1 of 12 fresh runs (<1 % to 48 %): needed: without it f shows at "
        "most 62 % as often"
    ) in lines


def test_a_result_with_a_certificate_says_what_can_be_done_with_it(run, home):
    state = fake_moments.finished(run).state
    elsewhere = summary_lines(state, run.path)[-1]
    assert elsewhere.startswith(f"next: 'ddenv open {run.path}' shows it")
    assert summary_lines(state, runs_folder() / "crates-1.ddenv")[-1] == (
        "next: 'ddenv open crates-1' shows it, 'ddenv why crates-1' says why it fails, 'ddenv "
        "isolate crates-1' finds a nearest world that passes, 'ddenv export crates-1 --bundle "
        "crates-1.zip' packs it for others"
    )
    assert not any(
        line.startswith("next:")
        for line in summary_lines(replace(state, status="stopped"), run.path)
    )


def test_a_nearest_world_that_passes_is_offered_until_it_is_known(run):
    assert "next: " in told(fake_moments.isolated(run))[1]
    assert "ddenv isolate" not in told(run)[1]


def test_what_only_helps_can_be_left_out_by_a_key(run):
    assert (
        "shows it, and H in it leaves crate_01 out, 'ddenv why" in told(fake_moments.helped(run))[1]
    )


def test_what_is_not_shown_is_not_called_minimal(run):
    found, lines = told(fake_moments.not_shown(run))
    assert (found["minimal"], found["certificate"]["minimal"]) == (False, False)
    assert "environment, not shown to be minimal: 2 of 11 models" in lines
    assert (
        "without crate_01: f in 1 of 2 fresh runs (1 % to 99 %): unknown: too many runs broke"
        in lines
    )
    assert " tests broke; the last one: " in lines


def test_files_without_a_certificate_claim_nothing(run):
    found, lines = told(fake_moments.uncertified(run))
    assert (found["minimal"], found["certificate"]) == (False, None)
    assert "f in 1 of 1 here, 3 of 4 in the whole world; no fresh runs were made" in lines


def test_an_engine_makes_at_least_so_many_runs(run, started, command):
    fake_moments.finished(run)
    command("certify", run.path, "--runs", 40, "--jobs", 1)
    command("certify", run.path, "--jobs", 1)
    command("certify", run.path, "--certify-rate", 0.8, "--jobs", 1)
    # As often as the baseline, if not said otherwise.
    alone = EngineOptions(jobs=1)
    assert started == [
        (run.path, alone, Certify(at_least=40)),
        (run.path, alone, Certify(at_least=4)),
        (run.path, alone, Certify(at_least=4, certify_rate=0.8)),
    ]


def test_what_cannot_be_certified_is_refused_in_one_line(run, command):
    run.created()
    is_one_line(command("certify", run.path), f"ddenv: {run.path}: f is not known yet")
    fake_run.FakeRun.baseline(run)
    with run.engine():
        is_one_line(command("certify", run.path), "another engine is working on this run")


def test_the_time_of_a_run_counts_up_to_its_last_event_if_its_engine_said_no_end(run):
    state = fake_moments.finished(run).state
    killed = replace(state, working_seconds=2.0, started_at=100.0, updated_at=105.4)
    assert summary(killed, run.path)["wall_seconds"] == 7.4
    assert any(line.endswith("s, 7 s") for line in summary_lines(killed, run.path))
