"""The setup screen: what it accepts, what it refuses, and that it writes nothing before all fits."""

import fake_run
import pytest
import yaml
from textual.widgets import Button, Input, OptionList, Select, Static

from ddenv.schemas import explanation, names
from ddenv.workbench.help.shortcuts import Help
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.methods import KINDS
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.setup.fields import Explained
from ddenv.workbench.setup.open_file import OpenFile
from tests.tiers import slow
from tests.workbench.setup.setup_session import Opened


async def test_the_first_scenario_is_previewed_with_its_settings(scenarios):
    async with Opened() as session:
        assert session.screen.query_one(WorldMap).place.goal == (6.0, 0.0)
        assert "11 models. A robot drives" in session.screen.query_one("#about", Static).render().plain
        assert [session.value(id) for id in ("iterations", "timeout", "epsilon", "seed", "jobs")] == [
            "3",
            "45",
            "0.33",
            "0",
            "4",
        ]
        assert session.value("name") == "crates-1"
        assert session.method() == ["ddenv", "model2model", "failure-proximal"]


async def test_start_writes_the_run_and_attaches_to_it(scenarios, runs, started):
    async with Opened() as session:
        session.fill(iterations="5", seed="7", jobs="3")
        session.screen.query_one("#accept", Select).value = "ask"
        await session.press("f5")
        assert started == [("crates-1.ddenv", 3, {"accept_mode": "ask"})]
        assert isinstance(session.app.screen, RunScreen)
        assert (runs / "crates-1.ddenv").is_file()
        scenario = session.made()
        assert (scenario.reduction.iterations, scenario.reduction.seed) == (5, 7)


@pytest.mark.screens
async def test_algorithm_partitioning_and_prioritization_reach_the_run(scenarios, started):
    async with Opened() as session:
        for kind, name in zip(KINDS, ("splitting", "timeseg", "timestep"), strict=True):
            session.screen.query_one(f"#{kind}", Select).value = name
        await session.press("ctrl+s")
        assert len(started) == 1
        reduction = session.made().reduction
        assert (reduction.algorithm, reduction.pair) == ("splitting", "timeseg/timestep")


@pytest.mark.screens
async def test_a_description_that_does_not_fit_says_so(scenarios):
    own = fake_run.scenario() | {"description": "far " * 60 + "end"}
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(own))
    for size, whole in (((80, 24), False), ((200, 60), True)):
        async with Opened(size) as session:
            told = session.screen.query_one("#about", Static).render().plain
            assert told.endswith("far end" if whole else " far …")
            assert whole or len(told.splitlines()) == 2


@pytest.mark.screens
async def test_early_stop_reaches_the_run_and_comes_from_the_scenario(scenarios, started):
    own = fake_run.scenario() | {"failure": {"early_stop": True}}
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(own))
    async with Opened() as session:
        await session.press("f9")
        assert session.value("early_stop") == "on"
        session.fill(early_stop="off")
        await session.press("ctrl+s")
        assert not session.made().failure.early_stop


@pytest.mark.screens
async def test_what_is_focused_highlighted_or_changed_is_explained(scenarios):
    async with Opened() as session:
        assert session.explained() == ("algorithm ddenv", explanation("algorithm", "ddenv"))
        await session.press("enter", "tab")
        assert session.app.focused.id == "partitioning"
        assert session.explained() == ("partitioning model2model", explanation("partitioning", "model2model"))
        await session.press("enter", "down")
        assert session.explained() == ("partitioning timeseg", explanation("partitioning", "timeseg"))
        assert session.method()[1] == "model2model"
        await session.press("escape")
        assert session.explained()[0] == "partitioning model2model"
        session.screen.query_one("#prioritization", Select).value = "random"
        await session.pilot.pause()
        assert session.explained() == ("prioritization random", explanation("prioritization", "random"))


@pytest.mark.screens
async def test_another_scenario_brings_its_own_explanation(scenarios):
    other = fake_run.scenario(name="other")
    other["reduction"] |= {"algorithm": "probdd", "as_printed": True}
    (scenarios / "other.yaml").write_text(yaml.safe_dump(other))
    async with Opened() as session:
        await session.press("down")
        assert session.explained()[0] == "algorithm probdd"
        assert session.screen.form.texts["as_printed"] == "on"


