"""A simulator of the user's own: whatever it does becomes a result, and nothing of it is left."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import textwrap

import numpy as np
import pytest

from ddenv.errors import UserError
from ddenv.robot.external import process, simulator
from ddenv.robot.external.simulator import BadLog, PoseLog
from ddenv.world.load import load_scenario
from ddenv.world.sdf.read import read_world
from ddenv.world.whole import whole_of
from tests.conftest import DATA, ROOT
from tests.robot.external.own import FAMILY, SLEEP, STUBBORN

EVERYTHING = frozenset({"deck", "wall", "far_box", "post", "ball", "beam"})
PASS = "print('0,0,0,0,0,0,0,1'); print('2.5,4,0,0,0,0,0,1')"


def test_exit_code_0_is_a_pass_and_1_a_failure(simulator_of):
    passed = simulator_of(PASS).run(EVERYTHING, 3)
    assert (passed.outcome, passed.failure, passed.seed, passed.simulated_seconds) == (
        "pass",
        "",
        3,
        2.5,
    )
    assert passed.end_pose == (4, 0, 0, 1, 0, 0, 0)
    assert (passed.motions, passed.first_sensed, passed.first_touched) == ({}, {}, {})
    assert 0 < passed.wall_seconds < 20
    failed = simulator_of(PASS + "; exit(1)").run(EVERYTHING, 3)
    assert (failed.outcome, failed.failure) == ("failed", "stuck")
    assert np.array_equal(failed.trajectory, passed.trajectory)


TELL = """
    import os, sys
    print("0,0,0,0,0,0,0,1")
    reported = {name: os.environ[name] for name in os.environ if name.startswith(("DDENV_", "GZ_", "GAZEBO_"))}
    world = open(sys.argv[1]).read()
    open("reported", "w").write(repr((sys.argv[1:], reported, world, os.getcwd(), sys.stdin.read())))
