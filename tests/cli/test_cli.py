"""The command line on the real robot, end to end, and its one line for each mistake."""

import io
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from ddenv.cli.follow import follow
from ddenv.cli.run import announce_notes
from ddenv.cli.terminal import CANNOT_SAY
from ddenv.engine import single_test
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive, engine_lock
from ddenv.runfile.store import COLUMNS, SCHEMA_VERSION, RunFile
from ddenv.schemas import names
from ddenv.words.claims import shown
from tests.command import ddenv, is_one_line
from tests.conftest import DATA
from tests.waiting import PATIENCE, wait_until
from tests.workbench import fake_moments

WALL = str(DATA / "wall.yaml")


@pytest.fixture(scope="session")
def reduced(made_once):
    """A finished reduction of the small world: its folder and its summary."""

    def make(folder):
        home = os.environ | {"DDENV_HOME": str(folder)}
        done = ddenv(
            "run", WALL, "--json", "--jobs", 2, "--output", folder / "minimal.sdf", env=home
        )
        assert done.returncode == 0, done.stderr
        (folder / "summary.json").write_text(done.stdout)

    folder = made_once("reduced", make)
    return folder, json.loads((folder / "summary.json").read_text())


@pytest.mark.programs
@pytest.mark.witness
def test_a_reduction_finds_the_two_that_matter(reduced):
    _, summary = reduced
    assert summary["kept"] == ["deck", "wall"]
    assert summary["minimal"] is True
    assert (summary["models_before"], summary["models_after"]) == (6, 2)
    assert sum(summary["outcomes"].values()) == summary["tests"]
    assert summary["rate_left"]["rate"] == summary["rate_whole_world"]["rate"] == 1.0
    assert [claim["verdict"] for claim in summary["certificate"]["claims"]] == [
        "kept",
        "needed",
        "needed",
    ]
    assert summary["outcomes"]["pass"] > 0
    assert set(summary) >= {"deflake_runs", "rounds", "wall_seconds", "run_file"}


@pytest.mark.programs
def test_the_minimal_world_fails_as_the_run_did_and_without_its_model_it_does_not(reduced):
    folder, summary = reduced
    run = summary["run_file"]
    assert _outcomes(ddenv("test", run, "--minimal", "--repeat", 3, "--json")) == ["similar"] * 3
    assert _outcomes(ddenv("test", run, "--minimal", "--leave-each-out", "--json")) == [
        "similar",
        "pass",
        "pass",
    ]
    assert _outcomes(ddenv("test", run, "--keep", "beam,post", "--seed", 7, "--json")) == ["pass"]
    assert _outcomes(ddenv("test", WALL, "--world", folder / "minimal.sdf", "--json")) == ["failed"]


@pytest.mark.programs
def test_a_test_of_a_run_is_made_again_by_its_number(reduced):
    run = reduced[1]["run_file"]
    with RunFile(Path(run)) as file:
        tests = fold(file.events()).tests
    test = next(test for test in tests if test.phase == "round" and test.outcome == "pass")
    (again,) = json.loads(ddenv("test", run, "--test", test.id, "--json").stdout)["runs"]
    assert (again["outcome"], again["seed"], tuple(again["end_pose"])) == (
        "pass",
        test.seed,
        test.end_pose,
    )


def _outcomes(done):
    assert done.returncode == 0, done.stderr
    return [run["outcome"] for run in json.loads(done.stdout)["runs"]]


@pytest.mark.programs
def test_the_streams_of_runs_are_those_of_their_trajectories(reduced, tmp_path):
    _, summary = reduced
    done = ddenv("export", summary["run_file"], "--mcap", tmp_path / "one.mcap")
    assert done.returncode == 0, done.stderr
    assert [line.split(":")[0].strip() for line in done.stdout.splitlines()[1:]] == [
        "/whole",
        "/left",
        "/passing",
    ]
    places, said = {}, []
    with (tmp_path / "one.mcap").open("rb") as file:
        for _, channel, _, message in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages(["/tf", "/result"]):
            if channel.topic == "/result":
                said.append(message.data)
                continue
            for one in message.transforms:
                places.setdefault(one.child_frame_id, []).append(
                    (one.transform.translation.x, one.transform.translation.y)
                )
    with RunFile(Path(summary["run_file"])) as run:
        state = fold(run.events())
        assert said == [shown(state)]
        trajectory = run.trajectory(state.f_test.id)
    assert places["whole/base_link"] == list(
        zip(trajectory[1::COLUMNS], trajectory[2::COLUMNS], strict=True)
    )
    assert ddenv("export", summary["run_file"], "--mcap", tmp_path / "one.mcap").returncode == 2


