"""Files that cannot be found are rows of the setup screen, each with a remedy that is
remembered.
"""

import json
import shlex
import threading
from pathlib import Path

import pytest
from textual.widgets import Input

from ddenv.errors import UserError
from ddenv.runs import fetching
from ddenv.runs.experiment import load_parts, scenario_named
from ddenv.runs.preferences import state_file
from ddenv.runs.remedies import KEPT, REMEDIES, remedy, remember_remedies, remembered
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup.missing_files import AskRemedy, MissingList
from ddenv.world.access import Unusable
from ddenv.world.files.fuel import CACHES, HOSTS
from ddenv.world.files.fuel_download import Archive
from ddenv.world.model import Box, Cylinder
from tests.command import in_process, is_one_line
from tests.workbench.setup.setup_session import Opened

BARREL, SHELF = "model://construction_barrel/barrel.dae", "model://old_shelf"


def barrel(name, x):
    mesh = f"<collision name='c'><geometry><mesh><uri>{BARREL}</uri></mesh></geometry></collision>"
    return (
        f"<model name='{name}'><static>1</static><pose>{x} 2 0 0 0 0</pose><link "
        f"name='l'>{mesh}</link></model>"
    )


SUN = "".join(f"<include><uri>model://{name}</uri></include>" for name in ("sun", "ground_plane"))
INSIDE = (
    f"{SUN}{barrel('one', 2)}{barrel('two', 4)}<include><uri>{SHELF}</uri><pose>6 -2 0 0 0 "
    "0</pose></include>"
)


@pytest.fixture
def depot(tmp_path):
    path = tmp_path / "depot.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>{INSIDE}</world></sdf>")
    return path


def rows(session):
    found = session.screen.query_one(MissingList)
    return [option.prompt.plain for option in found.options if option.id] if found.display else []


def shape(session, name):
    return session.screen.preview.choice.world.model(name).collisions[0].shape


@pytest.mark.parametrize("typed", ["shelves", "shelves/", "./shelves", "inside/../shelves/"])
def test_a_folder_may_be_named_from_here(tmp_path, monkeypatch, typed):
    monkeypatch.chdir(tmp_path)
    for name in ("shelves", "inside", "none"):
        (tmp_path / name).mkdir()
    assert Path(remedy(typed)).samefile("shelves") and Path(remedy(typed)).is_absolute()
    assert remedy("none") == "none"
    with pytest.raises(UserError, match=f"no folder {tmp_path}/away"):
        remedy("away/")


async def test_missing_files_are_rows_with_a_guess_that_is_on_the_map(depot, started):
    async with Opened(size=(80, 24)) as session:
        await session.open(depot)
        assert rows(session) == [
            "? old_shelf  guess box:1,1,1: nothing says how large it is",
            "? barrel.dae  guess cylinder:0.296,1.315: the size of Gazebo's model",
        ]
        assert shape(session, "one") == Cylinder(0.296, 1.315)
        assert session.screen.query_one(WorldMap).notice == ""
        await session.place(spawn_x="0", goal_x="8")
        await session.press("ctrl+s")
        assert "2 missing files without a remedy: press m" in session.wrong()
        await session.press("m", "down", "w")
        assert rows(session)[1] == "✓ barrel.dae  left out"
        await session.press("m", "up", "enter")
        dialog = session.app.screen
        assert isinstance(dialog, AskRemedy)
        for wrong, words in {
            "box:1,2": "expected x,y,z",
            "/no/where": "no folder /no/where",
            "visual": "single meshes",
            "": "type one of these",
            str(depot): "is a file; name a folder",
        }.items():
            dialog.query_one("#remedy", Input).value = wrong
            await session.press("enter")
            assert words in session.refused()
        dialog.query_one("#remedy", Input).value = "box:0.4,2,1"
        await session.press("enter")
        assert rows(session)[0] == "✓ old_shelf  box:0.4,2,1"
        assert shape(session, "old_shelf") == Box((0.4, 2, 1))
        assert session.value("goal_x") == "8"
        words = shlex.split(session.told("command"))
        assert [f"{SHELF}=box:0.4,2,1", f"{BARREL}=none"] == [
            words[n + 1] for n, word in enumerate(words) if word == "--stand-in"
        ]
        await session.press("ctrl+s")
        assert len(started) == 1
        world, _ = load_parts(session.made())
        assert world.model("old_shelf").collisions[0].shape == Box((0.4, 2, 1))
        assert world.model("one").collisions == ()


