"""Numbers in the form stand there whole, from their sign on, at every size; what does not fit says so."""

import fake_run
import pytest
import yaml

from tests.tiers import slow
from tests.workbench.setup.setup_session import Opened

NUMBERS = {"spawn_x": "-0.56", "spawn_y": "6.75", "spawn_yaw": "-1.571", "goal_x": "-12.05", "goal_y": "-104.5"}


def shown(session, id):
    """What stands in a field."""
    return session.screen.query_one(f"#{id}").render_line(0).text.rstrip()


@pytest.mark.screens
@pytest.mark.parametrize(
    "size", slow(pytest.mark.screens, [(64, 18), (80, 24), (110, 32), (120, 36), (170, 50)], but=[(120, 36)]), ids=str
)
async def test_numbers_begin_with_their_sign(scenarios, size):
    own = fake_run.scenario()
    own["robot"]["spawn"] |= {"x": -0.56, "y": 6.75, "yaw": -1.571}
    own["goal"] = {"x": -12.05, "y": -104.5}
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(own))
    async with Opened(size) as session:
        await session.press("f4")
        assert {id: shown(session, id) for id in NUMBERS} == NUMBERS
        for id in NUMBERS:
            session.screen.query_one(f"#{id}").focus()
            await session.pilot.pause()
            assert shown(session, id) == NUMBERS[id]


async def test_a_number_that_does_not_fit_says_so_and_is_replaced_by_typing(scenarios):
    async with Opened() as session:
        await session.press("f4")
        session.fill(spawn_x="-0.78539816339")
        await session.pilot.pause()
        assert shown(session, "spawn_x").startswith("-0.78") and shown(session, "spawn_x").endswith("…")
        session.screen.query_one("#spawn_x").focus()
        await session.pilot.pause()
        assert shown(session, "spawn_x").startswith("-0.78")
        await session.press("minus", "7")
        assert session.value("spawn_x") == "-7"
