"""Tests that another run has made are taken over where they would be the same to the last bit, and
only there.
"""

import json
import shutil
import sqlite3
from pathlib import Path

import pytest

from ddenv.engine import shared
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import read_parts
from ddenv.world.scenario import Controller, Oracle, Sensors
from tests.conftest import DATA
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.oracles import needs
from tests.engine.reading import told
from tests.wall import wall

METHOD = {"algorithm": "splitting"}


def known(path):
    """What a run would take over of those beside it."""
    with RunFile(path) as file:
        scenario, _, _ = read_parts(file)
        return shared.tests_of_others(file, scenario, path.parent)


def share(path, pool, found=None):
    """Works on a run; it takes over what it can."""
    return drive(path, pool, others=known(path) if found is None else found)


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """A run with nothing done yet, and the same one at its end."""
    folder = tmp_path_factory.mktemp("originals")
    shutil.copy(fresh := new_run(folder, **METHOD), done := folder / "done.ddenv")
    drive(done, FakePool(needs("wall", "beam"), 1))
    return fresh, done


@pytest.fixture
def fresh(tmp_path, originals):
    """A run with nothing done yet."""
    return Path(shutil.copy(originals[0], tmp_path / "fresh.ddenv"))


@pytest.fixture
def made(tmp_path, originals):
    """A finished run beside it."""
    return Path(shutil.copy(originals[1], tmp_path / "made.ddenv"))


def test_a_test_that_is_taken_over_is_the_one_that_was_made(made, fresh):
    state = share(fresh, pool := FakePool(needs("wall", "beam"), 1))
    assert pool.made == []
    assert state.minimal and set(state.environment) == {"wall", "beam"}
    assert all(test.taken for test in state.tests)
    written = told(made, "test_finished")
    assert told(fresh, "test_finished") == [data | {"taken": made.stem} for data in written]
    with RunFile(fresh) as one, RunFile(made) as two:
        for test in state.tests:
            assert one.motions(test.id) == two.motions(test.id) != {}


@pytest.mark.parametrize("jobs", [1, 3])
def test_another_method_comes_to_the_same_as_alone(tmp_path, made, jobs):
    method = {"algorithm": "ddmin", "iterations": 2}
    path = new_run(tmp_path, **method)
    found = known(path)
    state = share(path, pool := FakePool(needs("wall", "beam"), jobs), found)
    alone = drive(new_run(tmp_path, **method), FakePool(needs("wall", "beam"), 1))
    assert (state.environment, state.minimal, state.rounds_done) == (
        alone.environment,
        True,
        alone.rounds_done,
    )
    taken = sum(test.taken for test in state.tests)
    assert taken >= 3 and taken + len(pool.made) == state.tests_done


def test_a_run_does_not_learn_of_itself(made):
    assert known(made) == {}


def test_tests_of_other_seeds_are_made(tmp_path, made):
    share(new_run(tmp_path, seed=100, **METHOD), pool := FakePool(needs("wall", "beam"), 1))
    assert min(seed for _, seed in pool.made) == 100


def test_how_a_world_is_reduced_does_not_matter_nor_where_files_are(tmp_path, made):
    (tmp_path / "wall.sdf").write_bytes((DATA / "wall.sdf").read_bytes())
    moved = {
        "name": "other",
        "description": "other",
        "world": tmp_path / "wall.sdf",
        "folder": tmp_path,
    }
    assert known(changed_run(tmp_path, moved))


DIFFERS = {
    "epsilon": lambda old: {"failure": old.failure.model_copy(update={"epsilon": 0.5})},
    "early stop": lambda old: {"reduction": old.reduction.model_copy(update={"early_stop": True})},
    "goal": lambda old: {"goal": old.goal.model_copy(update={"x": 5.0})},
    "controller": lambda old: {"controller": Controller(use="costmap", speed=0.5)},
    "own controller": lambda old: {"controller": Controller(use="mine:Mine")},
    "sensors": lambda old: {"sensors": Sensors(compass=0.5)},
    "protected": lambda old: {"protected": ("ball",)},
    "oracle": lambda old: {"oracle": Oracle(command="true")},
}


def asked():
    """What the run `made` was asked for, but for how the world is reduced."""
    return wall(reduction={"early_stop": False})


def changed_run(folder, changed):
    """A run of the small world that differs in these parts of its scenario."""
    path = folder / f"changed-{len(list(folder.iterdir()))}.ddenv"
    create_run(asked().model_copy(update=changed), path)
    return path


@pytest.mark.parametrize("differs", DIFFERS.values(), ids=DIFFERS.keys())
def test_of_another_scenario_nothing_is_taken_over(tmp_path, made, differs):
    assert known(changed_run(tmp_path, differs(asked()))) == {}


