"""A study makes its cells whatever happens to it: interrupted, killed, beside broken ones, and
once.
"""

import csv
import html
import io
import os
import shutil
import signal
import sqlite3
import threading

import pytest

from ddenv.errors import UserError
from ddenv.run_numbers import CERTIFICATES
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.study.conduct import Runner, conduct
from ddenv.study.folder import sessions
from ddenv.study.plan import run_path
from ddenv.study.results import read_cell
from tests.study.made import plan_of, wall
from tests.study.quick import Killed, Lab
from tests.waiting import PATIENCE, wait_until

NEEDED = {"deck", "wall"}
# A weak claim needs few runs.
CHEAP = {"algorithms": "splitting", "keep_rate": 0.5}
METHODS = {"pairs": "model2model/failure-proximal,model2model/sequential", **CHEAP}
ONE = {"pairs": "model2model/sequential", **CHEAP}


def fails(name, keep, seed):
    return "similar" if keep >= NEEDED else "pass"


@pytest.fixture
def lab(monkeypatch):
    return Lab(monkeypatch, fails)


def study(folder, plan, jobs=2):
    """Works on a study; returns its exit code and what it said."""
    out = io.StringIO()
    return conduct(plan, folder, jobs, out), out.getvalue()


def told(folder):
    """The table of all cells without what depends on who worked on them, and when."""
    rows = csv.DictReader(io.StringIO((folder / "study.csv").read_text()))
    free = {"ahead", "taken_over", "seconds", "certificate_seconds", "problem"}
    return [{key: value for key, value in row.items() if key not in free} for row in rows]


@pytest.fixture(scope="module")
def two_by_two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenarios")
    return plan_of(wall(folder, "one"), wall(folder, "two", seed=50), **METHODS)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, two_by_two):
    """A study that nobody disturbed: its folder, what it said, and what it started."""
    folder = tmp_path_factory.mktemp("undisturbed") / "study"
    with pytest.MonkeyPatch.context() as patch:
        lab = Lab(patch, fails)
        code, words = study(folder, two_by_two)
    assert code == 0
    return folder, words, lab


def test_a_study_runs_to_its_end(undisturbed, two_by_two):
    folder, words, lab = undisturbed
    *lines, last = words.splitlines()
    assert len(lines) == 4 and last == f"4 of 4 cells certified; wrote {folder}/study.html"
    for line, cell, row in zip(lines, two_by_two.cells, told(folder), strict=True):
        assert cell.label in line and "2 models" in line
        assert f"{row['tests']} tests and {row['certificate_tests']} for the certificate" in line
    assert [row["names"] for row in told(folder)] == ["deck wall"] * 4
    assert all(
        row["left_f"] == row["left_runs"] > "0" and row["without_most"] == "0.0"
        for row in told(folder)
    )
    (session,) = sessions(folder)
    assert (session.jobs, session.tests) == (2, lab.made)
    assert len(lab.started) == 4


def test_what_another_cell_has_tested_is_not_tested_again(undisturbed, two_by_two):
    folder, _, lab = undisturbed
    found = [read_cell(folder, cell) for cell in two_by_two.cells]
    # Nothing between scenarios, whose seeds differ.
    assert [each.taken_over > 0 for each in found] == [False, True, False, True]
    assert (
        sum(each.tests + each.certificate_tests + each.ahead - each.taken_over for each in found)
        == lab.made
    )
    assert [each.tests for each in found[:2]] == [each.tests for each in found[2:]]
    # The second cell ends with the same models: it has the whole certificate of the first.
    assert [each.taken_over >= each.certificate_tests for each in found] == [
        False,
        True,
        False,
        True,
    ]


def test_run_again_it_makes_only_what_is_missing(undisturbed, two_by_two, lab, tmp_path):
    """Also in another place: where files are does not matter, what they hold does."""
    shutil.copytree(undisturbed[0], folder := tmp_path / "study")
    (folder / "study.html").unlink()
    moved = plan_of(wall(tmp_path, "one"), wall(tmp_path, "two", seed=50), **METHODS)
    assert moved.scenarios != two_by_two.scenarios
    assert study(folder, moved) == (0, f"4 of 4 cells certified; wrote {folder}/study.html\n")
    assert (lab.made, lab.started) == (0, [])
    assert (folder / "study.html").exists() and len(sessions(folder)) == 1
    one = moved.cells[1]
    run_path(folder, one).unlink()
    assert study(folder, moved)[0] == 0
    assert [name for name, _ in lab.started] == [one.name]
    assert told(folder) == told(undisturbed[0])


