"""What the shell completes after a tab."""

import pytest
from click.shell_completion import BashComplete

from ddenv.cli.command_line import app


@pytest.fixture
def completes(home, tmp_path, monkeypatch):
    (home / "runs").mkdir()
    (home / "runs" / "friction-1.ddenv").touch()
    folder = tmp_path / "worlds"
    folder.mkdir()
    for name in ("frame.world", "fresh.txt"):
        (folder / name).touch()
    monkeypatch.chdir(folder)

    def of(*words):
        *before, begun = words
        return [
            (each.type, each.value)
            for each in BashComplete(app, {}, "ddenv", "_").get_completions(before, begun)
        ]

    return of


def test_after_the_program_commands_runs_scenarios_and_files(completes):
    assert completes("fr") == [
        ("plain", name) for name in ("frame.world", "friction", "friction-1")
    ]
    assert completes("/etc/pass") == [("file", "/etc/pass")]
    assert ("plain", "export") in completes("ex") and ("file", "ex") not in completes("ex")
    assert ("plain", "--version") in completes("--v")


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["run", "fri"], ["friction"]),
        (["run", "fra"], ["frame.world"]),
        (["export", ""], ["friction-1"]),
        (["open", "fri"], ["friction", "friction-1"]),
        (["world", "check", "fri"], ["friction"]),
    ],
)
def test_after_a_command_what_it_takes(completes, words, found):
    assert completes(*words) == [("plain", name) for name in found]


def test_after_what_is_opened_the_options_of_that(completes):
    assert completes("friction-1", "--w") == [("plain", "--watch")]
    assert completes("friction-1", "") == []
