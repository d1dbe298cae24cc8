"""Failures other than f that tests met: accepted, listed, reduced in a branch."""

import fake_moments
from attached import Attached
from textual.widgets import OptionList

from ddenv.runfile.failures import atlas
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.widgets.question import Question


async def test_another_failure_is_accepted_after_a_question(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        table = session.screen.query_one(Candidates)
        row = next(each for each in run.state.round.candidates if each.label == "part A")
        while table.under_cursor != row:
            await session.press("up")
        await session.press("a")
        assert isinstance(session.app.screen, Question)
        words = " ".join(session.dialog().split())
        assert (
            "In part A (3 models) the robot tipped over at (2.00, 0.40, 0.20) m, 2.30 m from f's "
            "end."
        ) in words
        assert "In f it got stuck at (2.00, 0.40, 0.20) m." in words
        await session.press("n")
        assert session.asked() == []
        await session.press("a", "y")
        assert session.asked() == [("accept_other", {"test": row.tests[0]})]


async def test_a_branch_reduces_another_failure(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        await session.press("f")
        dialog = session.app.screen
        met = atlas(run.state)
        assert met[0].name in str(dialog.query_one(OptionList).get_option_at_index(0).prompt)
        assert f"{met[0].size} models (test {met[0].smallest})" in str(
            dialog.query_one(OptionList).options[0].prompt
        )
        await session.press("enter")
        assert isinstance(session.app.screen, Question)
        words = " ".join(session.dialog().split())
        assert "Reduce this failure instead of f? The run branches" in words
        await session.press("n")
        assert session.asked() == []
        await session.press("f", "enter", "y")
        assert session.asked() == [("accept_other", {"test": met[0].smallest, "instead": True})]
        assert f"a branch reduces the failure of test {met[0].smallest}" in session.said()