def test_a_certificate_that_broke_is_made_again(lab, tmp_path):
    """Too many of its runs without the wall break: its claim is unknown, until the same command
    makes them again.
    """
    plan, folder = plan_of(wall(tmp_path), **ONE), tmp_path / "study"
    lab.oracle = lambda name, keep, seed: (
        "error" if seed >= CERTIFICATES.start and "wall" not in keep else fails(name, keep, seed)
    )
    code, words = study(folder, plan)
    assert code == 1 and "0 of 1 cell certified" in words
    assert "not certified: not shown that each model is needed: tests broke without wall" in words
    lab.oracle = fails
    code, words = study(folder, plan)
    assert code == 0 and "1 of 1 cell certified" in words


def test_workers_are_shared_out(tmp_path, lab):
    study(tmp_path / "study", plan_of(wall(tmp_path), **METHODS), jobs=5)
    assert [jobs for _, jobs in lab.started] == [2, 3]


def until_stopped(run, *_):
    """Waits until an engine was asked to stop."""
    with RunFile(run) as file:
        wait_until(file.commands)


def test_terminated_it_writes_what_it_has_and_goes_on(
    tmp_path, lab, two_by_two, undisturbed, capsys
):
    asked = []

    def terminate(run, made):
        if run.stem.startswith("two") and made == 4 and not asked:
            asked.append(os.kill(os.getpid(), signal.SIGTERM))
        if asked:
            until_stopped(run)

    lab.before = terminate
    before = signal.signal(signal.SIGTERM, mine := lambda *_: None)
    try:
        code, _ = study(tmp_path, two_by_two)
        assert signal.getsignal(signal.SIGTERM) is mine
    finally:
        signal.signal(signal.SIGTERM, before)
    assert (code, capsys.readouterr().err) == (130, "interrupted; the same command continues\n")
    assert not any(engine_is_alive(run_path(tmp_path, cell)) for cell in two_by_two.cells)
    certified = [row["certified"] for row in told(tmp_path)]
    assert "True" in certified and "False" in certified and (tmp_path / "study.html").exists()
    lab.before = lambda run, made: None
    assert study(tmp_path, two_by_two)[0] == 0
    assert told(tmp_path) == told(undisturbed[0])
    assert sum(each.tests for each in sessions(tmp_path)) == lab.made


def test_cells_that_come_to_no_end_are_told_and_the_others_are_made(tmp_path, lab):
    """In one the robot reaches its goal, in one the simulator goes out of order, in one the engine
    is killed.
    """
    names = ("never", "breaks", "killed", "fails")
    files = [wall(tmp_path, name, seed=number, iterations=30) for number, name in enumerate(names)]
    plan = plan_of(*files, **ONE)

    def oracle(name, keep, seed):
        if name == "never":
            return "pass"
        return "error" if name == "breaks" and len(keep) < 6 else fails(name, keep, seed)

    def kill(run, made):
        if run.stem.startswith("killed") and made == 5:
            raise Killed

    lab.oracle, lab.before = oracle, kill
    code, words = study(tmp_path / "study", plan)
    assert code == 1 and "1 of 4 cells certified" in words
    page = html.unescape((tmp_path / "study" / "study.html").read_text())
    never, breaks, killed, fine = (read_cell(tmp_path / "study", cell) for cell in plan.cells)
    assert "reached its goal in all 3 baseline runs: there is no failure to reduce" in never.problem
    assert "25 tests in a row broke" in breaks.problem
    assert "the engine was killed or crashed" in words and killed.problem == "has not ended"
    for problem in (never.problem, breaks.problem):
        assert problem in words
    for each in (never, breaks, killed):
        assert each.problem in page
    assert fine.minimal

    # It goes on with what may come to an end now.
    lab.oracle, lab.before = fails, lambda run, made: None
    lab.started.clear()
    code, words = study(tmp_path / "study", plan)
    assert code == 1 and "3 of 4 cells certified" in words
    assert [name for name, _ in lab.started] == [plan.cells[1].name, plan.cells[2].name]


