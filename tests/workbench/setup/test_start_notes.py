"""What is wrong with the start of a world is seen on the setup screen, before the run."""

import fake_run
import pytest
import yaml

from tests.waiting import eventually
from tests.workbench.setup.setup_session import Opened

LOOSE = fake_run.box("loose", 0, 0).replace("<static>true</static>", "")


def world(*models):
    return f'<sdf version="1.9"><world name="w">{fake_run.GROUND}{"".join(models)}</world></sdf>'


async def says(session, words):
    line = session.screen.query_one("#start-notes")
    await eventually(lambda: line.display == bool(words) and (not words or line.render().plain == words))
    return line


@pytest.mark.parametrize("size", [(80, 24), (120, 36)])
async def test_a_robot_in_the_air_is_told_until_its_start_is_lower(scenarios, size):
    data = fake_run.scenario()
    data["robot"]["spawn"]["z"] = 1.0
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(data))
    async with Opened(size) as session:
        what = "the robot starts 0.88 m above the surface below it and drops"
        line = await says(session, f"▲ lower the spawn's z: {what}")
        assert line.tooltip.plain == f"{what}; lower the spawn's z."
        await session.press("f3")
        # Where the map is alone, the note is whole.
        assert line.region.height == (2 if size[0] == 80 else 1) and session.screen.query_one("#map").region.height > 10
        session.fill(spawn_z="0.2")
        await says(session, "")


async def test_models_inside_each_other_are_told_of_a_world_without_a_start(scenarios):
    (scenarios / "inside.sdf").write_text(world(LOOSE, fake_run.box("wall", 0.5, 0)))
    async with Opened() as session:
        await session.open(scenarios / "inside.sdf")
        why = "loose starts 0.30 m inside wall: they push each other apart"
        await says(session, f"▲ move one model, or make both static: {why}")
        session.fill(spawn_x="4", spawn_y="0", spawn_z="2", spawn_yaw="0")
        line = await says(
            session, "▲ lower the spawn's z (+1): the robot starts 1.87 m above the surface below it and drops"
        )
        assert why in line.tooltip.plain
        await session.open(scenarios / "crates.yaml")
        await says(session, "")
