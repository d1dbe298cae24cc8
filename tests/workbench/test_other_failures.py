"""Failures other than f that tests met: accepted, listed, reduced in a branch."""

import fake_moments
from attached import Attached
from textual.widgets import OptionList

from ddenv.runfile.failures import atlas
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.widgets.question import Question
from tests.waiting import eventually


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
        assert "In part A (3 models) the robot tipped over at (2.00, 0.40, 0.20) m, 2.30 m from f's end." in words
        assert "In f it got stuck at (2.00, 0.40, 0.20) m." in words
        await session.press("n")
        assert session.asked() == []
        await session.press("a", "y")
        assert session.asked() == [("accept_other", {"test": row.tests[0], "instead": False})]


async def test_a_branch_reduces_another_failure(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        await session.press("f")
        dialog = session.app.screen
        met = atlas(run.state)
        assert met[0].name in str(dialog.query_one(OptionList).get_option_at_index(0).prompt)
        assert f"{met[0].size} models (test {met[0].smallest}): " in session.dialog()
        assert "f: stuck at (2.00, 0.40)" in session.dialog()
        await session.press("enter")
        assert isinstance(session.app.screen, Question)
        words = " ".join(session.dialog().split())
        assert "Reduce this failure in place of f? The run branches" in words
        await session.press("n")
        assert session.app.screen is dialog
        await session.press("enter", "y")
        assert session.asked() == [("accept_other", {"test": met[0].smallest, "instead": True})]
        assert f"a branch reduces the failure of test {met[0].smallest}" in session.said()


async def test_the_other_failures_follow_the_run(run):
    fake_moments.mid_round(run).hold()
    state = run.state
    async with Attached(run) as session:
        await session.press("f")
        before = session.app.screen.query_one(OptionList).option_count
        assert before == len(atlas(state))
        run.finish(state.running_tests[0].id, "other", 3.0, failure="fell", end=(9.0, 9.0, 0.0))
        await session.look()
        listed = session.app.screen.query_one(OptionList)
        await eventually(lambda: listed.option_count == before + 1)
        assert "fell at (9.00, 9.00)" in str(listed.get_option_at_index(before).prompt)
