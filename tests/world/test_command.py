"""The command: its words and placeholders, and what is told before anything runs."""

import pytest

from ddenv.errors import UserError
from ddenv.runs.creation import create_run
from ddenv.world.command import command_words, filled, has_placeholder
from ddenv.world.scenario import Oracle
from tests.wall import wall


@pytest.fixture
def words(tmp_path):
    (tmp_path / "run.sh").write_text("#!/bin/sh\n")
    (tmp_path / "run.sh").chmod(0o755)
    (tmp_path / "plain.sh").write_text("#!/bin/sh\n")
    return lambda command: command_words(wall(folder=tmp_path, oracle=Oracle(command=command)))


def test_words_are_split_as_a_shell_does_and_placeholders_filled(words, tmp_path):
    found = words("./run.sh --world={world} '{seed} seeds' ; rm $HOME '{\"a\": 1}'")
    assert found[0] == str(tmp_path / "run.sh")
    values = {"world": "/a {seed}.sdf", "seed": "7", "log": "/l"}
    assert filled(found, values)[1:] == [
        "--world=/a {seed}.sdf",
        "7 seeds",
        ";",
        "rm",
        "$HOME",
        '{"a": 1}',
    ]
    assert has_placeholder(found, "seed")
    assert not has_placeholder(found, "log")
    assert words("sh -c true")[0].startswith("/")


@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        (
            "./run.sh {wrld}",
            r"unknown placeholder \{wrld\} \(did you mean world\?\); use \{world\}, \{scenario\}, ",
        ),
        ("./run.sh ${HOME}", r"unknown placeholder \{HOME\}"),
        ("./run.sh 'a", "no closing quotation"),
        (" ", "names no program"),
        ("'' x", "names no program"),
        ("no-such-program-of-ours", "no program 'no-such-program-of-ours' on PATH$"),
        ("run.sh", "no program 'run.sh' on PATH; there is one in .*: write ./run.sh"),
        ("./missing.sh", "missing.sh: no such file"),
        ("./plain.sh", "plain.sh: is not executable; use 'chmod [+]x'"),
        ("/tmp/", "is a folder"),
        ("./run.sh a\0b", "NUL"),
        ("./" + "x" * 5000, "File name too long"),
        ("{world}", "no program '{world}' on PATH"),
    ],
)
def test_what_cannot_start_is_told_in_one_line(words, command, complaint):
    with pytest.raises(UserError, match=f"^oracle.command: .*{complaint}"):
        words(command)


SCRIPTS = {
    b"echo hi\n": "''",
    b"": "''",
    b"#!/bin/sh\r\n": r"'/bin/sh\\r'",
    b"#! /no/such/python -u\n": "'/no/such/python'",
}


@pytest.mark.parametrize(("content", "interpreter"), SCRIPTS.items())
def test_a_script_that_the_system_cannot_start_is_told(words, tmp_path, content, interpreter):
    (tmp_path / "run.sh").write_bytes(content)
    with pytest.raises(
        UserError,
        match=f"^oracle.command: .*run.sh:1: there is no interpreter {interpreter}; its first ",
    ):
        words("./run.sh")


@pytest.mark.parametrize("content", [b"\x7fELF\0\0", b"#! /bin/sh -e\n"])
def test_other_programs_may_start(words, tmp_path, content):
    (tmp_path / "run.sh").write_bytes(content)
    assert words("./run.sh")


def test_a_folder_that_is_not_there_is_told(tmp_path):
    gone = wall(oracle=Oracle(command="sh"), folder=tmp_path / "gone")
    with pytest.raises(UserError, match=r"^folder: there is no folder .*gone to start"):
        command_words(gone)


def test_the_module_of_a_simulator_in_python_has_to_be_there_and_is_not_imported(tmp_path):
    (tmp_path / "mine.py").write_text("raise SystemExit('imported')")
    (tmp_path / "native.cpython-311-x86_64-linux-gnu.so").write_bytes(b"")
    for use in ("mine:Mine", "native:Mine", "json.decoder:Any"):
        assert command_words(wall(folder=tmp_path, oracle=Oracle(use=use))) == ()
    run = tmp_path / "run.ddenv"
    for oracle, said in (
        (
            Oracle(use="mime:Mine"),
            rf"module 'mime' in {tmp_path}, nor installed \(did you mean mine\?\)$",
        ),
        (Oracle(use=".mine:Mine"), r"module '\.mine' in "),
        (Oracle(use="mine:Mine", folder=tmp_path / "no"), f"folder {tmp_path}/no to start the "),
    ):
        with pytest.raises(UserError, match=rf"^oracle\.(use|folder): there is no {said}"):
            create_run(wall(folder=tmp_path, oracle=oracle), run)
        assert not run.exists()
