"""The file with a user's keys and theme: what it can say, and that an error in it is reported
in one line.
"""

import subprocess
import sys

import pytest
import yaml
from click.testing import CliRunner
from rich.style import Style
from textual.app import App
from textual.color import Color

from ddenv.cli.command_line import app as command_line
from ddenv.errors import UserError
from ddenv.workbench.app import Config
from ddenv.workbench.config import actions, checked, config_path, read_config
from ddenv.workbench.help.key_names import shown_key, written
from ddenv.workbench.terminal.themes import ANSI, DARK, LIGHT, OURS, fitting, for_rich
from tests.waiting import PATIENCE


@pytest.fixture
def config(tmp_path, monkeypatch):
    """Writes the file."""
    path = tmp_path / "config.yaml"
    monkeypatch.setenv("DDENV_CONFIG", str(path))

    def write(text):
        path.write_text(text)
        return path

    return write


def test_without_a_file_or_with_one_that_says_nothing_all_is_as_it_comes(tmp_path, monkeypatch):
    monkeypatch.delenv("DDENV_CONFIG", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert config_path() == tmp_path / "ddenv" / "config.yaml"
    assert read_config() == Config()
    config_path().parent.mkdir()
    for text in ("", "# nothing\n", "keys:\n  # run.pause: p\n", "theme:\n"):
        config_path().write_text(text)
        assert read_config() == Config()


def test_a_file_sets_theme_and_keys(config):
    config(
        "theme: ansi-dark\nnotify: no\nkeys: {run.pause: f8, map.left: 'h, ctrl+k', run.step: 7}"
    )
    assert read_config() == Config(
        ANSI, {"run.pause": "f8", "map.left": "h,ctrl+k", "run.step": "7"}, False
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("them: ddenv", "them: unknown key (did you mean theme?)"),
        ("theme: ddenv-ligt", "did you mean ddenv-light?"),
        ("theme: 7", "there is no theme '7'"),
        ("keys: {run.puse: p}", "no action 'run.puse' (did you mean run.pause?)"),
        ("keys: {run.pause: foo}", "run.pause: there is no key 'foo'"),
        ("keys: {run.pause: ctrl+i}", "terminals send the same for ctrl+i and tab"),
        ("keys: {run.pause: [p]}", "keys.run.pause: should be a valid string"),
        ("keys: {run.pause: true}", "keys.run.pause: should be a valid string"),
        ("keys: {run.pause: s}", "run.pause: 's' is the key of run.step already"),
        ("keys: {run.pause: z, run.step: z}", "'z' is the key of run.step already"),
        ("keys: {run.pause: ctrl+q}", "'ctrl+q' is the key of app.leave already"),
        ("keys: [run.pause]", "keys: should be a valid dictionary"),
        ("keys: {run.pause: ?}", "not valid YAML"),
        ("theme: 2024-13-45", "not valid YAML"),
        ("notify: maybe", "notify: should be a valid boolean"),
        ("- theme", "expected lines such as"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(config, text, told):
    path = config(text)
    with pytest.raises(UserError) as error:
        read_config()
    assert str(error.value).startswith(f"{path}:")
    assert told in str(error.value)


@pytest.mark.programs
def test_a_wrong_file_ends_the_program_before_the_screen(config, runs):
    path = config("keys: {run.puse: p}")
    done = subprocess.run(
        [sys.executable, "-m", "ddenv"], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"ddenv: {path}: keys: ") and done.stderr.count("\n") == 1


def test_all_keys_can_be_written_as_they_are_told():
    for id, action in actions().items():
        assert action.words, id
        told = ", ".join(written(key) for key in action.keys)
        assert checked({id: told}, "") == {id: ",".join(action.keys)}
    # Two actions may change their keys.
    swapped = {"run.pause": "s", "run.step": "space"}
    assert checked(swapped, "") == swapped
    assert [shown_key(key) for key in ("question_mark", "shift+left", "S")] == [
        "?",
        "shift+←",
        "shift+s",
    ]


def test_the_command_tells_all_actions_and_what_is_changed(config):
    config("keys: {run.pause: f8}")
    told = CliRunner().invoke(command_line, ["config"], standalone_mode=False).output
    assert all(id in told for id in actions())
    assert "* run.pause" in told


def test_the_example_is_a_file_that_can_be_used(config):
    example = (
        CliRunner().invoke(command_line, ["config", "--example"], standalone_mode=False).output
    )
    config(example)
    assert read_config() == Config()
    used = example.replace("\n# theme", "\ntheme").replace("\n  # ", "\n  ")
    lines = [line for line in used.splitlines() if not line.startswith("  ") or ":" in line]
    path = config("\n".join(lines))
    assert set(yaml.safe_load(path.read_text())["keys"]) == set(actions())
    assert read_config().theme == DARK.name


def contrast(text, back):
    """As WCAG 2 defines it."""

    def light(color):
        parts = [
            part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4
            for part in color.normalized
        ]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    bright, dark = sorted((light(text), light(back)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("theme", OURS, ids=lambda theme: theme.name)
def test_text_can_be_read_in_our_themes(theme):
    colors = theme.to_color_system().generate()
    names = [
        "foreground",
        "primary",
        "secondary",
        "text-primary",
        "text-error",
        "text-warning",
        "text-success",
    ]
    names += ["text-accent", "error", "warning", "success", "accent", "footer-key-foreground"]
    for ground in ("background", "surface", "panel"):
        back = Color.parse(colors[ground])
        for name in names:
            assert contrast(Color.parse(colors[name]), back) >= 4.5, (name, ground)
        muted = back.get_contrast_text(
            float(colors["text-muted"].removeprefix("auto ").rstrip("%")) / 100
        )
        assert contrast(back.blend(muted.rgb and Color(*muted.rgb), muted.a), back) >= 4.5, (
            "text-muted",
            ground,
        )
    cursor = Color.parse(colors["block-cursor-background"])
    assert contrast(cursor.get_contrast_text(), cursor) >= 4.5


async def test_a_terminal_with_sixteen_colours_keeps_its_own_which_are_told_in_richs_words():
    assert (fitting("standard"), fitting("256"), fitting("truecolor")) == (
        ANSI,
        DARK.name,
        DARK.name,
    )
    async with App().run_test() as pilot:
        pilot.app.theme = ANSI
        await pilot.pause()
        variables = for_rich(pilot.app.theme_variables)
    for name in ("primary", "text-error", "text-muted", "surface", "foreground"):
        Style.parse(f"bold {variables[name]}")
    assert LIGHT.primary == for_rich({"primary": LIGHT.primary})["primary"]