@pytest.mark.screens
async def test_each_field_says_what_it_means_and_costs(scenarios):
    async with Opened() as session:
        await session.press("f9")
        for id, label in (("as_printed", "as printed"), ("goal_x", "goal x m"), ("accept", "accept")):
            session.screen.query_one(f"#{id}").focus()
            await session.pilot.pause()
            title, words = session.explained()
            assert title == label
            assert words.endswith(".")
        session.screen.query_one("#iterations").focus()
        session.fill(iterations="7")
        await session.pilot.pause()
        assert session.explained()[1].endswith("A candidate without f costs 8 tests.")


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
        assert "reduction.baseline_runs" in session.wrong()
        assert advanced.display
        assert session.app.focused.id == "baseline_runs"


UNUSED = {
    "ddenv": ([], "", ""),
    "splitting": (["partitioning"], "does not use the partitioning", "Not used: splitting"),
    "ddmin": (["partitioning", "prioritization"], "uses neither the partitioning", "Not used: ddmin"),
    "probdd": (["partitioning", "prioritization"], "uses neither the partitioning", "Not used: probdd"),
}


@pytest.mark.screens
async def test_what_the_algorithm_does_not_use_is_dimmed_and_said(scenarios):
    async with Opened() as session:
        for algorithm, (unused, words, beside) in UNUSED.items():
            session.screen.query_one("#algorithm", Select).focus()
            session.screen.query_one("#algorithm", Select).value = algorithm
            await session.pilot.pause()
            assert words in session.explained()[1]
            assert [kind for kind in KINDS if session.screen.query_one(f"#{kind}").has_class("-unused")] == unused
            session.screen.query_one("#partitioning").focus()
            await session.pilot.pause()
            assert session.explained()[1].startswith(beside or explanation("partitioning", "model2model"))


PANES = {"f2": ("#choice", "#preview"), "f3": ("#preview",), "f4": ("#fields", "#explained")}


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [(64, 18), (109, 40), (120, 30)], but=[(64, 18)]), ids=str)
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


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [(120, 36), (200, 60)], but=[(120, 36)]), ids=str)
async def test_large_terminals_show_all_with_a_map_of_decent_size(scenarios, size):
    async with Opened(size) as session:
        for id in ("#choice", "#preview", "#fields", "#explained"):
            assert session.screen.query_one(id).region
        assert session.screen.query_one(WorldMap).size.height >= size[1] * 4 // 10


@pytest.mark.parametrize(
    "size", slow(pytest.mark.screens, [(64, 18), (80, 24), (120, 36), (200, 60)], but=[(80, 24)]), ids=str
)
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


async def test_an_open_list_shows_all_its_names(scenarios):
    async with Opened((64, 18)) as session:
        await session.press("enter", "tab", "tab", "enter")
        region = session.app.focused.region
        assert region.height == len(names("prioritization"))
        assert session.screen.region.contains_region(region)


@pytest.mark.screens
async def test_a_long_explanation_scrolls(scenarios):
    async with Opened((64, 18)) as session:
        await session.press("enter", "down", "end", "enter")
        panel = session.screen.query_one(Explained)
        assert session.explained()[0] == "algorithm splitting"
        await session.press("pagedown")
        assert panel.scroll_offset.y > 0
        await session.press("pageup", "pageup")
        assert panel.scroll_offset.y == 0


@pytest.mark.screens
async def test_the_start_button_starts(scenarios, started):
    async with Opened((80, 24)) as session:
        session.screen.query_one("#start", Button).press()
        await session.pilot.pause()
        await session.settle()
        assert len(started) == 1


WRONG = (
    ("iterations", "three", "iterations: expected a whole number, found 'three'"),
    ("iterations", "-1", "iterations"),
    ("timeout", "", "timeout s: is missing"),
    ("timeout", "nan", "timeout"),
    ("epsilon", "0", "epsilon"),
    ("seed", "99999999999", "seed"),
    ("jobs", "0", "jobs: expected 1 to 1024, found 0"),
    ("name", " ", "run name: is missing"),
)


