"""Start, heading and goal are set on the map of the setup screen."""

import fake_run
import pytest
import yaml

from ddenv.runs.remembered import state_file
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup import form
from ddenv.workbench.setup.files import remember
from ddenv.workbench.setup.preview import places_of, remember_places
from tests.tiers import slow
from tests.workbench.setup.setup_session import Opened


class Places:
    def __init__(self, session):
        self.session = session

    async def pick(self, x, y):
        """As the map's crosshair or a click would."""
        self.map.post_message(WorldMap.PlacePicked(x, y))
        await self.session.pilot.pause()

    def numbers(self):
        fields = ("spawn_x", "spawn_y", "spawn_z", "spawn_yaw", "goal_x", "goal_y")
        return [self.session.value(id) for id in fields]

    @property
    def map(self):
        return self.session.screen.query_one(WorldMap)

    def says(self):
        return self.session.told("picking")


@pytest.mark.screens
async def test_a_scenarios_own_places_are_told_and_replaced(scenarios, started):
    async with Opened() as session:
        places = Places(session)
        assert places.numbers() == ["-6", "0", "0.2", "0", "6", "0"]
        assert "start (-6.00, 0.00) m" in places.says()
        assert "heading → 0°" in places.says()
        await places.pick(1, 1)
        assert places.numbers() == ["-6", "0", "0.2", "0", "6", "0"]
        await session.press("s")
        assert session.app.focused is places.map
        assert places.map.picking
        assert "the start" in places.says()
        await places.pick(-5.5, -1.0004)
        assert "the heading" in places.says()
        await places.pick(-5.5, 3)
        assert not places.map.picking
        assert places.numbers() == ["-5.5", "-1", "0.2", "1.571", "6", "0"]
        assert "heading ↑ 90°" in places.says()
        assert places.map.place.spawn == (-5.5, -1.0, 1.571)
        await session.press("g")
        await places.pick(5, -2)
        assert places.map.place.goal == (5.0, -2.0)
        await session.press("h")
        await session.press("escape")
        assert not places.map.picking
        await session.press("ctrl+s")
        scenario = session.made()
        assert (scenario.robot.spawn.yaw, scenario.goal.x) == (1.571, 5.0)


@pytest.mark.screens
async def test_the_robot_is_put_on_what_stands_there(scenarios):
    own = fake_run.scenario()
    own["robot"]["spawn"]["z"] = 0.25
    crates = fake_run.world_text().decode()
    shelf = fake_run.box("shelf", 0, 3, size=(2, 1, 0.9))
    (scenarios / "crates.sdf").write_text(crates.replace("</world>", f"{shelf}</world>"))
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(own))
    async with Opened() as session:
        places = Places(session)
        for place, z in (((0, 3), "1.13"), ((20, 20), "0.23"), ((-6, 0), "0.25")):
            await session.press("s")
            await places.pick(*place)
            assert session.value("spawn_z") == z


@pytest.mark.screens
async def test_a_bare_world_asks_for_all_three_in_turn(scenarios, tmp_path):
    path = tmp_path / "bare.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened() as session:
        await session.open(path)
        places = Places(session)
        assert places.numbers() == [""] * 6
        assert places.map.picking
        for place, words in (((-6, 0), "the heading"), ((0, 0), "the goal"), ((6, 1), "start (-6.00, 0.00) m")):
            await places.pick(*place)
            assert words in places.says()
        assert float(session.value("spawn_z")) == pytest.approx(0.167, abs=0.005)
        assert session.told("command").startswith("$ ddenv run")


@pytest.mark.screens
async def test_a_place_without_ground_keeps_the_height(scenarios):
    text = fake_run.world_text().decode().replace(fake_run.GROUND, "")
    (scenarios / "crates.sdf").write_text(text)
    async with Opened() as session:
        await session.press("s")
        await Places(session).pick(50, 50)
        assert session.value("spawn_z") == "0.2"
        assert session.value("spawn_x") == "50"


@pytest.mark.screens
async def test_keys_for_the_map_are_letters_in_a_field(scenarios):
    async with Opened() as session:
        field = session.screen.query_one("#name")
        field.focus()
        field.value = ""
        await session.press("s", "g", "h", "0", "minus")
        assert field.value == "sgh0-"
        assert session.screen.preview.picked_next == ""


async def test_the_crosshair_and_the_mouse_pick(scenarios):
    async with Opened() as session:
        places = Places(session)
        await session.press("s", "enter")
        x, y = float(session.value("spawn_x")), float(session.value("spawn_y"))
        assert "the heading" in places.says()
        await session.press("up", "up", "enter")
        assert session.value("spawn_yaw") == "1.571"
        await session.press("g", "right", "right", "right", "enter")
        assert float(session.value("goal_x")) > x
        await session.press("s")
        await session.pilot.click("#map", offset=(20, 5))
        await session.pilot.pause()
        assert (float(session.value("spawn_x")), float(session.value("spawn_y"))) != (x, y)
        before = places.numbers()
        await session.press("escape")
        await session.pilot.click("#map", offset=(30, 6))
        await session.pilot.pause()
        assert places.numbers() == before


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [(120, 36), (80, 24)], but=[(80, 24)]), ids=str)
async def test_the_focus_is_where_a_new_world_asks(scenarios, tmp_path, size):
    path = tmp_path / "bare.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened(size) as session:
        await session.open(path)
        places = Places(session)
        assert session.app.focused is places.map and places.map.size.height > 5
        before = places.map.viewport.cursor
        await session.press("up")
        assert places.map.viewport.cursor != before
        await session.press("enter")
        assert "the heading" in places.says()


async def test_looking_at_a_world_in_the_list_asks_nothing_before_enter(scenarios, tmp_path):
    path = tmp_path / "bare.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    remember(path)
    async with Opened() as session:
        places = Places(session)
        await session.press("down")
        assert session.app.focused.id == "scenario-list" and not places.map.picking
        assert "no start and goal yet: s sets them" in places.says()
        await session.press("enter")
        assert session.app.focused is places.map and "the start" in places.says()


@pytest.mark.screens
async def test_start_and_goal_are_remembered_for_each_world(scenarios, tmp_path):
    worlds = [tmp_path / "one.sdf", tmp_path / "two.sdf"]
    for number, path in enumerate(worlds):
        path.write_bytes((scenarios / "crates.sdf").read_bytes())
        async with Opened() as session:
            await session.open(path)
            session.fill(spawn_x="-6", spawn_y=str(number), spawn_z="0.16", spawn_yaw="0", goal_x="6", goal_y="0")
            await session.open(scenarios / "crates.yaml")
    for number, path in enumerate(worlds):
        async with Opened() as session:
            await session.open(path)
            assert Places(session).numbers() == ["-6", str(number), "0.16", "0", "6", "0"]
            assert not Places(session).map.picking
            assert session.told("command").startswith("$ ddenv run")


@pytest.mark.parametrize("content", ["[]", "{", '{"PATH": {"spawn_x": "1e300"}}', '{"PATH": 3}'])
def test_damaged_places_are_passed_over(tmp_path, content):
    path = tmp_path / "one.sdf"
    remember_places(path, dict.fromkeys([field.id for field in form.PLACES], "1"))
    state_file("places.json").write_text(content.replace("PATH", str(path)))
    assert places_of(path) is None