def collision(shape):
    return f"<collision name='c'><geometry>{shape}</geometry></collision>"


async def test_elements_that_are_not_supported_are_left_out_once_the_user_says_so(tmp_path):
    hill = (
        "<model name='hill'><static>1</static><link "
        f"name='l'>{collision('<image/>')}</link></model>"
    )
    hinge = "<joint name='j' type='rope'><parent>l</parent><child>m</child></joint>"
    cart = (
        "<model name='cart'><link "
        f"name='l'>{collision('<box><size>1 1 1</size></box>')}</link><link name='m'/>"
    )
    models = f"<include><uri>{SHELF}</uri></include>{hill}{barrel('one', 4)}{cart}{hinge}</model>"
    path = tmp_path / "hills.world"
    path.write_text(f"<sdf version='1.6'><world name='w'>{models}</world></sdf>")
    async with Opened(size=(80, 24)) as session:
        await session.open(path)
        assert [row.partition("  ")[0] for row in rows(session)] == [
            "? old_shelf",
            "? barrel.dae",
            "? <joint>",
            "? <image>",
        ]
        assert "2 missing files, 2 unsupported elements without a remedy: press m" in session.told(
            "cost"
        )
        await session.press("m", "home", "down", "down", "enter")
        assert rows(session)[2:] == [
            "✓ <joint>  not supported, left out",
            "? <image>  not supported, left out",
        ]
        await session.press("m", "a")
        assert [row[0] for row in rows(session)] == ["✓"] * 4
        await session.place(spawn_x="0", goal_x="8")
        assert "--ignore image --ignore joint" in session.told("command")
        # In another world it may be the ground.
        other = tmp_path / "other.world"
        other.write_bytes(path.read_bytes())
        await session.open(other)
        assert [row[0] for row in rows(session)] == ["✓", "✓", "?", "?"]


async def test_files_that_were_found_and_cannot_be_used_say_why_and_have_the_same_remedies(
    tmp_path,
):
    (tmp_path / "barrel.dae").write_text("<COLLADA><")
    models = tmp_path / "models"
    for name, content in {
        "rack": "<sdf version='1.6'><model",
        "keg": barrel("keg", 2).replace(BARREL, "keg.dae"),
    }.items():
        (models / name).mkdir(parents=True)
        (models / name / "model.sdf").write_text(
            content if name == "rack" else f"<sdf version='1.6'>{content}</sdf>"
        )
    (models / "keg" / "keg.dae").write_text("<COLLADA><")
    includes = "".join(f"<include><uri>model://{name}</uri></include>" for name in ("rack", "keg"))
    inside = f"{includes}{barrel('one', 2).replace(BARREL, 'barrel.dae')}"
    path = tmp_path / "w.sdf"
    path.write_text(f"<sdf version='1.6'><world name='w'>{inside}</world></sdf>")
    async with Opened(size=(120, 36)) as session:
        await session.open(path)
        assert (
            session.screen.query_one(MissingList).border_title
            == "3 unreadable files (m), 3 without a remedy"
        )
        rack, *meshes = rows(session)
        assert rack.startswith(f"? rack  {models}/rack/model.sdf:1:20: not well-formed XML: ")
        assert [row.partition(": ")[0] for row in meshes] == [
            "? keg.dae  is not a valid DAE file",
            "? barrel.dae  is not a valid DAE file",
        ]
        await session.press("m", "home", "w", "down", "a")
        rack, *meshes = rows(session)
        assert rack.startswith("✓ rack ") and rack.endswith("; left out")
        assert all(row.startswith("✓") and "box:1,1,1" in row for row in meshes)
        assert session.screen.preview.choice.world.names == ("keg", "one")


CRATE = (
    "<model name='crate'><static>1</static><link "
    f"name='l'>{collision('<box><size>2 1 1</size></box>')}</link></model>"
)


