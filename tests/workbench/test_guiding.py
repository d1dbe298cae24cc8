"""How a run is guided by keys: what each one asks for, what it says, and when it does nothing."""

import subprocess
import sys

import fake_run
import pytest
from attached import Attached, starts
from textual.widgets import Input, OptionList, Select

from ddenv.guiding.commands import data_of
from ddenv.guiding.offers import Pointed, offer
from ddenv.guiding.situation import Situation
from ddenv.runfile.atlas import atlas
from ddenv.runfile.fold import fold
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.shortcuts import commands
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.change import Change
from ddenv.workbench.run.choose import ChooseModels
from ddenv.workbench.run.poll import Poll
from ddenv.workbench.widgets.question import Question
from tests.waiting import eventually


def state_of(run):
    return fold(run.file.events())


async def test_pausing_stepping_and_vetoing(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("space")
        assert session.asked() == [("pause", {})]
        assert "… pause" in session.text("#status")
        run.write("paused")
        run.write("command_handled", command=1)
        await session.look()
        assert "‖ paused" in session.text("#status")
        assert "… pause" not in session.text("#status")
        await session.press("space", "s", "S", "t")
        assert session.asked() == [
            ("resume", {}),
            ("step", {"unit": "test"}),
            ("step", {"unit": "round"}),
            ("accept_mode", {"mode": "ask"}),
        ]
        run.write("accept_mode", mode="ask")
        await session.look()
        assert "accept: ask" in session.text("#status")
        await session.press("t", "a", "x")
        assert session.asked() == [("accept_mode", {"mode": "automatic"})]
        assert "there is nothing to accept" in session.said()
        await session.press("down", "down", "v")
        assert session.asked() == [("veto", {"round": 2, "candidate": 3})]
        assert (
            "without B is vetoed: it is not tried in any round; v again takes that back. Next is part C"
            in session.said()
        )
        run.write("vetoed", candidate=3, verdict="vetoed")
        await session.look()
        await session.press("v")
        assert session.asked() == [("unveto", {"round": 2, "candidate": 3})]
        await session.press("home", "v", "u")
        said = session.said()
        assert "part A is dissimilar already" in said
        assert session.asked() == [("undo", {})]
        assert (
            "part A is taken back. This round ends with 4 candidates untried; a new search begins from 11 models."
            in said
        )
        assert "It does not take these 6 again, in any branch, unless you allow it: v on their row" in said
        await session.press("u")
        assert session.asked() == []
        assert "the last undo is not done yet" in session.said()
        run.write("command_refused", command=session.run.file.commands()[-1].id, why="there is nothing to take back")
        await session.look()
        assert "undo: not done, there is nothing to take back" in session.said()


@pytest.mark.parametrize(("key", "kind"), [("a", "accept"), ("x", "reject")])
async def test_a_and_x_decide_on_the_reduction_that_waits(run, key, kind):
    fake_run.waiting(run).hold()
    async with Attached(run) as session:
        assert "? waiting" in session.text("#status")
        await session.press("s", "v")
        assert "a reduction waits" in session.said()
        await session.press(key)
        assert session.asked() == [(kind, {"round": 1, "candidate": 0})]


async def test_models_are_pinned_and_tried_by_the_map_or_by_name(run):
    fake_run.guided(run).hold()
    async with Attached(run) as session:
        await session.press("p")
        dialog = session.app.screen
        assert isinstance(dialog, ChooseModels)
        await session.press(*"04", "enter")
        assert session.asked() == [("pin", {"models": [4]})]
        assert "crate_04 is pinned, and always stays. This round ends with" in session.said()
        world = session.screen.query_one(WorldMap)
        await session.press("1")
        world.go_to("crate_00")
        await session.press("p")
        assert session.asked() == [("unpin", {"models": [0]})]
        world.select(["crate_02", "crate_03", "crate_01"])
        await session.press("p", "w", "o")
        assert session.asked() == [
            ("pin", {"models": [1, 2, 3]}),
            ("try", {"models": [0, 4]}),
            ("try", {"models": [1, 2, 3]}),
        ]
        assert "try 4: 2 models, only crate_00, crate_04" in session.said()
        world.clear_selection()
        await session.press("2", "w")
        await session.press("tab", "down", "tab", "enter")
        assert session.asked() == [("try", {"models": [2, 3, 4]})]
        await session.press("w", *"nothing", "enter")
        assert isinstance(session.app.screen, ChooseModels)
        assert "no name contains this" in session.dialog()
        await session.press("escape")
        trial = run.try_out(run.elements[2:5])
        test = run.start_hand(trial)
        await session.look()
        session.said()
        run.finish(test, "similar", 0.1, failure="stuck")
        run.judge_trial(trial, "similar", [test])
        await session.look()
        assert session.said() == "try 4 shows f with 3 models: a on its row adopts it"
        run.write("unpinned", models=[0])
        await session.look()
        table = session.screen.query_one(Candidates)
        while getattr(table.under_cursor, "number", 0) != trial:
            await session.press("up")
        await session.press("v", "a")
        assert "only candidates of the round can be vetoed" in session.said()
        assert session.asked() == [("adopt", {"trial": 4})]


async def test_another_failure_is_accepted_after_a_question(run):
    fake_run.guided(run).hold()
    async with Attached(run) as session:
        table = session.screen.query_one(Candidates)
        row = next(each for each in state_of(run).round.candidates if each.label == "part A")
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
    fake_run.guided(run).hold()
    async with Attached(run) as session:
        await session.press("f")
        dialog = session.app.screen
        met = atlas(state_of(run))
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
    fake_run.mid_round(run).hold()
    state = state_of(run)
    async with Attached(run) as session:
        await session.press("f")
        before = session.app.screen.query_one(OptionList).option_count
        assert before == len(atlas(state))
        run.finish(state.running_tests[0].id, "other", 3.0, failure="fell", end=(9.0, 9.0, 0.0))
        await session.look()
        listed = session.app.screen.query_one(OptionList)
        await eventually(lambda: listed.option_count == before + 1)
        assert "fell at (9.00, 9.00)" in str(listed.get_option_at_index(before).prompt)


async def test_settings_are_changed_in_a_dialog_that_checks_them(run):
    fake_run.guided(run).hold()
    async with Attached(run) as session:
        await session.press("c", "ctrl+s")
        dialog = session.app.screen
        assert isinstance(dialog, Change)
        assert "these are the settings already" in session.dialog()
        dialog.query_one("#budget", Input).value = "3"
        await session.press("ctrl+s")
        assert "budget: 15 tests were made already" in session.dialog()
        dialog.query_one("#budget", Input).value = "200"
        dialog.query_one("#iterations", Input).value = "x"
        await session.press("ctrl+s")
        assert "iterations: expected a whole number, found 'x'" in session.dialog()
        dialog.query_one("#iterations", Input).value = "5"
        dialog.query_one("#prioritization", Select).value = "random"
        await session.press("ctrl+s")
        assert session.asked() == [
            ("change", {"settings": {"pair": "model2model/random", "iterations": 5, "budget": 200}})
        ]


async def test_a_run_without_an_engine_is_guided_too(run, monkeypatch):
    started = starts(monkeypatch)
    fake_run.guided(run)
    async with Attached(run) as session:
        await session.press("1")
        session.screen.query_one(WorldMap).select(["crate_02"])
        await session.press("p")
        assert "it waits for an engine, space starts one" in session.said()
        assert not started
        await session.press("u")
        assert "an engine is started for it" in session.said()
        assert session.asked() == [("pin", {"models": [2]}), ("undo", {})]
        assert len(started) == 1


async def test_a_finished_run_goes_on_from_a_try(run, monkeypatch):
    started = starts(monkeypatch)
    fake_run.finished(run)
    async with Attached(run) as session:
        await session.press("r", "space", "s")
        assert session.said().count("the run is finished; u, h, f, c, p, w and o go on from there") == 3
        await session.press("w", *"01", "enter")
        assert session.asked() == [("try", {"models": [0]})]
        assert len(started) == 1


@pytest.mark.parametrize(
    ("make", "shown"),
    [
        (fake_run.waiting, {"pause", "accept", "reject", "try without", "try only"}),
        (fake_run.mid_round, {"pause", "step", "veto", "try without", "try only", "undo"}),
        (fake_run.finished, {"try without", "try only", "undo"}),
    ],
)
async def test_the_footer_offers_what_can_be_done_now(run, make, shown):
    make(run).hold()
    async with Attached(run, (200, 60)) as session:
        footer = {key.words for key in session.screen.query_one(KeyFooter).entries}
        assert footer - {"pin", "history", "settings", "export", "help", "quit", *MORE} == shown


MORE = {"signs", "facts", "rounds", "find", "layers", "copy", "scene", "runs"}


async def test_a_key_that_is_not_possible_is_so_everywhere_and_says_why(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        screen = session.screen

        def enabled():
            return {each.binding.id for each in screen.active_bindings.values() if each.enabled}

        def offered():
            return {each.id for each in commands(screen)}

        assert not {"run.accept", "run.reject", "run.resume"} & enabled()
        assert not {"run.accept", "run.reject", "run.resume"} & offered()
        await session.press("x", "r")
        assert "there is nothing to reject" in session.said()
        assert session.asked() == []
        run.similar(1)
        run.write("waiting", candidate=1)
        await session.look()
        assert {"run.accept", "run.reject"} <= enabled() & offered()
        assert not {"run.step", "run.step_round"} & offered()


def test_a_in_the_footer_says_what_it_would_take(run):
    fake_run.guided(run)
    run.finish(17, "similar", 0.1, failure="stuck")
    run.judge_trial(3, "similar", [17])
    run.write("unpinned", models=[0])
    now = Situation(state_of(run))
    words = [offer("accept", now, Pointed(row)).words for row in now.state.trials]
    assert words == ["", "count as f", "adopt"]


async def test_a_finished_run_is_searched_anew_with_other_pins(run, monkeypatch):
    started = starts(monkeypatch)
    fake_run.finished(run)
    async with Attached(run) as session:
        await session.press("p", *"00", "enter")
        assert (
            "crate_00 is pinned, and always stays. A new search begins from 2 models; an engine is started"
            in session.said()
        )
        assert session.asked() == [("pin", {"models": [0]})]
        assert len(started) == 1


async def test_an_engine_is_started_for_what_the_last_one_did_not_read(run, monkeypatch):
    started = starts(monkeypatch)
    fake_run.guided(run).hold()
    async with Attached(run) as session:
        await session.press("u")
        assert session.asked() == [("undo", {})]
        assert not started
        run.write("finished", minimal=True, reason="no candidate showed f")
        run.let_go()
        await session.look()
        await session.look()
        assert len(started) == 1


async def test_watching_asks_for_nothing(run):
    fake_run.waiting(run).hold()
    async with Attached(run, watch=True) as session:
        assert "watching only" in session.text("#watching")
        await session.press(*"spacesSaxvpwouctr".replace("space", ""), "space")
        assert "'ddenv open crates-1' without --watch" in session.said()
        assert session.app.screen is session.screen
        await session.press("h", "up", "enter")
        assert "watching only" in session.said()
        await session.press("escape")
        assert session.commands() == []
        await session.press("q")
        assert session.app._exit_renderables[0].plain.endswith("ddenv open crates-1 --watch")


async def test_a_run_file_that_is_gone_is_told_and_can_be_left(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        run.let_go()
        run.path.unlink()
        session.screen.following.look()
        await session.pilot.pause()
        assert "was deleted while it was open" in " ".join(session.text("#happening").split())
        await session.press("v", "u")
        assert "the run file is gone" in session.said()
        await session.press("q")
        assert session.app._exit


# Without a screen: what keys mean for a run.


def why_not(action, state, row=None, models=()):
    return offer(action, Situation(state), Pointed(row, models=tuple(models))).why_not


def meant(action, state, row=None, models=()):
    command = offer(action, Situation(state), Pointed(row, models=tuple(models))).command
    return command.kind, data_of(command)


def test_what_a_means_for_a_try(run):
    fake_run.guided(run)
    state = state_of(run)
    adopted, vain, under_way = state.trials
    assert "is the environment already" in why_not("accept", state, adopted)
    assert meant("accept", state, vain)[0] == "accept_other"
    assert "try 3 is not judged yet" in why_not("accept", state, under_way)
    run.finish(*under_way.tests, "similar", 0.1, failure="stuck")
    run.judge_trial(3, "similar", list(under_way.tests))
    state = state_of(run)
    assert "lacks crate_00, which is pinned" in why_not("accept", state, state.trials[2])
    run.write("unpinned", models=[0])
    state = state_of(run)
    assert meant("accept", state, state.trials[2]) == ("adopt", {"trial": 3})


def test_the_nearest_other_failure_is_the_one_to_accept(run):
    run.created().baseline()
    run.start_round(2)
    tests = [run.test(0, "other", away, number, "tipped over") for number, away in enumerate((2.0, 0.5, 3.0))]
    state = state_of(run)
    assert meant("accept", state, state.round.candidates[0]) == ("accept_other", {"test": tests[1], "instead": False})


def test_what_the_cursor_only_follows_is_not_accepted(run):
    run.created().baseline()
    run.start_round(2)
    run.test(0, "other", 2.0, 0, "tipped over")
    state = state_of(run)
    followed = Pointed(state.round.candidates[0], follows=True)
    assert "nothing to accept" in offer("accept", Situation(state), followed).why_not
    run.write("paused")
    assert offer("accept", Situation(state_of(run)), followed).words == "count as f"


def test_models_that_cannot_be_pinned_or_tried(run):
    fake_run.guided(run)
    state = state_of(run)
    assert "floor is protected" in why_not("pin", state, models=["floor"])
    assert "crate_09 is removed already" in why_not("pin", state, models=["crate_09"])
    assert "nothing is left out" in why_not("without", state, models=["crate_09"])
    assert "nothing is left out" in why_not("only", state, models=state.environment)
    assert meant("only", state, models=["crate_09", "crate_01"]) == ("try", {"models": [1, 9]})
    assert meant("without", state, models=state.environment) == ("try", {"models": []})


def test_before_f_is_known_nothing_is_tried_or_undone(run):
    run.created()
    state = state_of(run)
    assert "the baseline comes first" in why_not("only", state, models=["crate_01"])
    assert "no reduction to take back" in why_not("undo", state)
    assert meant("pin", state, models=["crate_01"]) == ("pin", {"models": [1]})
    assert "no candidates yet" in why_not("veto", state)


def test_a_round_that_is_over_cannot_be_vetoed(run):
    state = state_of(fake_run.certifying(run))
    assert why_not("veto", state) == "the rounds are over"
    run.write("finished", minimal=True, reason="no candidate showed f")
    state = state_of(run)
    assert why_not("veto", state, state.round.candidates[0]) == "this round is over"


# Holds a run file open as an engine does, in a process of its own.
WRITER = """
import sys
from pathlib import Path
from ddenv.runfile.store import RunFile
file = RunFile(Path(sys.argv[1]))
file.own()
file.append("paused", {})
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_command_is_written_while_another_program_has_the_run_file_open(run):
    fake_run.mid_round(run).close()
    words = [sys.executable, "-c", WRITER, str(run.path)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        assert writer.stdout.readline() == b"ready\n"
        poll = Poll(run.path)
        assert poll.look().state.paused
        assert poll.file.send("resume") == 1
        poll.close()
        writer.stdin.close()