async def test_wrong_input_is_told_beside_the_field_and_nothing_is_written(scenarios, runs, started):
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
            session.fill(**{field: right})
            await session.pilot.pause()
            assert not session.screen.query_one(f"#{field}", Input).has_class("-wrong")
        await session.press("ctrl+s")
        assert len(started) == 1


@pytest.mark.screens
async def test_a_taken_name_is_refused(scenarios, run, started):
    async with Opened() as session:
        session.fill(name="crates-1")
        await session.press("ctrl+s")
        assert "exists already" in session.wrong()
        assert session.app.focused.id == "name"


@pytest.mark.screens
async def test_a_broken_scenario_is_told_in_the_preview(scenarios, started):
    (scenarios / "crates.yaml").write_text("name: x\nwrold: y\n")
    async with Opened() as session:
        assert "crates.yaml" in session.screen.query_one(WorldMap).notice
        await session.press("ctrl+s")
        assert "choose a scenario" in session.wrong()


async def test_a_bare_world_asks_for_spawn_and_goal(scenarios, runs, started):
    async with Opened() as session:
        await session.press("ctrl+o")
        assert isinstance(session.app.screen, OpenFile)
        await session.pilot.press(*"nowhere.sdf", "enter")
        assert "no such file" in session.app.screen.query_one("#wrong", Static).render().plain
        session.app.screen.query_one("#path", Input).value = str(scenarios / "crates.sdf")
        await session.pilot.press("enter")
        await session.pilot.pause()
        await session.settle()
        assert session.value("spawn_x") == ""
        assert "12 models" in session.screen.query_one("#about", Static).render().plain
        await session.press("ctrl+s")
        assert "spawn x m: is missing" in session.wrong()
        session.fill(spawn_x="-6", spawn_y="0", spawn_z="0.16", spawn_yaw="0", goal_x="6", goal_y="0")
        await session.pilot.pause()
        assert session.screen.query_one(WorldMap).place.goal == (6.0, 0.0)
        session.fill(goal_x="inf")
        await session.press("ctrl+s")
        assert "finite" in session.wrong()
        session.fill(goal_x="6", spawn_z="0.05")
        await session.press("ctrl+s")
        assert "stands inside model" in session.wrong()
        assert list(runs.iterdir()) == []
        session.fill(spawn_z="0.16")
        await session.press("ctrl+s")
        assert started == [("crates-1.ddenv", 4, {"accept_mode": "automatic"})]


@pytest.mark.screens
async def test_a_bare_world_starts_with_the_defaults_of_a_scenario(scenarios, started):
    own = {
        "failure": {"timeout": 12, "epsilon": 0.25},
        "reduction": {"iterations": 9, "baseline_runs": 5, "seed": 4, "pair": "timeseg/random", "algorithm": "ddmin"},
    }
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(fake_run.scenario() | own))
    fields = ("timeout", "epsilon", "iterations", "baseline_runs", "seed")
    async with Opened() as session:
        assert [session.value(id) for id in fields] == ["12", "0.25", "9", "5", "4"]
        assert session.method() == ["ddmin", "timeseg", "random"]
        session.fill(timeout="soon", jobs="many", seed="6")
        await session.press("ctrl+s")
        assert session.screen.query_one("#timeout", Input).has_class("-wrong")
        await session.open(scenarios / "crates.sdf")
        assert [session.value(id) for id in (*fields, "jobs")] == ["45", "0.33", "3", "10", "0", "4"]
        assert session.method() == ["ddenv", "model2model", "avg-trajectory-proximal"]
        assert not session.screen.query(".-wrong")
        assert session.wrong() == ""
        session.fill(epsilon="near", jobs="2")
        session.screen.query_one("#scenario-list", OptionList).highlighted = 0
        await session.pilot.pause()
        await session.settle()
        assert [session.value(id) for id in (*fields, "jobs")] == ["12", "0.25", "9", "5", "4", "2"]