@pytest.mark.programs
def test_with_early_stop_a_robot_that_still_pushes_is_watched_to_the_end(home, reduced):
    # It stands at the wall for longer than any patience, but its controller never stops: noise
    # might set it free.
    done = ddenv("run", WALL, "--json", "--jobs", 2, "--timeout", 14, "--early-stop", "--no-slice")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["kept"], summary["minimal"], summary["failure"]) == (
        reduced[1]["kept"],
        True,
        "stuck",
    )
    assert summary["ended_early"] == 0
    assert "certificate 1: fresh runs of what is left (2 models)" in done.stderr


def test_runs_are_listed_and_a_damaged_one_does_not_hide_the_others(home, reduced, command):
    (home / "runs").mkdir()
    shutil.copy(reduced[1]["run_file"], home / "runs")
    (home / "runs" / "broken.ddenv").write_text("no run file")
    done = command("runs")
    assert done.returncode == 0
    assert "wall-1" in done.stdout
    assert "2 of 6 models" in done.stdout
    assert "is not a ddenv run file" in done.stdout


@pytest.mark.programs
def test_a_finished_run_resumes_to_its_summary(reduced):
    _, summary = reduced
    done = ddenv("resume", summary["run_file"], "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout) == summary


@pytest.mark.programs
def test_a_world_in_which_the_robot_does_not_fail_ends_with_1(home):
    done = ddenv("run", DATA / "wall.sdf", "--spawn", "-3,0,0.15", "--goal", "-5,0", "--json")
    assert done.returncode == 1, done.stderr
    summary = json.loads(done.stdout)
    assert "there is no failure to reduce" in summary["reason"]
    assert summary["minimal"] is False
    assert summary["models_after"] == 6


@pytest.mark.programs
def test_interrupted_it_stops_the_engine_and_can_be_resumed(home):
    process = subprocess.Popen(
        [sys.executable, "-m", "ddenv", "run", WALL, "--json", "--budget", "12"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    path = home / "runs" / "wall-1.ddenv"
    wait_until(lambda: path.exists() and engine_is_alive(path))
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert json.loads(out)["status"] == "stopped"
    assert "ddenv resume" in err
    assert not engine_is_alive(path)
    done = ddenv("resume", "wall-1", "--json")
    assert json.loads(done.stdout)["tests"] == 12


def test_a_second_engine_is_refused(reduced, tmp_path, command):
    # Another process may be looking at the run that all share.
    run = Path(shutil.copy(reduced[1]["run_file"], tmp_path))
    with engine_lock(run):
        is_one_line(command("resume", run), "another engine is working on this run")


MISTAKES = {
    "no scenario": (["run", "dich"], "did you mean ditch?"),
    "no file": (["run", "nothing.yaml"], "no such file"),
    "pair": (
        ["run", WALL, "--pair", "model2model/nearest"],
        "ddenv: --pair: 'model2model/nearest' is not allowed",
    ),
    "no pair": (
        ["run", WALL, "--pair", "model2model"],
        "--pair: 'model2model' is not allowed (did you mean",
    ),
    "algorithm": (
        ["run", WALL, "--algorithm", "ddmn"],
        (
            "ddenv: --algorithm: 'ddmn' is not allowed (did you mean ddmin?); use one of "
            f"{', '.join(names('algorithm'))}"
        ),
    ),
    "epsilon": (["run", WALL, "--epsilon", "0"], "--epsilon: expected 0.001 to 1000, found 0"),
    "iterations": (
        ["run", WALL, "--iterations", "-1"],
        "--iterations: expected 0 to 1000, found -1",
    ),
    "timeout": (["run", WALL, "--timeout", "0"], "--timeout: expected 0.01 to 100000, found 0"),
    "not a number": (["run", WALL, "--seed", "x"], "'--seed': 'x' is not a valid integer"),
    "jobs": (["run", WALL, "--jobs", "0"], "'--jobs': 0 is not in the range 1<=x<=1024"),
    "unknown option": (["run", WALL, "--fast"], "No such option"),
    "nearly an option": (["run", WALL, "--sped", "1"], "Did you mean '--seed'?; see"),
    "unlike any option": (
        ["world", "check", WALL, "--spawn", "1"],
        "No such option '--spawn'; see",
    ),
    "endless": (
        ["run", WALL, "--timeout", "1e300"],
        "--timeout: expected 0.01 to 100000, found 1e+300",
    ),
    "far away": (["run", WALL, "--spawn", "1e300,0,0,0"], "no number may exceed"),
    "unknown command": (
        ["certfy"],
        "no command, run, scenario or world 'certfy' (did you mean certify?)",
    ),
    "missing world": (["depot.world"], "ddenv: depot.world: no such file"),
    "missing run": (["there/depot.ddenv"], "ddenv: there/depot.ddenv: no such run file"),
    "folder to run": (["run", DATA], "is a folder; expected a scenario's name or file"),
    "folder to open": (["open", DATA], "is a folder; expected a run, a scenario or a world"),
    "spawn inside": (
        ["run", DATA / "wall.sdf", "--spawn", "2,0,0.5,0", "--goal", "4,0"],
        "inside model 'wall'",
    ),
    "no spawn": (
        ["run", DATA / "wall.sdf"],
        "needs a start and a goal, such as --spawn 0,0,0.2,0 --goal 9,0",
    ),
    "bad spawn": (
        ["run", DATA / "wall.sdf", "--spawn", "a,b", "--goal", "4,0"],
        "expected x,y,z,yaw",
    ),
    "name": (["run", WALL, "--name", "../x"], "is not a valid file name"),
    "no run": (["open", "nothing"], "no such run file"),
    "no runs": (["certify", "nothing", "--runs", "0"], "'--runs': 0 is not in the range x>=1"),
    "not a run": (["resume", __file__], "is not a ddenv run file"),
    "keep": (["test", WALL, "--keep", "nobody"], "no removable model 'nobody'"),
    "minimal": (["test", WALL, "--minimal"], "needs a run"),
    "test": (["test", WALL, "--test", 1], "--test: needs a run"),
    "export": (["export", "nothing", "--sdf", "x.sdf"], "no such run file"),
    "report of no run": (["report", "nothing"], "no such run file"),
    "world twice": (
        ["test", DATA / "wall.sdf", "--spawn", "0,0,0.5", "--goal", "4,0", "--world", "x.sdf"],
        "--world: only for a scenario",
    ),
    "output": (["run", WALL, "--output", "x.txt"], "neither a folder nor"),
    "no world to check": (["world", "check", "nowhere.sdf"], "nowhere.sdf: no such file"),
    "folder to show": (["world", "show", DATA], "is a folder"),
    "no scenario to check": (["world", "check", "frction"], "frction: no such file"),
    "stand-in": (
        ["world", "check", DATA / "wall.sdf", "--stand-in", "x"],
        "--stand-in: expected URI=SHAPE",
    ),
    "ignore": (["world", "check", DATA / "wall.sdf", "--ignore", "walls"], "'walls' is not one of"),
    "no folder to write to": (
        ["world", "convert", DATA / "wall.sdf", "-o", "/no/where/x.sdf"],
        "cannot be written",
    ),
}


@pytest.mark.parametrize(("words", "told"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_gets_one_line_and_leaves_nothing(home, monkeypatch, words, told, command):
    monkeypatch.chdir(home)
    is_one_line(command(*words), told)
    assert list(home.rglob("*")) == []


@pytest.mark.usefixtures("started")
def test_options_on_the_reduction_reach_the_run(home):
    from ddenv.cli.command_line import app
    from ddenv.runs.experiment import read_parts, with_options

    options = {
        "pair": "trajectoryseg/timestep",
        "algorithm": "probdd",
        "iterations": 7,
        "budget": 90,
        "baseline_runs": 6,
        "seed": 4,
        "timeout": 12.5,
    }
    words = [
        word
        for key, value in options.items()
        for word in (f"--{key.replace('_', '-')}", str(value))
    ]
    words += ["--early-stop", "--epsilon", "0.2", "--as-printed"]
    assert (
        app(["run", WALL, *words, "--output", str(home / "asked.ddenv")], standalone_mode=False)
        == 0
    )
    assert app(["run", WALL, "--output", str(home / "plain.ddenv")], standalone_mode=False) == 0
    with RunFile(home / "asked.ddenv") as asked, RunFile(home / "plain.ddenv") as plain:
        own, found = read_parts(plain)[0], read_parts(asked)[0]
    assert found == with_options(own, **options, early_stop=True, epsilon=0.2, as_printed=True)
    assert (own.reduction.growth, own.reduction.skip) == ("steady", "implied")
    assert (found.reduction.growth, found.reduction.skip) == ("paper", "known")


@pytest.mark.programs
def test_an_engine_that_cannot_start_is_told_and_not_the_old_end(home, reduced):
    run = shutil.copy(reduced[1]["run_file"], home / "broken.ddenv")
    with sqlite3.connect(run) as database:
        database.execute("UPDATE document SET content = x'7b7d' WHERE name = 'scenario'")
    is_one_line(ddenv("resume", run), "its scenario is not valid")
    is_one_line(ddenv("test", run), "its scenario is not valid")


@pytest.mark.programs
def test_without_a_screen_nobody_is_asked(home):
    run = home / "asked.ddenv"
    from ddenv.runs.creation import create_run
    from ddenv.world.load import load_scenario

    scenario = load_scenario(DATA / "wall.yaml")
    create_run(
        scenario.model_copy(
            update={"reduction": scenario.reduction.model_copy(update={"budget": 25})}
        ),
        run,
    )
    with RunFile(run) as viewer:
        viewer.send("accept_mode", mode="ask")
    done = ddenv("resume", run, "--json")
    assert json.loads(done.stdout)["kept"] == ["deck", "wall"]


@pytest.mark.programs
def test_a_scenario_cannot_name_a_run_out_of_its_folder(home):
    data = yaml.safe_load((DATA / "wall.yaml").read_text())
    data["name"], data["world"] = "../esc", str(DATA / "wall.sdf")
    data["robot"]["model"] = str(DATA.parents[1] / "sdf" / "robots" / "husky.sdf")
    (home / "s.yaml").write_text(yaml.safe_dump(data))
    (home / "in").mkdir()
    summary = json.loads(
        ddenv("run", home / "s.yaml", "--output", home / "in", "--budget", 3, "--json").stdout
    )
    assert summary["run_file"] == str(home / "in" / "---esc-1.ddenv")


def test_a_malformed_world_is_told_with_its_line(home, command):
    data = yaml.safe_load((DATA / "wall.yaml").read_text())
    (home / "w.sdf").write_text(
        "<sdf version='1.9'>\n<world name='w'>\n<model name='m'>\n</world></sdf>"
    )
    data["world"] = "w.sdf"
    data["robot"]["model"] = str(DATA.parents[1] / "sdf" / "robots" / "husky.sdf")
    (home / "s.yaml").write_text(yaml.safe_dump(data))
    is_one_line(
        command("run", home / "s.yaml"),
        "w.sdf:4:1: not well-formed XML: </world> closes <model> of line 3",
    )


def test_a_newer_run_file_is_refused(reduced, tmp_path, command):
    copy = tmp_path / "newer.ddenv"
    copy.write_bytes(Path(reduced[1]["run_file"]).read_bytes())
    with sqlite3.connect(copy) as database:
        database.execute(f"PRAGMA user_version = {SCHEMA_VERSION + 1}")
    for word in ("open", "resume", "test"):
        is_one_line(command(word, copy), "written by a newer ddenv")


@pytest.mark.parametrize(
    ("number", "words"),
    [(1, "1 part of w.sdf was replaced"), (2, "2 parts of w.sdf were replaced")],
)
def test_what_was_not_taken_as_it_is_written_is_counted(number, words, capsys):
    announce_notes(SimpleNamespace(notes=[None] * number, path="w.sdf"), as_json=False)
    assert capsys.readouterr().out.startswith(words)


@pytest.mark.parametrize("first", [[], ["open"]], ids=["alone", "open"])
def test_a_file_or_a_run_alone_opens_the_workbench_on_it(home, monkeypatch, first, command):
    opened = []
    monkeypatch.setattr(
        "ddenv.workbench.launch.run_workbench",
        lambda *run, **options: opened.append((run, options)) or 0,
    )
    (home / "runs").mkdir()
    (home / "runs" / "mine.ddenv").touch()
    for word in (DATA / "wall.sdf", DATA / "wall.yaml", "mine", "friction"):
        assert command(*first, word).returncode == 0
    files = [options["file"].name if "file" in options else run[0].name for run, options in opened]
    assert files == ["wall.sdf", "wall.yaml", "mine.ddenv", "friction.yaml"]


def test_options_for_reading_stand_before_the_file_or_after_it(home, monkeypatch, command):
    opened, fetched = [], []
    monkeypatch.setattr(
        "ddenv.workbench.launch.run_workbench",
        lambda *_, reading, **__: opened.append(reading) or 0,
    )
    monkeypatch.setattr(
        "ddenv.cli.fetch.fetch_with_bar", lambda world, reading, _: fetched.append((world, reading))
    )
    world = DATA / "wall.sdf"
    before = ["--fetch", "--inside", "--mesh", "hull", "--stand-in", "a=none", "--model-path", home]
    assert command(*before, world, "--stand-in", "b=auto", "--ignore", "joint").returncode == 0
    (asked,) = opened
    assert asked == {
        "stand_in": ("a=none", "b=auto"),
        "model_path": (home,),
        "ignore": ("joint",),
        "inside": True,
        "mesh": "hull",
    }
    assert [(file, reading.inside) for file, reading in fetched] == [(world, True)]
    assert command("--inside").returncode == 0 and opened[1]["inside"]
    is_one_line(command("--fetch"), "--fetch: name the world that lacks models")
    is_one_line(command("--inside", "world", "check", world), "go after the command: ddenv world")
    assert len(opened) == 2


class Unread(io.StringIO):
    """An output that nobody reads any more, as after `| head`."""

    def write(self, _):
        raise BrokenPipeError


def test_where_nobody_reads_any_more_it_says_that_the_engine_goes_on_and_how_to_stop_it(
    run, monkeypatch, capsys
):
    fake_moments.mid_round(run).hold()
    monkeypatch.setattr(sys, "stdout", Unread())
    engine = SimpleNamespace(pid=77, poll=lambda: run.write("paused"))
    with pytest.raises(BrokenPipeError):
        follow(run.path, engine, as_json=False)
    said = capsys.readouterr().err
    assert f"the engine keeps working on {run.path}" in said and "'kill 77' stops it" in said


# Of `ddenv reproduce`, for `git bisect run`: what is no answer is never taken for one.


@pytest.mark.parametrize(
    "words",
    [
        ["no-such-run"],
        [],
        ["--most", "none"],
        ["--no-such-option"],
        ["run", "--folder", "/nowhere"],
    ],
)
def test_whatever_is_wrong_it_says_that_it_cannot_say(home, words, command):
    said = command("reproduce", *words)
    assert said.returncode == CANNOT_SAY
    assert said.stderr and "Traceback" not in said.stderr


@pytest.mark.parametrize(
    "error", [RuntimeError("no simulator"), PermissionError(13, "denied", "file")]
)
def test_a_crash_is_no_failure_of_the_robot(monkeypatch, home, error, command):
    def crash(*_):
        raise error

    monkeypatch.setattr(single_test, "subject_in", crash)
    assert command("reproduce", "run").returncode == CANNOT_SAY


@pytest.mark.parametrize(
    "error",
    [MemoryError(), ImportError("libopenblas.so: failed to map segment from shared object")],
    ids=["a file", "a library"],
)
def test_too_little_memory_is_one_line(error, monkeypatch, capsys):
    from ddenv.cli import command_line

    monkeypatch.setattr(command_line, "app", Mock(side_effect=error))
    with pytest.raises(SystemExit) as ended:
        command_line.main()
    assert ended.value.code == 2
    assert (
        capsys.readouterr().err
        == "ddenv: out of memory; 'ulimit -v' says how much a process may use\n"
    )
