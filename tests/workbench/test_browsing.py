"""Earlier moments of a run on the screen, the facts of its tests, and what its signs mean."""

import subprocess
import sys

import fake_moments
import pytest
from attached import Attached
from textual.widgets import OptionList

from ddenv.runfile.reading import Invalid, read
from ddenv.runfile.tested import Wanted
from ddenv.words.signs import CLAIM, OUTCOME, STATUS, VERDICT
from ddenv.workbench.help.signs import SignsDialog, signs
from ddenv.workbench.map.map_words import LEGEND, MORE_SIGNS
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.facts import FactsDialog
from ddenv.workbench.widgets.lines import Lines
from tests.tiers import slow
from tests.waiting import eventually


@pytest.mark.parametrize("watch", slow(pytest.mark.screens, [False, True], but=[True]))
async def test_map_table_and_explanation_show_an_earlier_round_until_escape(run, watch):
    fake_moments.finished(run)
    async with Attached(run, watch=watch) as session:
        table, world = session.screen.query_one(Candidates), session.screen.query_one(WorldMap)
        await session.press("less_than_sign", "less_than_sign")
        assert "round 2" in session.text("#header")
        assert table.words(0)["verdict"] == "● similar"
        assert world.shown.candidate.label == "part A"
        assert world.snapshot.state.environment == tuple(run.elements[:2])
        assert "reduced to 2 models after 6 tests" in session.text("#happening")
        assert "◂ moment 22 of 182" in session.text("#status")
        await session.press("comma", "comma", "comma")
        assert len(world.snapshot.state.environment) == 6
        assert "test 6 (round 2 · part A, seed 0) starts" in session.text("#happening")
        assert table.words(0)["verdict"] == ""
        await session.press("space", "v", "u")
        assert session.commands() == []
        assert "this is an earlier moment" in session.said() or watch
        await session.press("escape")
        assert "finished" in session.text("#status")
        assert session.screen.snapshot is session.screen.poll.snapshot


@pytest.mark.screens
async def test_the_log_ends_with_the_moment_that_is_shown(run):
    fake_moments.finished(run).hold()
    async with Attached(run, size=(200, 60)) as session:
        log = session.screen.query_one("#log", Lines)
        whole = list(log.items)
        await session.press("less_than_sign", "less_than_sign")
        assert [entry.words for entry in log.items][-1] == "  reduced to 2 models after 6 tests"
        assert list(log.items) == whole[: len(log.items)] and len(log.items) < len(whole)
        await session.press("comma")
        assert "reduced to 2 models" not in log.items[-1].words
        await session.press("escape")
        assert log.items == whole


async def test_the_moment_stays_while_the_run_goes_on_and_the_last_step_comes_back_to_it(run):
    fake_moments.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("left_parenthesis")
        assert "part A (2 models): dissimilar" in session.text("#happening")
        shown = session.screen.snapshot
        run.finish(11, "pass")
        run.start(3)
        await session.look()
        assert session.screen.snapshot is shown
        assert "of 33" in session.text("#status")
        await session.press("right_parenthesis")
        assert session.screen.snapshot.state.revision == session.screen.poll.snapshot.state.revision
        await session.press("greater_than_sign")
        assert "this is now already" in session.said()
        await session.press("left_curly_bracket", "left_curly_bracket")
        assert "there is no reduction before this moment" in session.said()


@pytest.mark.screens
async def test_b_lists_the_rounds_and_goes_to_the_end_of_one(run):
    fake_moments.finished(run)
    async with Attached(run, size=(80, 24)) as session:
        await session.press("b")
        options = session.app.screen.query_one(OptionList)
        rows = [
            str(options.get_option_at_index(row).prompt).split()
            for row in range(options.option_count)
        ]
        assert [row[:3] for row in rows[:3]] == [
            ["baseline", "11", "0"],
            ["round", "1", "11"],
            ["round", "2", "6"],
        ]
        assert [row[-4:] for row in rows[1:4]] == [
            ["●", "6", "4", "tests"],
            ["●", "2", "5", "tests"],
            ["○", "2", "6", "tests"],
        ]
        await session.press("home", "down", "enter")
        assert "round 1" in session.text("#header")


async def test_i_shows_the_facts_of_a_test_of_a_round_that_is_over(run):
    fake_moments.finished(run)
    async with Attached(run) as session:
        await session.press("less_than_sign", "less_than_sign", "F")
        dialog = session.app.screen
        assert isinstance(dialog, FactsDialog)
        words = session.dialog()
        for said in (
            "● similar: stuck",
            "0.12 m from the end of f",
            "2 of 11 models: crate_00, crate_01",
            "45.0 s  ●",
        ):
            assert said in words
        assert "part A of round 2: similar, tests 6" in words
        await session.press("c")
        assert session.app.clipboard == "ddenv test crates-1 --test 6"
        await session.press("left", "left")
        assert "11 of 11 models" in session.dialog()
        await session.press(*["left"] * 9)
        assert "Test 1 of 83" in str(dialog.query_one(".dialog").border_title)


async def test_every_sign_has_its_meaning_one_key_away(run):
    shown = {sign for group in signs().values() for sign, _ in group}
    for words in (*OUTCOME.values(), *VERDICT.values(), *CLAIM.values()):
        assert words[0] in shown
    assert shown >= {sign for sign, _ in (*LEGEND, *MORE_SIGNS, *STATUS.values())}
    on_map = [sign for sign, _ in signs()["On the map"]]
    assert len(set(on_map)) == len(on_map)
    fake_moments.finished(run)
    async with Attached(run, size=(80, 24)) as session:
        await session.press("k")
        assert isinstance(session.app.screen, SignsDialog)


async def test_the_scene_follows_the_chosen_row_and_the_moment(run, monkeypatch, tmp_path):
    told = tmp_path / "told"
    code = "import sys; print('http://127.0.0.1:7000/', flush=True)\n"
    code += f"for line in sys.stdin: open({str(told)!r}, 'a').write(line)"
    pipe = subprocess.PIPE
    words = [sys.executable, "-u", "-c", code]
    monkeypatch.setattr(
        "ddenv.runs.programs.start_scene",
        lambda _: subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True),
    )
    fake_moments.mid_round(run).hold()
    async with Attached(run) as session:
        last = lambda: read(Wanted, told.read_text().splitlines()[-1]) if told.exists() else None  # noqa: E731
        await session.press("m")
        await session.app.workers.wait_for_complete()
        await session.press("escape", "down", "down")
        at = session.screen.query_one(Candidates).under_cursor.index
        await eventually(lambda: last() == Wanted(None, 2, at))
        await session.press("escape", "left_curly_bracket")
        moment = session.screen.browsing.position.at
        await eventually(lambda: last() == Wanted(moment, 1, 0))


def test_lines_that_are_no_wish_are_no_wish():
    for line in ("", "nonsense", "[1]", '{"at": "x"}', '{"at": true}', '{"other": 1}'):
        with pytest.raises(Invalid):
            read(Wanted, line)