def orphan(lab, folder, plan, gate):
    """An engine that an earlier study left; it goes on to its end once `gate` is set."""
    (cell,) = plan.cells
    lab.before = lambda run, made: gate.wait(PATIENCE)
    engine = lab.start_engine(run_path(folder, cell), EngineOptions(jobs=1))
    wait_until(lambda: engine_is_alive(run_path(folder, cell)))
    return engine


@pytest.fixture
def alone(tmp_path):
    """A study of one cell, whose run is there."""
    plan = plan_of(wall(tmp_path), **ONE)
    create_run(plan.cells[0].scenario, run_path(tmp_path / "study", plan.cells[0]))
    (tmp_path / "study" / "study.lock").touch()
    return tmp_path / "study", plan


def when_it_waits(monkeypatch, happens):
    """Something `happens` as soon as the study waits for its engines."""
    look, happened = Runner.look, []

    def first(self):
        look(self)
        if self.running and not happened:
            happened.append(True)
            happens()

    monkeypatch.setattr(Runner, "look", first)


def test_an_engine_that_a_killed_study_left_is_waited_for(alone, lab, monkeypatch):
    engine = orphan(lab, *alone, gate := threading.Event())
    when_it_waits(monkeypatch, gate.set)
    assert study(*alone)[0] == 0
    # The study's own engine gave up.
    assert engine.poll() == 0 and len(lab.started) == 2


def test_an_engine_that_was_left_and_begins_only_now_is_waited_for(alone, lab, monkeypatch):
    """It was started just before the study was killed: it has the run before the new one's engine
    has.
    """
    gate = threading.Event()
    start = lab.start_engine

    look, mine, looks = Runner.look, [], []

    def let_go(self):
        look(self)
        if mine and mine[0].poll() is not None:
            looks.append(self)
        # The study has seen that the new one has given up.
        if len(looks) > 1:
            gate.set()

    def late(*words, **options):
        monkeypatch.setattr("ddenv.study.conduct.start_engine", start)
        orphan(lab, *alone, gate)
        mine.append(start(*words, **options))
        return mine[0]

    monkeypatch.setattr("ddenv.study.conduct.start_engine", late)
    monkeypatch.setattr(Runner, "look", let_go)
    code, words = study(*alone)
    gate.set()
    assert code == 0, words


def test_an_engine_that_was_left_is_stopped_with_the_study(alone, lab, monkeypatch):
    engine = orphan(lab, *alone, gate := threading.Event())
    lab.before = until_stopped

    def interrupt():
        gate.set()
        raise KeyboardInterrupt

    when_it_waits(monkeypatch, interrupt)
    assert study(*alone)[0] == 130
    wait_until(lambda: engine.poll() is not None)
    assert engine.poll() == 1


def test_a_run_of_something_else_is_refused_in_one_line(tmp_path, lab):
    file = wall(tmp_path)
    world = plan_of(file, **ONE).scenarios[0].world
    (tmp_path / "wall.sdf").write_bytes(world.read_bytes())
    file.write_text(file.read_text().replace(str(world), "wall.sdf"))
    folder, (cell,) = tmp_path / "study", plan_of(file, **ONE).cells
    create_run(cell.scenario, run := run_path(folder, cell))
    (folder / "study.lock").touch()

    def refused(**options):
        with pytest.raises(UserError) as error:
            study(folder, plan_of(file, **ONE, **options))
        return str(error.value)

    told, leave = (
        f"{run}: was made with another",
        f"choose another folder with -o, or delete {folder}/runs",
    )
    assert refused(epsilon=0.5) == f"{told} scenario, or with other options; {leave}"
    (tmp_path / "wall.sdf").write_text(
        (tmp_path / "wall.sdf").read_text().replace("far_box", "far_bin")
    )
    assert refused() == f"{told} world; {leave}"
    with sqlite3.connect(run) as db:
        db.execute("DELETE FROM event")
    for _ in range(2):
        assert "delete that file, or choose another folder with -o" in refused()
        run.write_text("no run file")
    assert lab.started == []
