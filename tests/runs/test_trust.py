"""What starts programs runs only if the user trusts it."""

import json
import os

import pytest
import yaml

from ddenv.errors import UserError
from ddenv.runfile.events import EngineStarted
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.export import export_world
from ddenv.runs.trust import check_trusted, program_of, trust, trust_own
from ddenv.workbench.setup.files import save_scenario
from ddenv.world.load import load_scenario
from tests.conftest import DATA
from tests.tiers import slow

HUSKY = DATA.parents[1] / "sdf" / "robots" / "husky.sdf"
CONTROLLER = "import pathlib\n\npathlib.Path({mark!r}).touch()\n\n\nclass Mine:\n    pass\n"
BRINGS = {
    "command": {"oracle": {"command": "./sim.sh {world}"}},
    "controller": {"controller": {"use": "mine:Mine"}},
    "simulator": {"oracle": {"use": "mine:Mine"}},
    "package": {"controller": {"use": "whole.part:Mine"}},
    "installed": {"controller": {"use": "subprocess:Popen"}},
}


@pytest.fixture
def scenario(home):
    """Writes a scenario in a folder of the user's own; whatever of it starts leaves
    `home/started`.
    """
    folder = home / "own"
    folder.mkdir()
    (folder / "sim.sh").write_text(f"#!/bin/sh\ntouch {home / 'started'}\nexit 1\n")
    (folder / "sim.sh").chmod(0o755)
    (folder / "whole").mkdir()
    for file in (folder / "mine.py", folder / "whole" / "part.py"):
        file.write_text(CONTROLLER.format(mark=str(home / "started")))

    def written(brings):
        data = yaml.safe_load((DATA / "wall.yaml").read_text()) | brings
        data["world"], data["robot"]["model"] = str(DATA / "wall.sdf"), str(HUSKY)
        (folder / "s.yaml").write_text(yaml.safe_dump(data))
        return folder / "s.yaml"

    return written


@pytest.mark.parametrize("brings", BRINGS.values(), ids=BRINGS)
def test_what_is_brought_along_is_trusted_as_it_is(scenario, brings):
    loaded = load_scenario(scenario(brings))
    with pytest.raises(
        UserError,
        match=r"mail\.ddenv: would start the (command|controller|simulator) .* give --trust",
    ):
        check_trusted(loaded, "mail.ddenv")
    trust(program_of(loaded))
    check_trusted(loaded, "mail.ddenv")


def test_what_cannot_be_remembered_is_trusted_all_the_same(scenario, home, monkeypatch):
    loaded = load_scenario(scenario(BRINGS["command"]))
    (home / "file").touch()
    monkeypatch.setenv("DDENV_HOME", str(home / "file" / "no folder"))
    # Put back at the end.
    monkeypatch.setenv("DDENV_TRUSTED", "")
    trust_own(loaded, home / "own" / "s.yaml")
    check_trusted(loaded, "s.yaml")
    monkeypatch.setenv("DDENV_TRUSTED", "")
    with pytest.raises(UserError, match="give --trust"):
        check_trusted(loaded, "s.yaml")


def test_a_run_file_with_the_name_of_the_module_changes_nothing(scenario):
    loaded = load_scenario(scenario(BRINGS["simulator"]))
    trust(program_of(loaded))
    (loaded.folder / "mine.ddenv").write_text("a run")
    check_trusted(loaded, "mine.ddenv")


# A program that has changed, and what Python would import first in its place.
CHANGED = (
    ("command", "sim.sh"),
    ("controller", "mine.py"),
    ("simulator", "mine.py"),
    ("package", "whole/part.py"),
    ("controller", "mine/__init__.py"),
    ("controller", "mine.cpython-311-x86_64-linux-gnu.so"),
)


@pytest.mark.parametrize(("brings", "file"), CHANGED)
def test_another_program_is_not_what_was_trusted(scenario, brings, file):
    path = scenario(BRINGS[brings])
    trust(program_of(load_scenario(path)))
    changed = path.parent / file
    changed.parent.mkdir(exist_ok=True)
    changed.write_text("class Mine: ...")
    with pytest.raises(UserError):
        check_trusted(load_scenario(path), path)