@pytest.mark.filterwarnings(
    "ignore:Exception in thread:pytest.PytestUnhandledThreadExceptionWarning"
)
async def test_models_come_from_fuel_unless_the_user_stops_that(depot, tmp_path, monkeypatch):
    for variable in CACHES:
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    answer, ends = threading.Event(), []

    def download(model, shown):
        shown(1_200_000, 5_000_000)
        answer.wait(60)
        ends.append("stopped")
        shown(5_000_000, 5_000_000)
        ends[-1] = "came"
        if model.name == "Lamp":
            raise Unusable("is not in Fuel")
        folder = tmp_path / "home" / ".gz" / "fuel" / HOSTS[0] / model.folder / "3"
        folder.mkdir(parents=True)
        (folder / "model.sdf").write_text(f"<sdf version='1.6'>{CRATE}</sdf>")
        return folder, Archive(model.url, "3", 5_000_000, "0" * 64)

    monkeypatch.setattr(fetching, "download", download)
    uris = [f"https://{HOSTS[0]}/1.0/Some One/models/{name}" for name in ("Crate", "Lamp")]
    includes = "".join(f"<include><uri>{uri}</uri></include>" for uri in uris)
    depot.write_text(depot.read_text().replace("</world>", f"{includes}</world>"))
    async with Opened() as session:

        async def until(holds):
            while not holds():
                await session.pilot.pause(0.02)
            await session.settle()

        await session.open(depot)
        found = session.screen.query_one(MissingList)
        assert rows(session)[1].startswith("? Crate  f fetches it; guess box")
        await session.press("m", "f")
        await until(lambda: found.border_title == "Crate: 1.2 of 5.0 MB; f stops")
        await session.press("f")
        # At once, though the server sends nothing.
        await until(lambda: found.border_title == "4 missing files (m), 4 without a remedy")
        answer.set()
        await until(lambda: ends == ["stopped"])
        await session.press("f")
        await until(lambda: len(rows(session)) == 3)
        assert ends == ["stopped", "came", "came"]
        assert shape(session, "crate") == Box((2, 1, 1))
        (failed,) = [each.message for each in session.app._notifications]
        assert failed.endswith("Lamp cannot be fetched: is not in Fuel; w leaves it out")
        await session.press("m", "home", "down", "w")
        assert rows(session)[1] == "✓ Lamp  left out"


@pytest.mark.screens
async def test_remedies_are_used_the_next_time_and_in_other_worlds(depot, tmp_path):
    async with Opened() as session:
        await session.open(depot)
        await session.press("m", "a")
        guessed = rows(session)
        assert [row[0] for row in guessed] == ["✓", "✓"]
        # What is solved is a line until one wants to read it.
        found = session.screen.query_one(MissingList)
        assert (found.border_title.split(",")[0].removesuffix(" (m)"), found.size.height) == (
            "remedies for 2 missing files",
            0,
        )
        await session.press("m")
        assert found.size.height >= 2
        await session.press("w")
        assert sum("left out" in row for row in rows(session)) == 1
        await session.press("m", "a")
        assert rows(session) == guessed
    other = tmp_path / "other.world"
    other.write_bytes(depot.read_bytes())
    async with Opened() as session:
        await session.open(other)
        assert [row[0] for row in rows(session)] == ["✓", "✓"]
        await session.place(spawn_x="0", goal_x="8")
        assert f"--stand-in {SHELF}=auto" in session.told("command")
        await session.press("m", "enter")
        session.app.screen.query_one("#remedy", Input).value = ""
        await session.press("enter")
        assert [row[0] for row in rows(session)] == ["?", "✓"]
        assert remembered() == {BARREL: "auto"}


@pytest.mark.screens
async def test_a_folder_is_a_remedy_if_the_file_is_in_it(depot, tmp_path):
    folder = tmp_path / "my models" / "old_shelf"
    folder.mkdir(parents=True)
    shelf = "<collision name='c'><geometry><box><size>3 1 2</size></box></geometry></collision>"
    text = (
        "<sdf version='1.6'><model name='shelf'><static>1</static><link "
        f"name='l'>{shelf}</link></model></sdf>"
    )
    (folder / "model.sdf").write_text(text)
    remember_remedies({SHELF: str(folder.parent), BARREL: str(folder.parent)})
    async with Opened() as session:
        await session.open(depot)
        assert [row[:5] for row in rows(session)] == ["✓ old", "? bar"]
        assert f"not in {folder.parent}; guess cylinder" in rows(session)[1]
        assert shape(session, "shelf") == Box((3, 1, 2))
        await session.press("m", "a")
        await session.place(spawn_x="0", goal_x="8")
        assert f"--model-path '{folder.parent}'" in session.told("command")