@pytest.mark.screens
async def test_typed_places_are_marked_in_the_next_world_too(scenarios, tmp_path):
    other = tmp_path / "other.sdf"
    other.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened() as session:
        await session.open(scenarios / "crates.sdf")
        session.fill(spawn_x="-6", spawn_y="0", spawn_z="0.16", spawn_yaw="0", goal_x="6", goal_y="0")
        await session.pilot.pause()
        await session.open(other)
        assert session.screen.query_one(WorldMap).place.goal == (6.0, 0.0)


@pytest.mark.screens
async def test_the_file_dialog_can_be_cancelled_and_filters(scenarios, tmp_path, monkeypatch):
    monkeypatch.chdir(scenarios)
    (scenarios / "notes.txt").write_text("x")
    async with Opened() as session:
        await session.press("ctrl+o")
        tree = session.app.screen.query_one("#tree")
        shown = {path.name for path in tree.filter_paths(scenarios.iterdir())}
        assert shown == {"crates.yaml", "crates.sdf", "robot.sdf"}
        await session.pilot.press("escape")
        assert session.app.screen is session.screen


@pytest.mark.screens
async def test_recent_runs_are_listed_and_opened(scenarios, runs):
    fake_run.finished(fake_run.FakeRun(runs / "old.ddenv")).close()
    async with Opened() as session:
        options = session.screen.query_one("#run-list", OptionList)
        assert options.option_count == 1
        options.focus()
        await session.pilot.press("down", "enter")
        await session.pilot.pause()
        assert isinstance(session.app.screen, RunScreen)
        assert session.app.screen.run == runs / "old.ddenv"
        await session.app.workers.wait_for_complete()


@pytest.mark.screens
async def test_a_damaged_run_is_not_opened(scenarios, runs):
    (runs / "bad.ddenv").write_text("no run")
    async with Opened() as session:
        session.screen.query_one("#run-list").focus()
        await session.press("down", "enter")
        assert any("is not a ddenv run file" in notice.message for notice in session.app._notifications)


@pytest.mark.screens
async def test_help_and_quit(scenarios):
    async with Opened() as session:
        await session.press("f1")
        assert isinstance(session.app.screen, Help)
        await session.press("escape", "q")
        assert session.app._exit


@pytest.mark.screens
async def test_letters_can_be_typed_into_fields(scenarios):
    async with Opened() as session:
        field = session.screen.query_one("#name", Input)
        field.focus()
        field.value = ""
        await session.press("q", "question_mark")
        assert field.value == "q?"


@pytest.mark.screens
async def test_without_scenarios_the_way_out_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("ddenv.world.load.SCENARIOS", tmp_path / "none")
    async with Opened() as session:
        assert "ctrl+o" in session.screen.query_one(WorldMap).notice


@pytest.mark.screens
async def test_too_small(scenarios):
    async with Opened((40, 10)) as session:
        assert session.screen.query_one("#small").display
        assert session.told("small") == "ddenv needs 64 x 18; this terminal has 40 x 10"


LOST = (
    "<model name='barrel'><static>1</static><pose>3 0 0 0 0 0</pose><link name='l'><collision name='c'><geometry><mesh>"
    "<uri>model://barrel/barrel.dae</uri></mesh></geometry></collision></link></model>"
)


@pytest.mark.screens
async def test_what_cannot_be_found_is_told_with_the_remedy_that_the_workbench_takes(scenarios, tmp_path, started):
    path = tmp_path / "depot.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>{LOST}</world></sdf>")
    async with Opened() as session:
        await session.open(path)
        assert "--stand-in 'model://barrel=cylinder:0.3,1.0'" in session.screen.query_one(WorldMap).notice
        assert str(session.screen.query_one("#preview").border_title) == "depot.world"
    async with Opened(reading={"stand_in": ("model://barrel=cylinder:0.3,1",)}) as session:
        await session.open(path)
        assert "1 part replaced" in session.screen.query_one("#about", Static).render().plain
        session.fill(spawn_x="0", spawn_y="0", spawn_z="0.2", spawn_yaw="0", goal_x="6", goal_y="0")
        await session.press("ctrl+s")
        assert len(started) == 1