"""


def test_the_command_gets_the_world_the_seed_and_the_scenario(simulator_of, tmp_path, monkeypatch):
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", "/models")
    monkeypatch.delenv("GAZEBO_MODEL_PATH", raising=False)
    assert (
        simulator_of(TELL, "{world} --seed={seed}").run(frozenset({"deck", "wall"}), 5).outcome
        == "pass"
    )
    (world, seed), reported, text, cwd, stdin = eval((tmp_path / "reported").read_text())
    assert (seed, cwd, stdin) == ("--seed=5", str(tmp_path), "")
    assert "far_box" not in text and "deck" in text and "ground_plane" in text
    assert (reported["DDENV_WORLD"], reported["DDENV_SEED"], reported["DDENV_TIMEOUT"]) == (
        world,
        "5",
        "5",
    )
    assert (reported["DDENV_SPAWN"], reported["DDENV_GOAL"]) == ("0 0 0.45 0", "4 0 0.5")
    assert reported["GZ_SIM_RESOURCE_PATH"] == os.pathsep.join(
        [str(DATA), str(DATA / "models"), "/models"]
    )
    assert reported["GAZEBO_MODEL_PATH"] == os.pathsep.join([str(DATA), str(DATA / "models")])


def test_the_scenario_goes_along_in_the_reduced_world(simulator_of, tmp_path):
    show = (
        "import shutil, sys; shutil.copytree(sys.argv[1].rpartition('/')[0], 'shown'); "
        "print('0,0,0,0,0,0,0,1')"
    )
    assert simulator_of(show, "{scenario}").run(frozenset({"deck", "wall"}), 5).outcome == "pass"
    (file,) = (tmp_path / "shown").glob("*.yaml")
    shown, own = load_scenario(file), load_scenario(DATA / "wall.yaml")
    assert {model.name for model in read_world(tmp_path / "shown" / shown.world.name).models} == {
        "ground_plane",
        "deck",
        "wall",
    }
    assert shown.oracle is None
    assert (shown.robot, shown.goal, shown.sensors) == (own.robot, own.goal, own.sensors)
    assert shown.reading.model_path[0] == own.world.parent
    assert shown.whole == whole_of(read_world(own.world), own)


def test_the_log_may_be_a_file_and_its_name_works_without_one(simulator_of):
    write = "import os, sys; open(os.environ['DDENV_LOG'], 'a').write('1,2,3,4,0,0,0,1')"
    to_file = simulator_of(f"print('starting'); {write}", "{log}").run(EVERYTHING, 0)
    assert (to_file.outcome, to_file.end_pose[:3]) == ("pass", (2, 3, 4))
    assert simulator_of(write).run(EVERYTHING, 0).end_pose[:3] == (2, 3, 4)


def test_progress_is_reported_while_it_runs(simulator_of, tmp_path):
    # The command goes on only when its first row has been reported.
    wait = """
        import os, time
        print("0,1,2,3,0,0,0,1", flush=True)
        while not os.path.exists("seen"):
            time.sleep(0.01)
        print("1,4,2,3,0,0,0,1")
    """
    reported = []

    def progress(time_s, pose, _):
        reported.append((time_s, pose[0]))
        (tmp_path / "seen").touch()

    assert simulator_of(wait).run(EVERYTHING, 0, progress).outcome == "pass"
    assert reported == [(0, 1), (1, 4)]


@pytest.mark.parametrize(
    ("code", "ends_at", "within"),
    [
        pytest.param(SLEEP, 0, 0.6, marks=pytest.mark.programs),
        pytest.param(STUBBORN, 0, 0.6, marks=pytest.mark.programs),
        # Time enough to have one.
        (FAMILY + SLEEP, 7, 3.0),
        pytest.param(
            "import os, signal; os.kill(os.getpid(), signal.SIGSTOP)",
            0,
            0.6,
            marks=pytest.mark.programs,
        ),
    ],
    ids=["hangs", "ignores SIGTERM", "has a family", "is stopped"],
)
def test_a_command_that_hangs_is_killed_with_all_that_it_started(
    simulator_of, code, ends_at, within
):
    result = simulator_of(code, wall_timeout=within).run(EVERYTHING, 0)
    assert (result.outcome, result.failure) == (
        "error",
        f"took longer than {within:g} s of wall clock",
    )
    assert result.end_pose[:3][0] == ends_at


def test_a_command_that_stops_its_supervisor_is_killed_with_it(simulator_of, monkeypatch):
    monkeypatch.setattr(process, "STOP_WAIT", 0.5)
    stop = "import os, time; os.kill(os.getppid(), 19); time.sleep(1000)"
    result = simulator_of(stop, wall_timeout=0.5).run(EVERYTHING, 0)
    assert (result.outcome, result.failure) == ("error", "took longer than 0.5 s of wall clock")


def test_what_a_command_leaves_behind_is_killed(simulator_of):
    assert simulator_of(FAMILY).run(EVERYTHING, 0).outcome == "pass"


def test_a_log_that_ends_long_after_the_timeout_is_an_error(simulator_of):
    late = simulator_of("print('0,0,0,0.2,0,0,0,1'); print('1e9,3,0,0.2,0,0,0,1'); exit(1)").run(
        EVERYTHING, 0
    )
    assert late.outcome == "error"
    assert late.failure.startswith("the pose log ends at 1e+09 s, and the timeout is ")


@pytest.mark.parametrize(
    ("code", "complaint"),
    [
        ("exit(3)", "the command's exit code is 3, neither 0 nor 1"),
        ("exit(139)", "exit code is 139, neither 0 nor 1 .SIGSEGV."),
        (
            "print('1,0;3,0;0,0;0,2;0;0;0;1')",
            "write decimal points, and commas between the numbers",
        ),
        ("1 / 0", "the command ended with an exception: ZeroDivisionError: division by zero"),
        (
            "import sys; print('no display\\n\\x1b[2J', file=sys.stderr); exit(255)",
            "exit code is 255, .*: .*2J",
        ),
        (
            "import sys; sys.stderr.write('x' * 100000 + '\\nlast ' + 'y' * 1000); exit(9)",
            "exit code is 9, .*: last y+[.]{3}$",
        ),
        ("import os; os.kill(os.getpid(), 11)", "the command was ended by SIGSEGV"),
        ("import os; os.abort()", "the command was ended by SIGABRT"),
        (
            "import os, time; os.kill(os.getppid(), 9); time.sleep(1000)",
            "the command's supervisor was killed",
        ),
        (
            "print('Gazebo 11')",
            "the pose log, line 1: expected t,x,y,z,qx,qy,qz,qw .* found 'Gazebo 11'",
        ),
        ("pass", "the pose log has no rows"),
    ],
)
def test_what_breaks_is_an_error_with_its_reason(simulator_of, code, complaint):
    result = simulator_of(code).run(EVERYTHING, 0)
    assert result.outcome == "error"
    assert np.isfinite(result.trajectory).all() and result.trajectory.shape == (1, 8)
    assert result.end_pose[:3] == (0, 0, 0.45)
    assert re.search(complaint, result.failure), result.failure
    assert result.failure.isprintable() and len(result.failure) < 400


@pytest.mark.parametrize(
    ("code", "outcome"),
    [
        ("1 / 0", "error"),
        ("raise ExceptionGroup('two', [ValueError('a'), KeyError('b')])", "error"),
        # An exception that was caught and printed, or an interruption, is not the reason for the
        # exit code.
        (
            "import sys; sys.excepthook(*caught()); print('going on', file=sys.stderr); exit(1)",
            "failed",
        ),
        (
            "import sys; sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None); exit(1)",
            "failed",
        ),
        ("import sys; sys.excepthook(*caught()); exit(0)", "pass"),
    ],
)
def test_an_exception_is_no_failure_of_the_robot(simulator_of, code, outcome):
    caught = """
        import sys
        def caught():
            try:
                1 / 0
            except ZeroDivisionError:
                return sys.exc_info()
        print("0,1,2,3,0,0,0,1", flush=True)
    """
    result = simulator_of(textwrap.dedent(caught) + code).run(EVERYTHING, 0)
    assert result.outcome == outcome
    assert result.end_pose[:3] == (1, 2, 3)


@pytest.mark.programs
def test_output_without_end_neither_fills_memory_nor_blocks(simulator_of, monkeypatch):
    monkeypatch.setattr(simulator, "MOST_BYTES", 3_000_000)
    flood = """
        import os, sys
        print("0,1,2,3,0,0,0,1", flush=True)
        for _ in range(STDERR):
            os.write(2, b"warning " * 8000)
        log = TO
        while True:
            log.write(b"0,1,2,3,0,0,0,1\\n" * 4000)
    """
    for to, words in (("sys.stdout.buffer", ""), ("open(sys.argv[1], 'wb')", "{log}")):
        result = simulator_of(flood.replace("TO", to).replace("STDERR", "2000"), words).run(
            EVERYTHING, 0
        )
        assert result.outcome == "error"
        assert "larger than" in result.failure


def test_a_program_that_goes_missing_or_cannot_be_executed_is_an_error(simulator_of, tmp_path):
    simulator = simulator_of(PASS)
    program = tmp_path / "program"
    program.write_bytes(b"\x7fELF nonsense")
    program.chmod(0o755)
    simulator._words = (str(program),)
    assert (
        "the command cannot be started: Exec format error" in simulator.run(EVERYTHING, 0).failure
    )
    program.unlink()
    assert "the command cannot be started: No such file" in simulator.run(EVERYTHING, 0).failure
    simulator._scenario = simulator._scenario.model_copy(update={"folder": tmp_path / "gone"})
    result = simulator.run(EVERYTHING, 0)
    assert result.outcome == "error" and "gone" in result.failure


def test_a_lack_of_room_for_temporary_files_is_reported(simulator_of, monkeypatch, tmp_path):
    simulator = simulator_of(PASS)
    with monkeypatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
        with pytest.raises(UserError, match=r"no temporary file can be written .*; set TMPDIR"):
            simulator.run(EVERYTHING, 0)


# A worker that is killed, as a pool does it, once it has written the world's file.
KILLED = """
import os, pathlib, sys
from ddenv.robot.external.simulator import ExternalSimulator
from ddenv.runs.experiment import load_parts
from tests.robot.external.own import SLEEP, own_scenario
written = pathlib.Path.write_bytes
pathlib.Path.write_bytes = lambda file, text: (written(file, text), os.kill(os.getpid(), 9))
scenario = own_scenario(pathlib.Path(sys.argv[1]), SLEEP)
ExternalSimulator(load_parts(scenario)[0], scenario).run(frozenset(), 0)
"""


def test_a_worker_that_is_killed_while_it_writes_the_files_leaves_nothing(tmp_path):
    environment = os.environ | {"TMPDIR": tempfile.gettempdir()}
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path)],
        env=environment,
        cwd=ROOT,
        capture_output=True,
    )
    assert done.returncode == -9, done.stderr


def test_a_model_that_is_not_there_is_refused(simulator_of):
    with pytest.raises(ValueError, match="no such model: chair"):
        simulator_of(PASS).run(frozenset({"chair"}), 0)


def test_drake_is_not_needed():
    code = (
        "import sys, ddenv.engine.worker, ddenv.robot.external.simulator; print('pydrake' in "
        "sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr


ROW = "1,2,3,4,0,0,0,1\n"


def read(text, piece=7):
    log = PoseLog()
    content = text if isinstance(text, bytes) else text.encode()
    for start in range(0, len(content), piece):
        log.add(content[start : start + piece])
    return log.finish()


def test_the_quaternion_is_turned_into_our_order_and_given_its_length():
    assert read("0.5,1,2,3,0.2,0.4,0.4,0.8\n").tolist() == [[0.5, 1, 2, 3, 0.8, 0.2, 0.4, 0.4]]


@pytest.mark.parametrize(
    "text",
    [
        f"t,x,y,z,qx,qy,qz,qw\n{ROW}",
        f"\n  \n# a comment, with commas\ntime, px, py, pz, ox, oy, oz, ow\n{ROW}\n#end",
        ROW.strip(),
        ROW.replace("\n", "\r\n"),
        f"\ufeff{ROW}",
        " 1 , 2 ,3.0,+4e0,0,0, -0 ,1\n",
    ],
)
def test_headers_comments_blanks_and_line_ends_do_not_count(text):
    assert read(text).tolist() == [[1, 2, 3, 4, 1, 0, 0, 0]]


def test_a_row_every_tenth_of_a_second_and_the_last_one_are_kept():
    rows = read(
        "".join(f"{step * 0.001:.3f},{step},0,0,0,0,0,1\n" for step in range(1051)), piece=1000
    )
    assert rows[:, 0].tolist() == pytest.approx([*np.arange(0, 1.01, 0.1), 1.05])
    assert rows[-1, 1] == 1050


def test_of_rows_at_one_time_the_last_counts():
    assert read("0,0,0,0,0,0,0,1\n0.1,1,0,0,0,0,0,1\n0.1,2,0,0,0,0,0,1\n")[:, 1].tolist() == [0, 2]


def test_progress_gets_what_is_kept():
    reported = []
    log = PoseLog(lambda *row: reported.append(row))
    log.add(ROW.encode() + b"1.01,9,9,9,0,0,0,1\n1.1,2,3,5,0,0,0,1\n1.2,2,")
    assert reported == [(1, (2, 3, 4, 1, 0, 0, 0), {}), (1.1, (2, 3, 5, 1, 0, 0, 0), {})]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no rows; expected t,x,y,z,qx,qy,qz,qw"),
        ("t,x,y,z,qx,qy,qz,qw\n", "no rows"),
        (
            f"{ROW}{ROW}1,2,3\n",
            "line 3: expected t,x,y,z,qx,qy,qz,qw (s, m, a quaternion), found '1,2,3'",
        ),
        (f"{ROW}Gazebo says hello\n", "line 2: expected .* found 'Gazebo says hello'"),
        ("1 2 3 4 0 0 0 1\n", "line 1"),
        (f"1,{ROW}", "line 1"),
        ("1,nan,3,4,0,0,0,1\n", "'; a number is not finite"),
        (
            "1,0,0,0,2,5,4,0,0,0,0,0,0,0,1,0\n",
            "'; write decimal points, and commas between the numbers",
        ),
        ("1,2,3,inf,0,0,0,1", "line 1"),
        ("1,2,3,4,0,0,0,0\n", "line 1: the quaternion 0,0,0,0 has no length"),
        (f"{ROW}0.9,2,3,4,0,0,0,1\n", "line 2: time goes back from 1 to 0.9 s"),
        ("-1,2,3,4,0,0,0,1\n", "line 1: time goes back"),
        ("1e18,2,3,4,0,0,0,1\n", "line 1: a number is above 1e[+]09: times are in s, places in m"),
        (f"t,x,y,z,qw,qx,qy,qz\n{ROW}", "line 1: expected t,x,y,z,qx,qy,qz,qw"),
        (f"t,x,y\n{ROW}", "line 1"),
        (f"{ROW}t,x,y,z,qx,qy,qz,qw\n", "line 2"),
        (b"\xff\x00\x1b[31m\n", "line 1"),
        ("x" * 100_000, "line 1: .* found 'x+[.][.][.]'$"),
    ],
)
def test_nonsense_is_reported_with_its_line(text, complaint):
    with pytest.raises(
        BadLog, match=complaint.replace("(s,", "[(]s,").replace("on)", "on[)]")
    ) as reported:
        read(text)
    assert str(reported.value).isprintable() and len(str(reported.value)) < 200


def test_a_log_that_never_ends_is_too_large_and_takes_no_memory(monkeypatch):
    monkeypatch.setattr(simulator, "MOST_BYTES", 1000)
    log = PoseLog()
    for _ in range(100):
        log.add(ROW.encode())
    assert log.size > 1000
    with pytest.raises(BadLog, match="larger than"):
        log.finish()
    assert len(log.rows()) == 1
