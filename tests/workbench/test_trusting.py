"""A program that a run or a scenario brings along starts only after the user's yes."""

import json
import sqlite3

import fake_moments
import fake_run
import pytest
import yaml
from textual.widgets import Static

from ddenv.runs.creation import create_run
from ddenv.workbench.setup.setup_screen import SetupScreen
from ddenv.workbench.widgets.question import Question
from ddenv.world.load import load_scenario
from tests.workbench.attached import Attached
from tests.workbench.setup.setup_session import Opened


@pytest.fixture
def brings(scenarios):
    """The scenario file, which now brings a controller along."""
    path = scenarios / "crates.yaml"
    path.write_text(
        yaml.safe_dump(fake_run.scenario() | {"controller": {"use": "subprocess:Popen"}})
    )
    return path


def question(app) -> str:
    assert isinstance(app.screen, Question)
    return str(app.screen.query_one(Static).render())


@pytest.mark.screens
async def test_a_run_like_one_that_was_sent_asks_before_it_starts(brings, runs, started):
    create_run(load_scenario(brings), runs / "crates-1.ddenv")
    async with Opened(screen=lambda: SetupScreen(like=runs / "crates-1.ddenv")) as session:
        await session.press("f5")
        assert "crates-1.ddenv starts the controller subprocess:Popen" in question(session.app)
        # Enter alone says no.
        await session.press("enter")
        assert "do not trust" in session.wrong_or_run()
        assert started == [] and not (runs / "crates-2.ddenv").exists()
        await session.press("f5", "y")
        assert session.wrong_or_run() == "crates-2"
        assert len(started) == 1


async def test_a_scenario_of_the_users_own_starts_at_once(brings, runs, started):
    async with Opened() as session:
        await session.press("f5")
        assert session.wrong_or_run() == "crates-1"
        assert len(started) == 1


async def test_an_ended_run_that_was_sent_asks_before_it_goes_on(run, started):
    fake_moments.finished(run)
    with sqlite3.connect(run.path) as database:
        ((text,),) = database.execute("SELECT content FROM document WHERE name = 'scenario'")
        scenario = json.loads(text)
        scenario["controller"] = {"use": "subprocess:Popen"}
        database.execute(
            "UPDATE document SET content = ? WHERE name = 'scenario'",
            [json.dumps(scenario).encode()],
        )
    async with Attached(run) as session:
        await session.press("p", *"00", "enter")
        assert "crates-1.ddenv starts the controller subprocess:Popen" in question(session.app)
        # Nothing was said or asked for before.
        assert session.said() == "" and session.asked() == []
        await session.press("n")
        assert started == [] and session.asked() == []
        assert "not done: it starts a program that you do not trust" in session.said()
        await session.press("p", *"01", "enter")
        await session.press("y")
        assert len(started) == 1
