"""What the setup screen says of input that is wrong, strange or too large; and its baseline."""

import fake_run
import pytest
from textual import events
from textual.widgets import Input

from ddenv.runfile.store import RunFile
from ddenv.runs.engine_job import Reduce
from tests.tiers import slow
from tests.waiting import eventually
from tests.workbench.setup.setup_session import Opened, write_scenario

GROUND_ONLY = '<sdf version="1.9"><world name="w">{}</world></sdf>'
STRANGE = "[bold]x[/] \x1b[31m\u202eסוף" + "m" * 300


@pytest.mark.screens
async def test_the_baseline_pauses_after_itself(scenarios, runs, started):
    async with Opened() as session:
        session.fill(jobs="3")
        await session.press("f6")
        assert session.wrong_or_run() == "crates-1"
        assert started == [("crates-1.ddenv", fake_run.attended(3), Reduce())]
        with RunFile(runs / "crates-1.ddenv") as run:
            assert [(command.kind, command.data) for command in run.commands()] == [
                ("step", {"unit": "round"})
            ]


@pytest.mark.screens
@pytest.mark.parametrize(
    ("models", "told"),
    [
        ("", "None of its models can be removed"),
        (fake_run.box("one", 3, 3), "1 model: a run can only show whether the failure needs it"),
    ],
    ids=["none", "one"],
)
async def test_worlds_with_little_in_them(scenarios, runs, started, models, told):
    write_scenario(scenarios, protected=())
    (scenarios / "crates.sdf").write_text(GROUND_ONLY.format(fake_run.GROUND + models))
    async with Opened() as session:
        assert session.told("about").startswith(told)
        await session.press("ctrl+s")
        assert (
            session.wrong_or_run() == "crates-1"
            if models
            else "has no model that can be removed" in session.wrong()
        )
        assert len(started) == bool(models)


@pytest.mark.screens
async def test_a_folder_that_cannot_be_written_is_told_in_one_line(
    scenarios, tmp_path, monkeypatch, started
):
    (tmp_path / "file").touch()
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "file"))
    async with Opened() as session:
        await session.press("ctrl+s")
        assert "cannot be written: Not a directory" in session.wrong()
        session.fill(epsilon="0.5")
        await session.press("ctrl+s")
        assert "cannot be written" in session.wrong()
        assert started == []


async def test_strange_names_are_shown_as_text_and_steer_nothing(scenarios, runs, started):
    write_scenario(scenarios, name="[red]" + "ß" * 70, description=STRANGE)
    (scenarios / "crates.sdf").write_bytes(
        fake_run.world_text([STRANGE.replace("\x1b", "").strip("[]"), "b"])
    )
    async with Opened((80, 24)) as session:
        assert "[bold]x[/] �[31m" in session.screen.preview.choice.about
        assert str(session.screen.query_one("#preview").border_title).startswith("\\[red]ß")
        await session.press("ctrl+s")
        assert session.wrong_or_run().startswith("-red-ß")


NAMES = (
    ("x" * 300, "cannot be written"),
    ("a\0b", "is not a valid file name"),
    (".hidden", "is not a valid file name"),
    ("no/such", ""),
    ("crates-1", "exists already"),
)


@pytest.mark.screens
async def test_names_that_cannot_be_files_are_told(scenarios, run, started):
    async with Opened() as session:
        for name, words in NAMES:
            # A NUL can be pasted, though not typed.
            field = session.screen.query_one("#run_name", Input)
            field.value = name
            await session.press("ctrl+s")
            assert words in session.wrong(), name
            assert session.app.focused is field
        assert started == []


@pytest.mark.parametrize(
    "size", slow(pytest.mark.screens, [(20, 5), (63, 40), (200, 17)], but=[(63, 40)]), ids=str
)
async def test_a_terminal_that_is_too_small_is_told_what_is_needed(scenarios, size):
    async with Opened(size) as session:
        assert (
            session.told("small") == f"ddenv needs 64 x 18; this terminal has {size[0]} x {size[1]}"
        )
        await eventually(lambda: session.screen.query_one("#small").region.size == size)
        await session.pilot.resize_terminal(120, 36)
        await session.pilot.pause()
        assert not session.screen.query_one("#small").display
        assert session.screen.query_one("#map").size.height > 10


async def test_what_is_typed_right_after_tab_goes_to_the_next_field(scenarios):
    async with Opened() as session:
        session.screen.query_one("#epsilon", Input).focus()
        await session.pilot.pause()
        before = session.value("epsilon")
        # At once, as they come from a busy terminal.
        for key, character in (
            ("tab", None),
            ("3", "3"),
            ("tab", None),
            ("minus", "-"),
            ("1", "1"),
        ):
            session.app.post_message(events.Key(key, character))
        await session.settle()
        assert [session.value(id) for id in ("epsilon", "jobs", "spawn_x")] == [before, "3", "-1"]


NUMBERS = {
    "spawn_x": "-0.56",
    "spawn_y": "6.75",
    "yaw": "-1.571",
    "goal_x": "-12.05",
    "goal_y": "-104.5",
}


def shown(session, id):
    """What stands in a field."""
    return session.screen.query_one(f"#{id}").render_line(0).text.rstrip()


@pytest.mark.screens
@pytest.mark.parametrize("size", [(64, 18), (80, 24), (120, 36)], ids=str)
async def test_numbers_begin_with_their_sign(scenarios, size):
    own = fake_run.scenario()
    own["robot"]["spawn"] |= {"x": -0.56, "y": 6.75, "yaw": -1.571}
    own["goal"] = {"x": -12.05, "y": -104.5}
    write_scenario(scenarios, **own)
    async with Opened(size) as session:
        await session.press("f4")
        assert {id: shown(session, id) for id in NUMBERS} == NUMBERS
        for id in NUMBERS:
            session.screen.query_one(f"#{id}").focus()
            await session.pilot.pause()
            assert shown(session, id) == NUMBERS[id]


@pytest.mark.screens
async def test_a_number_that_does_not_fit_says_so_and_is_replaced_by_typing(scenarios):
    async with Opened() as session:
        await session.press("f4")
        await session.filled(spawn_x="-0.78539816339")
        assert shown(session, "spawn_x").startswith("-0.78") and shown(session, "spawn_x").endswith(
            "…"
        )
        session.screen.query_one("#spawn_x").focus()
        await session.pilot.pause()
        assert shown(session, "spawn_x").startswith("-0.78")
        await session.press("minus", "7")
        assert session.value("spawn_x") == "-7"
