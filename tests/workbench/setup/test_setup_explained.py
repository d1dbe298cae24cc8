"""The setup screen explains scenarios, schemas and fields."""

import fake_run
import pytest
import yaml
from textual.widgets import Select

from ddenv.schemas import explanation
from ddenv.settings import SETTINGS
from ddenv.words.methods import KINDS
from tests.workbench.setup.setup_session import Opened, write_scenario


@pytest.mark.screens
async def test_a_description_that_does_not_fit_says_so(scenarios):
    write_scenario(scenarios, description="far " * 60 + "end")
    for size, whole in (((80, 24), False), ((200, 60), True)):
        async with Opened(size) as session:
            told = session.told("about")
            assert told.endswith("far end" if whole else " far …")
            assert whole or len(told.splitlines()) == 2
            # What is too long there is whole on the map's pane.
            await session.press("f3")
            assert session.told("about") == session.screen.preview.choice.about


@pytest.mark.screens
async def test_what_is_focused_highlighted_or_changed_is_explained(scenarios):
    other = fake_run.scenario(name="other")
    other["reduction"] |= {"algorithm": "probdd"}
    (scenarios / "other.yaml").write_text(yaml.safe_dump(other))
    async with Opened() as session:
        assert session.explained() == ("algorithm ddenv", explanation("algorithm", "ddenv"))
        await session.press("enter", "tab")
        assert session.app.focused.id == "partitioning"
        assert session.explained() == (
            "partitioning model2model",
            explanation("partitioning", "model2model"),
        )
        await session.press("enter", "down")
        assert session.explained()[0] == "partitioning model2model", (
            "an open list belongs to its field"
        )
        await session.press("enter")
        assert session.explained() == (
            "partitioning timeseg",
            explanation("partitioning", "timeseg"),
        )
        session.screen.query_one("#prioritization", Select).value = "random"
        await session.pilot.pause()
        assert session.explained() == (
            "prioritization random",
            explanation("prioritization", "random"),
        )
        session.screen.query_one("#iterations").focus()
        await session.pilot.pause()
        assert session.explained()[0] == "iterations" and session.explained()[1].endswith(
            SETTINGS["iterations"].cost
        )
        # Another scenario brings its own.
        await session.press("f2", "down")
        assert session.explained()[0] == "algorithm probdd"


UNUSED = {
    "ddenv": ([], "", ""),
    "splitting": (["partitioning"], "does not use the partitioning", "Not used by splitting"),
    "ddmin": (
        ["partitioning", "prioritization"],
        "uses neither the partitioning",
        "Not used by ddmin",
    ),
    "probdd": (
        ["partitioning", "prioritization"],
        "uses neither the partitioning",
        "Not used by probdd",
    ),
}


@pytest.mark.screens
async def test_what_the_algorithm_does_not_use_is_dimmed_and_said(scenarios):
    async with Opened() as session:
        for algorithm, (unused, words, beside) in UNUSED.items():
            session.screen.query_one("#algorithm", Select).focus()
            session.screen.query_one("#algorithm", Select).value = algorithm
            await session.pilot.pause()
            assert words in session.explained()[1]
            assert [
                kind for kind in KINDS if session.screen.query_one(f"#{kind}").has_class("-unused")
            ] == unused
            session.screen.query_one("#partitioning").focus()
            await session.pilot.pause()
            assert session.explained()[1].startswith(
                beside or explanation("partitioning", "model2model")
            )


@pytest.mark.screens
async def test_a_long_explanation_scrolls(scenarios):
    async with Opened((64, 18)) as session:
        await session.press("enter", "down", "end", "enter")
        panel = session.screen.query_one("#explained")
        assert session.explained()[0] == "algorithm splitting"
        panel.focus()
        await session.press("pagedown")
        assert panel.scroll_offset.y > 0 and session.explained()[0] == "algorithm splitting"
