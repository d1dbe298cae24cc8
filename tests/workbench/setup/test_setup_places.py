"""Start, heading and goal are set on the map of the setup screen."""

import fake_run
import pytest
import yaml

from ddenv.workbench.map.world_map import WorldMap
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
        assert session.screen.preview.picker.picked_next == ""


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
