"""The setup screen: its layout, the input that it accepts or refuses, and the run that it
starts.
"""

import fake_moments
import fake_run
import pytest
from textual.widgets import Button, Input, OptionList, Select, Static

from ddenv.runs.engine_job import Reduce
from ddenv.schemas import names
from ddenv.words.methods import KINDS
from ddenv.workbench.help.shortcuts import Help
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.run_screen import RunScreen
from tests.tiers import slow
from tests.workbench.setup.setup_session import Opened, write_scenario


async def test_the_first_scenario_is_previewed_with_its_settings(scenarios):
    async with Opened() as session:
        assert session.screen.query_one(WorldMap).place.goal == (6.0, 0.0)
        assert (
            "11 models. A robot drives" in session.screen.query_one("#about", Static).render().plain
        )
        settings = {"iterations": "3", "timeout": "45", "epsilon": "0.33", "seed": "0", "jobs": "4"}
        assert {id: session.value(id) for id in settings} == settings
        assert session.value("run_name") == "crates-1"
        assert session.method() == ["ddenv", "model2model", "failure-proximal"]


async def test_start_writes_the_run_and_attaches_to_it(scenarios, runs, started):
    write_scenario(scenarios, reduction={"early_stop": False})
    async with Opened() as session:
        await session.press("f9")
        session.fill(iterations="5", seed="7", jobs="3", accept="ask")
        session.fill(**dict(zip(KINDS, ("splitting", "timeseg", "timestep"), strict=True)))
        await session.press("f5")
        assert started == [("crates-1.ddenv", fake_run.attended(3, "ask"), Reduce())]
        assert isinstance(session.app.screen, RunScreen)
        assert (runs / "crates-1.ddenv").is_file()
        reduction = session.made().reduction
        assert (reduction.iterations, reduction.seed) == (5, 7)
        assert (reduction.algorithm, reduction.pair) == ("splitting", "timeseg/timestep")
        # What the form does not have comes from the scenario.
        assert not reduction.early_stop


@pytest.mark.screens
async def test_rarely_used_settings_are_opened_and_closed(scenarios):
    async with Opened() as session:
        more = session.screen.query_one("#more")
        assert "baseline runs" in str(more.label)
        more.focus()
        await session.press("enter")
        advanced = session.screen.query_one("#advanced")
        assert advanced.display
        assert session.value("as_printed") == "off"
        await session.press("f9")
        assert not advanced.display
        session.fill(baseline_runs="0")
        await session.press("ctrl+s")
        assert "baseline runs: expected 1 to 1000, found 0" in session.wrong()
        assert advanced.display
        assert session.app.focused.id == "baseline_runs"


PANES = {"f2": ("#choice", "#preview"), "f3": ("#preview",), "f4": ("#fields", "#explained")}


@pytest.mark.parametrize(
    "size", slow(pytest.mark.screens, [(64, 18), (109, 40), (120, 30)], but=[(64, 18)]), ids=str
)
async def test_small_terminals_show_one_pane_at_a_time(scenarios, size):
    async with Opened(size) as session:
        for key, shown in PANES.items():
            await session.press(key)
            for id in ("#choice", "#preview", "#fields", "#explained"):
                assert bool(session.screen.query_one(id).region) == (id in shown), (key, id)
            assert session.told("cost")
        await session.press("escape")
        assert session.app.focused.id == "scenario-list"
        await session.pilot.click("#pane-map")
        await session.pilot.pause()
        assert session.app.focused.id == "map"
        session.fill(epsilon="0")
        await session.press("ctrl+s")
        assert session.app.focused.id == "epsilon"


@pytest.mark.screens
@pytest.mark.parametrize("size", [(64, 18), (80, 24), (120, 36), (200, 60)], ids=str)
async def test_every_name_and_the_start_button_are_whole_at_every_size(scenarios, size):
    async with Opened(size) as session:
        for key in ("f2", "f4", "f9"):
            if key != "f9" or not session.screen.query("#advanced"):
                await session.press(key)
            start = session.screen.query_one("#start")
            assert start.region.width == 11
            assert session.screen.region.contains_region(start.region)
            assert session.screen.query_one("#options").content_region.contains_region(start.region)
        for select in session.screen.query(Select):
            widest = max(len(str(prompt)) for prompt, _ in select._options)
            assert select.query_one("#label").size.width >= widest, select.id


@pytest.mark.screens
async def test_an_open_list_shows_all_its_names(scenarios):
    async with Opened((64, 18)) as session:
        await session.press("enter", "tab", "tab", "enter")
        region = session.app.focused.region
        assert region.height == len(names("prioritization"))
        assert session.screen.region.contains_region(region)


# One of each kind; `tests/test_settings.py` has the range of every setting.
WRONG = (
    ("iterations", "three", "iterations: expected a whole number, found 'three'"),
    ("timeout", "", "timeout s: missing"),
    ("yaw", "-inf", "yaw rad: expected -1000 to 1000, found -inf"),
    ("jobs", "0", "jobs: expected 1 to 1024, found 0"),
    ("run_name", " ", "run name: missing"),
)


