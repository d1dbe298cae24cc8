"""The command that the setup screen shows does what its Start does."""

import shlex

import fake_run
import pytest

from ddenv.cli.command_line import app as command_line
from ddenv.cli.workbench import open_command
from ddenv.runs.experiment import READING
from ddenv.settings import OPTIONS
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice
from ddenv.workbench.setup.start_run import command_words
from ddenv.world.load import load_scenario
from tests.workbench.setup.setup_session import Opened, write_scenario


@pytest.fixture
def own(scenarios):
    """The bundled scenario, with a limit."""
    write_scenario(scenarios, reduction=fake_run.scenario()["reduction"] | {"budget": 50})
    return load_scenario(scenarios / "crates.yaml")


def told(path, own, asked, jobs=4, name=""):
    """The command for a scenario of the file `path`."""
    return command_words(Choice(path=path, world=None, settings=own), asked, jobs, name)


@pytest.fixture
def asked_by(scenarios, monkeypatch):
    """The scenario, the run's path and the jobs that a command line would start with."""

    class Caught(Exception):
        pass

    def asked_by(words):
        caught = []
        with monkeypatch.context() as patch:

            def create_run(scenario, path, *_):
                caught.extend((scenario, path))
                raise Caught

            patch.setattr("ddenv.runs.creation.create_run", create_run)
            patch.setattr("ddenv.world.load.SCENARIOS", scenarios)
            with pytest.raises(Caught):
                command_line(words[1:], standalone_mode=False)
        return caught

    return asked_by


def another(one):
    """A value that is not the default, as it is typed."""
    if one.kind is bool:
        return "off" if one.default else "on"
    if one.choices:
        return next(choice for choice in one.choices if choice != one.default)
    if one.kind is str:
        return "tcp://head:8786"
    return "90" if one.default is None else str(one.default + (4 if one.kind is int else 0.125))


PLACES = {
    "spawn_x": "-5.5",
    "spawn_y": "-0.25",
    "spawn_z": "0.3",
    "yaw": "-1e-05",
    "goal_x": "-6.125",
    "goal_y": "2",
}
OTHER = PLACES | {one.name: another(one) for one in OPTIONS if one.shown in ("basic", "more")}


def test_every_setting_has_an_option(scenarios, own, asked_by):
    assert set(OTHER) == set(form.FIELDS) - {"jobs", "run_name", "accept"}
    asked = form.asked_of(own, OTHER, "timeseg/random", "ddmin")
    words = told(scenarios / "crates.yaml", own, asked, 3, "it's <mine>")
    assert words[:3] == ["ddenv", "run", "crates"]
    scenario, path = asked_by(shlex.split(shlex.join(words)))
    assert scenario == asked
    assert path.name == "it's <mine>.ddenv"


def test_a_long_number_is_shown_rounded_and_stays_what_it_is(scenarios, own, asked_by):
    texts = form.texts_of(own)
    assert texts["certify_rate"] == "0.667"
    asked = form.asked_of(own, texts, own.reduction.pair, own.reduction.algorithm)
    assert asked.reduction.certify_rate == own.reduction.certify_rate == 2 / 3
    assert told(scenarios / "crates.yaml", own, asked)[3:] == []
    asked = form.asked_of(
        own, texts | {"certify_rate": "0.66"}, own.reduction.pair, own.reduction.algorithm
    )
    assert asked.reduction.certify_rate == 0.66


@pytest.mark.parametrize("typed", ["", " none"])
def test_a_limit_can_be_taken_back(scenarios, own, asked_by, typed):
    asked = form.asked_of(own, form.texts_of(own) | {"budget": typed}, "timeseg/random", "ddmin")
    assert asked.reduction.budget is None
    scenario, _ = asked_by(told(scenarios / "crates.yaml", own, asked))
    assert scenario == asked


@pytest.mark.screens
async def test_what_is_shown_starts_what_start_starts(scenarios, asked_by, started):
    async with Opened() as session:
        assert session.told("command") == "$ ddenv run crates"
        await session.press("f9")
        session.fill(
            iterations="5",
            as_printed="on",
            spawn_x="-6.25",
            goal_y="-0.5",
            jobs="2",
            run_name="mine",
        )
        session.screen.query_one("#algorithm").value = "ddmin"
        await session.pilot.pause()
        shown = session.told("command").removeprefix("$ ")
        assert shown.startswith(
            "ddenv run crates --spawn=-6.25,0,0.2,0 --goal=6,-0.5 --algorithm ddmin --iterations 5"
        )
        assert shown.endswith("--as-printed --jobs 2 --name mine")
        await session.press("f8")
        assert session.app.clipboard == shown
        await session.press("ctrl+s")
        assert asked_by(shlex.split(shown)) == [session.made(), session.app.screen.run]


@pytest.mark.parametrize("given", [[], ["--inside", "--mesh=hull"]])
async def test_the_options_of_the_command_line_are_part_of_it(scenarios, tmp_path, given):
    """As click gives them, without any and with a flag."""
    parsed = open_command.make_context("open", ["house.sdf", *given]).params
    reading = {name: parsed[name] for name in READING}
    world = tmp_path / "house.sdf"
    boxes = "".join(
        (
            f"<collision name='{name}'><pose>3 {y} 0.5 0 0 0</pose><geometry><box><size>1 1 "
            "1</size></box></geometry></collision>"
        )
        for name, y in (("left", 2), ("right", -2))
    )
    house = f"<model name='house'><static>1</static><link name='l'>{boxes}</link></model>"
    world.write_text(f"<sdf version='1.9'><world name='w'>{house}</world></sdf>")
    async with Opened(reading=reading) as session:
        await session.open(world)
        await session.place()
        words = shlex.split(session.told("command"))
        assert ("--inside" in words and "--mesh hull" in " ".join(words)) == bool(given), words


@pytest.mark.screens
async def test_a_bare_world_and_how_it_is_read_are_part_of_it(scenarios, tmp_path, asked_by):
    folder = tmp_path / "my worlds"
    folder.mkdir()
    path = folder / "it's.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened(
        reading={"stand_in": ("model://barrel=cylinder:0.3,1",), "model_path": (folder,)}
    ) as session:
        await session.open(path)
        assert session.told("command") == ""
        assert "not ready: spawn x m, spawn y m, spawn z m, yaw rad: missing" in session.told(
            "cost"
        )
        await session.press("f8")
        assert session.app.clipboard == "" and session.app.focused.id == "spawn_x"
        await session.place()
        words = shlex.split(session.told("command"))[1:]
        assert words[2] == str(path)
        assert words[3:5] == ["--spawn=-6,0,0.16,0", "--goal=6,0"]
        scenario, run = asked_by(words)
        assert scenario == session.screen._asked()[1]
        assert run.stem == "it-s-1"