@pytest.mark.screens
async def test_a_world_that_misses_nothing_has_no_rows(scenarios, depot):
    async with Opened() as session:
        assert rows(session) == []
        await session.press("m")
        assert session.screen.focused is session.screen.query_one(WorldMap)
        await session.open(depot)
        assert len(rows(session)) == 2
        await session.open(scenarios / "crates.sdf")
        assert rows(session) == []
    async with Opened(reading={"stand_in": ("auto",)}) as session:
        await session.open(depot)
        assert rows(session) == []
        await session.place(spawn_x="0", goal_x="8")
        assert "--stand-in auto" in session.told("command")


@pytest.mark.screens
async def test_what_was_replaced_or_ignored_can_be_read(tmp_path):
    ball = """<model name='{}'><link name='l'><velocity_decay/><collision name='c'><geometry><sphere><radius>1</radius>
        </sphere></geometry><surface><bounce><restitution_coefficient>1</restitution_coefficient></bounce></surface>
        </collision></link></model>"""
    path = tmp_path / "balls.world"
    path.write_text(
        f"<sdf version='1.6'><world name='w'>{ball.format('one')}{ball.format('two')}</world></sdf>"
    )
    async with Opened(size=(80, 24)) as session:
        await session.open(path)
        found = session.screen.query_one(MissingList)
        assert (found.border_title, found.size.height) == ("4 parts replaced or ignored (m)", 0)
        await session.press("m")
        assert found.size.height == 2
        shown = [option.prompt.plain for option in found.options]
        assert any(
            row.startswith("  ignored <restitution_coefficient> × 2  bouncing is not simulated")
            for row in shown
        )
        assert not {"guess", "without"} & {
            each.binding.action for each in session.screen.active_bindings.values()
        }
        await session.press("enter", "a", "w")
        assert remembered() == {}


def test_only_the_newest_remedies_are_kept():
    remember_remedies({f"model://{n}": "auto" for n in range(KEPT + 5)})
    remember_remedies({"model://9": "none", "model://10": ""})
    found = json.loads(state_file(REMEDIES).read_text())
    assert len(found) == KEPT - 1
    assert list(found)[-1] == "model://9"


@pytest.mark.screens
async def test_the_question_for_the_start_comes_back_to_the_map(depot):
    async with Opened(size=(80, 24)) as session:
        await session.open(depot)
        assert "the start: move the crosshair" in session.told("picking")
        await session.press("m")
        await session.press("a")
        assert session.screen.focused is session.screen.query_one(WorldMap)
        assert "the start: move the crosshair" in session.told("picking")
        assert "spawn x m, spawn y m, spawn z m, yaw rad: missing" in session.told("cost")


def test_commands_use_what_the_workbench_remembers_and_say_so(depot, monkeypatch, capsys):
    remember_remedies({BARREL: "cylinder:0.3,1", SHELF: "none", "model://another": "auto"})
    done = in_process(monkeypatch, capsys, "world", "check", depot)
    assert done.returncode == 0
    assert BARREL in done.stderr and "--no-remembered" in done.stderr
    is_one_line(
        in_process(monkeypatch, capsys, "world", "check", depot, "--no-remembered"),
        "construction_barrel",
    )
    given = {
        "model_path": (),
        "stand_in": (),
        "ignore": (),
        "spawn": (0, 0, 0.2, 0),
        "goal": (9, 0),
        "world": None,
    }
    said = []
    world, _ = load_parts(scenario_named(str(depot), {**given, "remembered": True}, said.append))
    assert {model.name for model in world.models if model.name in ("one", "two")} == {"one", "two"}
    assert all(
        name in said[-1] for name in (BARREL, SHELF, str(state_file(REMEDIES)), "--no-remembered")
    )
    assert "another" not in said[-1]
    with pytest.raises(UserError, match="construction_barrel"):
        load_parts(scenario_named(str(depot), {**given, "remembered": False}))