async def test_an_error_is_shown_beside_the_field_and_nothing_is_written(scenarios, runs, started):
    async with Opened() as session:
        for field, text, words in WRONG:
            right = session.value(field)
            session.fill(**{field: text})
            await session.press("ctrl+s")
            assert words in session.wrong()
            assert session.screen.query_one(f"#{field}", Input).has_class("-wrong")
            assert session.app.focused.id == field
            assert started == []
            assert list(runs.iterdir()) == []
            await session.filled(**{field: right})
            assert not session.screen.query_one(f"#{field}", Input).has_class("-wrong")
            assert session.wrong() == ""
        await session.press("ctrl+s")
        assert len(started) == 1


async def test_all_wrong_fields_are_named_and_the_first_one_gets_the_cursor(scenarios, started):
    async with Opened() as session:
        session.fill(iterations="three", goal_x="", goal_y="")
        await session.press("ctrl+s")
        missing = "goal x m, goal y m: missing; press g for the goal, on the map"
        assert session.wrong() == f"✗ iterations: expected a whole number, found 'three'; {missing}"
        assert session.told("cost").endswith(missing)
        assert session.app.focused.id == "iterations"
        for field in ("iterations", "goal_x", "goal_y"):
            assert session.screen.query_one(f"#{field}", Input).has_class("-wrong")
        await session.filled(iterations="3")
        assert session.wrong() == f"✗ {missing}"


async def test_a_field_is_checked_when_it_is_left_and_its_error_goes_when_it_is_right(scenarios):
    async with Opened() as session:
        await session.press("f4")
        timeout = session.screen.query_one("#timeout", Input)
        timeout.focus()
        await session.press("minus")
        assert session.wrong() == "" and not timeout.has_class("-wrong")
        await session.press("3", "tab")
        assert session.wrong() == "✗ timeout s: expected 0.01 to 100000, found -3"
        # The error is next to the fields, above all that does not belong to them.
        assert (
            session.screen.query_one("#wrong").region.y
            == session.screen.query_one("#fields").region.bottom
        )
        timeout.focus()
        await session.press("3", "0")
        assert session.wrong() == "" and not timeout.has_class("-wrong")


@pytest.mark.screens
async def test_a_robot_inside_a_model_is_an_error_of_the_whole_spawn(scenarios, started):
    async with Opened() as session:
        session.fill(spawn_z="-3")
        await session.press("ctrl+s")
        assert session.wrong().startswith("✗ spawn (-6, 0, -3): the robot stands inside")
        await session.filled(spawn_z="0.2")
        assert session.wrong() == ""
        session.screen.query_one("#start", Button).press()
        await session.pilot.pause()
        await session.settle()
        assert len(started) == 1


async def test_a_world_that_cannot_be_read_leaves_nothing_of_the_one_before(scenarios):
    broken = scenarios / "broken.sdf"
    broken.write_text("<sdf version='1.6'><model/></sdf>")
    async with Opened((80, 24)) as session:
        assert session.value("spawn_x") and session.told("about")
        await session.open(broken)
        assert "found no <world>" in session.screen.query_one(WorldMap).notice
        assert [session.value(id) for id in ("spawn_x", "goal_y", "run_name")] == ["", "", ""]
        assert [session.told(id) for id in ("about", "picking", "command")] == ["", "", ""]
        assert session.told("cost") == "not ready: choose a scenario or a world that can be read"
        await session.open(scenarios / "crates.yaml")
        assert session.value("spawn_x") and session.value("run_name") == "crates-1"


@pytest.mark.screens
async def test_recent_runs_are_listed_and_opened(scenarios, runs):
    fake_moments.finished(fake_run.FakeRun(runs / "old.ddenv")).close()
    (runs / "bad.ddenv").write_text("no run")
    async with Opened() as session:
        options = session.screen.query_one("#run-list", OptionList)
        assert {option.id for option in options.options} == {
            str(path) for path in runs.glob("*.ddenv")
        }
        options.focus()
        options.highlighted = options.get_option_index(str(runs / "bad.ddenv"))
        await session.press("enter")
        assert any(
            "is not a ddenv run file" in notice.message for notice in session.app._notifications
        )
        options.highlighted = options.get_option_index(str(runs / "old.ddenv"))
        await session.pilot.press("enter")
        await session.pilot.pause()
        assert isinstance(session.app.screen, RunScreen)
        assert session.app.screen.run == runs / "old.ddenv"
        await session.app.workers.wait_for_complete()


@pytest.mark.screens
async def test_letters_are_typed_into_fields_and_help_and_quit_elsewhere(scenarios):
    async with Opened() as session:
        field = session.screen.query_one("#run_name", Input)
        field.focus()
        field.value = ""
        await session.press("q", "question_mark", "s", "g", "h", "0", "minus")
        assert field.value == "q?sgh0-" and session.screen.preview.picked_next == ""
        await session.press("f1")
        assert isinstance(session.app.screen, Help)
        await session.press("escape", "f2", "q")
        assert session.app._exit
