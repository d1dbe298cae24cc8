"""After several runs, `ddenv test` says how often f shows in each environment, for people and for
programs.
"""

import json

import pytest

from ddenv.cli.test import elsewhere, lines, summary
from ddenv.runfile.progress import Claim
from tests.conftest import DATA


def runs(without, *outcomes):
    models = 3 - bool(without)
    return [
        {"without": without, "models": models, "outcome": outcome, "seed": seed}
        for seed, outcome in enumerate(outcomes)
    ]


def test_each_environment_has_its_runs_its_rate_and_its_interval():
    found = summary(
        [
            *runs(None, *["similar"] * 4),
            *runs("ball", "pass", "other", "error"),
            *runs("wall", "timeout"),
        ]
    )
    assert [(row["without"], row["runs"], row["shown"], row["rate"]) for row in found] == [
        (None, 4, 4, 1.0),
        ("ball", 2, 0, 0.0),
        ("wall", 0, 0, None),
    ]
    assert found[0]["low"] == pytest.approx(0.51, abs=0.01) and found[2]["low"] is None
    assert lines(found) == [
        "all 3 models: f in 4 of 4 runs (51 % to 100 %)",
        "without ball: f in 0 of 2 runs (0 % to 66 %); 1 more run broke",
        "without wall: no run ended; 1 more run broke",
    ]


def test_where_no_f_is_known_all_failures_count():
    assert lines(summary(runs(None, "failed", "pass", "pass"))) == [
        "all 3 models: 1 of 3 runs failed (6 % to 79 %)"
    ]


def test_runs_in_another_simulator_are_compared_with_the_certificate():
    here = Claim(without=None, verdict="kept", shown=29, runs=29, low=0.88, high=1.0)
    many = [
        *runs(None, *["similar"] * 18, "other", "pass"),
        *runs("ball", *["pass"] * 8, "error"),
        *runs("wall", "pass"),
        *runs("lamp", *["similar"] * 18, "other", "pass"),
    ]
    found = elsewhere(many, here, "MuJoCo")
    assert [each["fails"] for each in found] == [True, False, None, True]
    assert lines(summary(many), {each["without"]: each["said"] for each in found}) == [
        (
            "fails in MuJoCo, too: f in 18 of 20 runs (70 % to 97 %); by its certificate f in 29 "
            "of 29 fresh runs (88 % to 100 %)"
        ),
        "ball: needed in MuJoCo, too: without it f in 0 of 8 runs (0 % to 32 %); 1 more run broke",
        "wall: not shown for MuJoCo: without it f in 0 of 1 run (0 % to 79 %)",
        "lamp: seems not needed in MuJoCo: without it f in 18 of 20 runs (70 % to 97 %)",
    ]
    assert elsewhere(runs(None, "error"), here, "MuJoCo") == []


@pytest.mark.parametrize("shown", [0, 3])
def test_nothing_is_needed_elsewhere_where_f_hardly_shows_there(shown):
    """Runs that miss f without a model say nothing about it, where they miss f with it as well."""
    there = [*["similar"] * shown, *["pass"] * (20 - shown)]
    here = Claim(without=None, verdict="kept", shown=29, runs=29, low=0.88, high=1.0)
    what_is_left, ball = elsewhere([*runs(None, *there), *runs("ball", *there)], here, "MuJoCo")
    assert what_is_left["fails"] is False
    assert ball["fails"] is None and ball["said"].startswith("ball: not shown for MuJoCo")


def test_where_every_run_breaks_the_command_says_so_by_its_exit_code(monkeypatch, command):
    more = {"seed": 1, "end_pose": None, "failure": "it broke", "distance": None}
    for results, code in ((runs(None, "error", "timeout"), 1), (runs(None, "error", "pass"), 0)):
        made = [one | more for one in results]
        monkeypatch.setattr("ddenv.engine.single_test.run_trials", lambda *_, made=made: iter(made))
        assert command("test", DATA / "wall.yaml", "--repeat", 2).returncode == code


def test_the_command_ends_with_it(monkeypatch, command):
    results = [*runs(None, "failed", "failed"), *runs("w\x1b", "pass", "pass")]
    more = {"seed": 1, "end_pose": None, "failure": "", "distance": None}
    monkeypatch.setattr(
        "ddenv.engine.single_test.run_trials", lambda *_: iter([one | more for one in results])
    )
    said = command("test", DATA / "wall.yaml", "--repeat", 2).stdout
    assert said.splitlines()[-3:] == [
        "",
        "all 3 models: 2 of 2 runs failed (34 % to 100 %)",
        "without w�: 0 of 2 runs failed (0 % to 66 %)",
    ]
    told = json.loads(command("test", DATA / "wall.yaml", "--repeat", 2, "--json").stdout)
    assert [row["shown"] for row in told["summary"]] == [2, 0] and len(told["runs"]) == 4