@pytest.mark.parametrize(
    "same",
    [{"controller": Controller(use="mine:Mine")}, {"oracle": Oracle(command="true")}],
    ids=["controller", "oracle"],
)
def test_of_simulators_that_are_not_ours_nothing_is_taken_over(tmp_path, same):
    drive(changed_run(tmp_path, same), FakePool(needs("wall"), 1))
    assert known(changed_run(tmp_path, same)) == {}


@pytest.mark.parametrize("document", ["world", "robot", "resource model://rock/rock.obj"])
def test_of_other_files_nothing_is_taken_over(made, fresh, document):
    """A byte is enough."""
    assert known(fresh)
    with sqlite3.connect(made) as db:
        db.execute("INSERT OR IGNORE INTO document VALUES (?, ?)", (document, b""))
        db.execute("UPDATE document SET content = content || ' ' WHERE name = ?", (document,))
        db.execute("UPDATE document SET content = CAST(content AS BLOB)")
    assert known(fresh) == {}


def test_of_another_simulator_nothing_is_taken_over(made, fresh, monkeypatch):
    monkeypatch.setattr(shared, "simulator", lambda: "drake 0.1, numpy 0.1")
    assert known(fresh) == {}
    monkeypatch.undo()
    assert known(fresh)
    # One that was begun with another version may hold tests of that one.
    with sqlite3.connect(made) as db:
        data = json.dumps(
            {"pid": 1, "jobs": 1, "version": "0", "simulator": "drake 0.1, numpy 0.1"}
        )
        db.execute("INSERT INTO event (time, kind, data) VALUES (0, 'engine_started', ?)", (data,))
    assert known(fresh) == {}


def test_no_other_run_takes_what_was_ended_early(tmp_path):
    """All that can be cut is: only the baseline, what was accepted and what confirms are known in
    full.
    """
    oracle = needs("wall", "beam")
    cut = {"cut": lambda keep, seed: "similar" if {"wall", "beam"} <= keep else "other"}
    first = drive(new_run(tmp_path, early_stop=True, **METHOD), FakePool(oracle, 1, **cut))
    path = new_run(tmp_path, early_stop=True, **METHOD)
    whole, left = frozenset(first.elements), frozenset(first.environment)
    accepted = {frozenset(node.environment) for node in first.nodes}
    assert {models for models, _ in known(path)} == {
        whole,
        left,
        left - {"wall"},
        left - {"beam"},
    } | accepted
    assert not any(place.test.cut for place in known(path).values())
    state = share(path, pool := FakePool(oracle, 1, **cut))
    assert state.minimal and set(state.environment) == left
    assert len(pool.made) == first.cut_tests - len(first.nodes) + 1 == state.cut_tests > 0


def test_broken_tests_are_made_again(tmp_path):
    def breaks(keep, seed):
        return "error" if len(keep) == 3 else needs("wall")(keep, seed)

    broken = drive(path := new_run(tmp_path, algorithm="ddmin"), FakePool(breaks, 1))
    assert broken.tally["error"]
    # Some break after they have moved.
    with sqlite3.connect(path) as db:
        for test in broken.tests:
            db.execute(
                "INSERT OR IGNORE INTO motion SELECT ?, model, samples FROM motion WHERE test = 1",
                (test.id,),
            )
    found = known(path := new_run(tmp_path, algorithm="ddmin"))
    assert {place.test.outcome for place in found.values()} == {"pass", "similar"}
    share(path, pool := FakePool(needs("wall"), 1), found)
    assert any(len(keep) == 3 for keep, _ in pool.made)


def test_what_went_missing_meanwhile_is_made(made, fresh):
    found = known(fresh)
    with sqlite3.connect(made) as db:
        db.execute("DELETE FROM motion WHERE test = 1")
        db.execute("UPDATE motion SET samples = x'00' WHERE test = 2")
    state = share(fresh, pool := FakePool(needs("wall", "beam"), 1), found)
    assert len(pool.made) == 2 and state.minimal
    assert [test.taken for test in state.tests[:4]] == [False, False, True, True]


DAMAGED = {
    "no run file": None,
    "no events": "DELETE FROM event",
    "no JSON": "UPDATE event SET data = 'x' WHERE kind = 'test_finished'",
    "no robot": (
        "UPDATE event SET data = json_set(data, '$.scenario.robot', json('null')) WHERE kind = "
        "'created'"
    ),
    "no scenario": "UPDATE event SET data = json_set(data, '$.scenario', 3) WHERE kind = 'created'",
    "no elements": "UPDATE event SET data = json_remove(data, '$.elements') WHERE kind = 'created'",
    "no such test": "UPDATE event SET data = json_set(data, '$.test', 99) WHERE kind = 'test_finished'",
}


@pytest.mark.parametrize("damage", DAMAGED.values(), ids=DAMAGED.keys())
def test_what_cannot_be_read_is_of_no_use_and_does_no_harm(made, fresh, damage):
    if damage is None:
        made.write_text("no run file")
    else:
        with sqlite3.connect(made) as db:
            db.execute(damage)
    assert known(fresh) == {}
