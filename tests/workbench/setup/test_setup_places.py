"""Start, heading and goal are set on the map of the setup screen."""

import fake_run
import pytest
from textual.widgets import Input

from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup.files import remember
from tests.tiers import slow
from tests.waiting import eventually
from tests.workbench.setup.setup_session import Opened, write_scenario


class Places:
    def __init__(self, session):
        self.session = session

    async def pick(self, x, y):
        """As the map's crosshair or a click would."""
        self.map.post_message(WorldMap.PlacePicked(x, y))
        await self.session.pilot.pause()

    def numbers(self):
        fields = ("spawn_x", "spawn_y", "spawn_z", "yaw", "goal_x", "goal_y")
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
    write_scenario(scenarios, **own)
    async with Opened() as session:
        places = Places(session)
        for place, z in (((0, 3), "1.13"), ((20, 20), "0.23"), ((-6, 0), "0.25")):
            await session.press("s")
            await places.pick(*place)
            assert session.value("spawn_z") == z
    # Where there is no ground at all the height stays.
    (scenarios / "crates.sdf").write_text(crates.replace(fake_run.GROUND, ""))
    async with Opened() as session:
        await session.press("s")
        await Places(session).pick(50, 50)
        assert (session.value("spawn_x"), session.value("spawn_z")) == ("50", "0.25")


@pytest.mark.parametrize(
    "size", slow(pytest.mark.screens, [(120, 36), (80, 24)], but=[(80, 24)]), ids=str
)
async def test_a_bare_world_asks_for_all_three_in_turn(scenarios, tmp_path, size):
    path = tmp_path / "bare.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened(size) as session:
        await session.open(path)
        places = Places(session)
        assert places.numbers() == [""] * 6
        assert places.map.picking
        assert session.app.focused is places.map and places.map.size.height > 5
        before = places.map.viewport.cursor
        await session.press("up")
        assert places.map.viewport.cursor != before
        for place, words in (
            ((-6, 0), "the heading"),
            ((0, 0), "the goal"),
            ((6, 1), "start (-6.00, 0.00) m"),
        ):
            await places.pick(*place)
            assert words in places.says()
        assert float(session.value("spawn_z")) == pytest.approx(0.167, abs=0.005)
        assert session.told("command").startswith("$ ddenv run")


@pytest.mark.screens
async def test_the_ground_gives_the_z_of_a_start_that_is_typed_until_one_types_that(
    scenarios, tmp_path
):
    path = tmp_path / "bare.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened() as session:
        await session.open(path)

        async def typed(id, text):
            session.screen.query_one(f"#{id}", Input).value = text
            await session.pilot.pause()

        await typed("spawn_x", "-6")
        assert session.value("spawn_z") == ""
        await typed("spawn_y", "0")
        assert float(session.value("spawn_z")) == pytest.approx(0.167, abs=0.005)
        assert session.value("yaw") == "0"
        await typed("spawn_z", "0.3")
        await typed("spawn_x", "-5")
        assert session.value("spawn_z") == "0.3"


async def test_the_crosshair_and_the_mouse_pick(scenarios):
    async with Opened() as session:
        places = Places(session)
        # In the middle of the map stand crates.
        await session.press("s", *["left"] * 20, "enter")
        x, y = float(session.value("spawn_x")), float(session.value("spawn_y"))
        assert "the heading" in places.says()
        await session.press("up", "up", "enter")
        assert session.value("yaw") == "1.571"
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


@pytest.mark.screens
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


LOOSE = fake_run.box("loose", 0, 0).replace("<static>true</static>", "")


def world(*models):
    return f'<sdf version="1.9"><world name="w">{fake_run.GROUND}{"".join(models)}</world></sdf>'


async def says(session, words):
    line = session.screen.query_one("#start-notes")
    await eventually(
        lambda: line.display == bool(words) and (not words or line.render().plain == words)
    )
    return line


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [(80, 24), (120, 36)], but=[(80, 24)]))
async def test_a_robot_in_the_air_is_told_until_its_start_is_lower(scenarios, size):
    data = fake_run.scenario()
    data["robot"]["spawn"]["z"] = 1.0
    write_scenario(scenarios, **data)
    async with Opened(size) as session:
        what = "the robot starts 0.88 m above the surface below it and drops"
        line = await says(session, f"▲ lower the spawn's z: {what}")
        assert line.tooltip.plain == f"{what}; lower the spawn's z."
        await session.press("f3")
        # Where the map is alone, the note is whole.
        assert (
            line.region.height == (2 if size[0] == 80 else 1)
            and session.screen.query_one("#map").region.height > 10
        )
        session.fill(spawn_z="0.2")
        await says(session, "")


@pytest.mark.screens
async def test_models_inside_each_other_are_told_of_a_world_without_a_start(scenarios):
    (scenarios / "inside.sdf").write_text(world(LOOSE, fake_run.box("wall", 0.5, 0)))
    async with Opened() as session:
        await session.open(scenarios / "inside.sdf")
        why = "loose starts 0.30 m inside wall: they push each other apart"
        await says(session, f"▲ move one model, or make both static: {why}")
        session.fill(spawn_x="4", spawn_y="0", spawn_z="2", yaw="0")
        line = await says(
            session,
            (
                "▲ lower the spawn's z (+1): the robot starts 1.87 m above the surface below it "
                "and drops"
            ),
        )
        assert why in line.tooltip.plain
        await session.open(scenarios / "crates.yaml")
        await says(session, "")