def test_what_ddenv_brings_needs_no_trust():
    assert program_of(load_scenario(DATA / "wall.yaml")) is None


def test_a_file_of_the_users_own_is_trusted_and_one_that_others_can_write_is_not(scenario):
    path = scenario(BRINGS["controller"])
    path.chmod(0o666)
    trust_own(load_scenario(path), path)
    with pytest.raises(UserError):
        check_trusted(load_scenario(path), path)
    path.chmod(0o644)
    trust_own(load_scenario(path), path)
    check_trusted(load_scenario(path), path)


def test_a_scenario_that_ddenv_wrote_of_a_run_is_asked_about(scenario, home):
    run, written, saved = (
        home / "own" / name for name in ("mail.ddenv", "minimal.yaml", "saved.yaml")
    )
    loaded = load_scenario(scenario(BRINGS["command"]))
    create_run(loaded, run)
    with RunFile(run) as file:
        file.append(EngineStarted(pid=1, jobs=1, version="0.1.0", simulator="none"))
    export_world(run, written.with_suffix(".sdf"), written)
    save_scenario(loaded, saved)
    for path in (written, saved):
        trust_own(load_scenario(path), path)
        with pytest.raises(UserError, match="would start the command"):
            check_trusted(load_scenario(path), path)


@pytest.mark.parametrize("damage", ["{", "[1, {}]", '{"a": 1}', ""])
def test_damaged_memory_trusts_nothing(scenario, home, damage):
    loaded = load_scenario(scenario(BRINGS["command"]))
    (home / "trusted.json").write_text(damage)
    with pytest.raises(UserError):
        check_trusted(loaded, "a run")


COMMANDS = {
    "resume": ["resume", "RUN"],
    "resume again": ["resume", "RUN", "--again"],
    "test": ["test", "RUN"],
    "certify": ["certify", "RUN"],
    "isolate": ["isolate", "RUN"],
}


@pytest.mark.parametrize("words", slow(pytest.mark.programs, COMMANDS, but=["resume", "test"]))
@pytest.mark.parametrize("brings", ["command", "controller"])
def test_a_mailed_run_starts_nothing(scenario, home, words, brings, command):
    from tests.command import is_one_line

    run = home / "mail.ddenv"
    create_run(load_scenario(scenario(BRINGS[brings])), run)
    done = command(*[str(run) if word == "RUN" else word for word in COMMANDS[words]])
    is_one_line(done, "mail.ddenv", "--trust")
    assert not (home / "started").exists()


@pytest.mark.programs
@pytest.mark.parametrize("brings", ["command", "controller"])
def test_no_engine_starts_it_either(scenario, home, brings):
    from ddenv.runs.engine_job import EngineOptions
    from ddenv.runs.programs import last_words, start_engine

    run = home / "mail.ddenv"
    create_run(load_scenario(scenario(BRINGS[brings])), run)
    assert start_engine(run, EngineOptions(jobs=1)).wait(60) == 2
    assert "would start the" in last_words(run)
    assert not (home / "started").exists()


@pytest.mark.programs
@pytest.mark.parametrize("mailed", [True, False], ids=["mailed", "own"])
def test_what_the_user_trusts_or_owns_starts_and_is_not_asked_about_again(scenario, home, mailed):
    from tests.command import ddenv

    subject, trusted, env = scenario(BRINGS["command"]), [], os.environ | {"DDENV_HOME": str(home)}
    if mailed:
        create_run(load_scenario(subject), home / "mail.ddenv")
        subject, trusted = home / "mail.ddenv", ["--trust"]
    for words in (trusted, []):
        done = ddenv("test", subject, "--json", *words, env=env)
        # The program that was started is no simulator: its run broke.
        assert done.returncode == 1, done.stderr
        assert len(json.loads(done.stdout)["runs"]) == 1
    assert (home / "started").exists()
