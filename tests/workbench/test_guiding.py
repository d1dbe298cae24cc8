"""How a run is guided by keys: what each one asks for, what it says, and when it does nothing."""

import subprocess
import sys

import fake_moments
import pytest
from attached import Attached
from textual.widgets import Input, Select

from ddenv.guiding import commands as asks
from ddenv.guiding.commands import question
from ddenv.workbench.help.shortcuts import commands
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.change import Change
from ddenv.workbench.run.choose import ChooseModels
from ddenv.workbench.run.dialogs import Quit
from ddenv.workbench.shared.poll import Poll
from ddenv.workbench.widgets.question import Question
from tests.waiting import eventually


async def test_pausing_stepping_and_vetoing(run):
    fake_moments.mid_round(run).hold()
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
            ("step", {}),
            ("step", {"unit": "round"}),
            ("accept_mode", {"mode": "ask"}),
        ]
        run.write("accept_mode_changed", mode="ask")
        await session.look()
        assert "accept: ask" in session.text("#status")
        await session.press("t", "a", "x")
        assert session.asked() == [("accept_mode", {"mode": "automatic"})]
        assert "there is nothing to accept" in session.said()
        await session.press("down", "down", "v")
        assert session.asked() == [("veto", {"round": 2, "candidate": 3})]
        assert (
            "without B is vetoed: it will not be tried in any round; v again undoes that"
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
        assert "part A is taken back. A new search begins from 11 models." in said
        assert (
            "It will not reduce to these 6 again, in any branch, unless you allow it: v on their "
            "row"
        ) in said
        await session.press("u")
        assert session.asked() == []
        assert "the last undo is not done yet" in session.said()
        run.write(
            "command_refused",
            command=session.run.file.commands()[-1].id,
            why="there is nothing to take back",
        )
        await session.look()
        assert "undo: not done, there is nothing to take back" in session.said()


@pytest.mark.parametrize(("key", "kind"), [("a", "accept"), ("x", "reject")])
async def test_a_and_x_decide_on_the_reduction_that_waits(run, key, kind):
    fake_moments.waiting(run).hold()
    async with Attached(run) as session:
        assert "? waiting" in session.text("#status")
        await session.press("s", "v")
        assert "a reduction waits" in session.said()
        await session.press(key)
        assert session.asked() == [(kind, {"round": 1, "candidate": 0})]


@pytest.mark.parametrize(
    ("answer", "first"),
    [("a", ["accept"]), ("d", []), ("escape", None)],
    ids=["accept", "drop", "cancel"],
)
async def test_a_new_search_asks_first_what_becomes_of_the_reduction_that_waits(run, answer, first):
    fake_moments.waiting(run).hold()
    pin = ("pin", {"models": [4]})
    async with Attached(run) as session:
        await session.press("p", "slash", *"04", "enter")
        assert "Part A shows f and waits for you (11 → 4 models)" in session.dialog()
        assert session.asked() == []
        await session.press(answer)
        decided = (
            []
            if first is None
            else [*((kind, {"round": 1, "candidate": 0}) for kind in first), pin]
        )
        assert session.asked() == decided
        if answer == "d":
            run.write("pinned", models=[4])
            await session.look()
            happening = session.text("#happening")
            assert "Pinned crate_04." in happening
            assert "No candidate showed f in the last" not in happening


async def test_models_are_pinned_and_tried_by_the_map_or_by_name(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        await session.press("p")
        dialog = session.app.screen
        assert isinstance(dialog, ChooseModels)
        world = session.screen.query_one(WorldMap)
        await session.press("down", "down")
        # The model under the cursor is marked on the map.
        assert world.aims and world.model_at_cursor == "crate_02"
        await session.press("slash", *"04", "enter")
        assert not world.aims
        assert session.asked() == [("pin", {"models": [4]})]
        assert (
            "pinned, so that it always stays: crate_04. A new search begins from" in session.said()
        )
        await session.press("1")
        world.go_to("crate_00")
        # On the map it is the same list, with what is pointed at.
        await session.press("p")
        assert "1 model chosen" in session.dialog()
        await session.press("enter")
        assert session.asked() == [("unpin", {"models": [0]})]
        world.select(["crate_02", "crate_03", "crate_01"])
        await session.press("p", "enter", "w", "o")
        assert session.asked() == [
            ("pin", {"models": [1, 2, 3]}),
            ("try", {"models": [0, 4]}),
            ("try", {"models": [1, 2, 3]}),
        ]
        assert "try 4: 2 models, only crate_00, crate_04" in session.said()
        world.select(())
        await session.press("2", "w")
        await session.press("space", "down", "space", "enter")
        assert session.asked() == [("try", {"models": [2, 3, 4]})]
        await session.press("w", "slash", *"nothing", "enter")
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
        run.write("unpinned", models=[0])
        await session.look()
        table = session.screen.query_one(Candidates)
        while getattr(table.under_cursor, "number", 0) != trial:
            await session.press("up")
        await session.press("v", "a")
        assert "only candidates of the round can be vetoed" in session.said()
        assert session.asked() == [("adopt", {"trial": 4})]


async def test_what_breaks_off_a_certificate_asks_before(run):
    fake_moments.certifying(run).hold()
    async with Attached(run, (80, 24)) as session:
        assert "17 of about 30 to 400 runs" in str(
            session.screen.query_one("#round").border_subtitle
        )
        await session.press("p", "enter")
        assert isinstance(session.app.screen, Question)
        assert "aborts certificate 1 after 17 runs" in session.dialog()
        await session.press("n", "v")
        assert session.asked() == []
        assert "the rounds are over" in session.said()
        await session.press("u")
        assert isinstance(session.app.screen, Question)
        await session.press("escape", "p", "enter", "y")
        assert session.asked() == [("pin", {"models": [0]})]
        assert "A new search begins from 2 models" in session.said()
        # The budget alone breaks nothing off.
        state = session.screen.snapshot.state
        assert question(asks.Change({"budget": 900}), state) == ""
        assert "aborts" in question(asks.Change({"iterations": 9}), state)


async def test_a_notice_waits_until_a_dialog_is_closed_and_goes_at_the_next_key(run):
    fake_moments.mid_round(run).hold()
    async with Attached(run, (80, 24), notices=True) as session:
        await session.press("q")
        assert isinstance(session.app.screen, Quit)
        for number in range(5):
            session.screen.asking.say(f"notice {number}")
        await session.pilot.pause()
        assert session.said() == "" and not session.app.screen.query("Toast")
        await session.press("escape")
        # The latest one is enough: the log has all.
        assert session.said() == "notice 4"
        await eventually(lambda: len(session.screen.query("Toast")) == 1)
        await session.press("down")
        await eventually(lambda: not session.screen.query("Toast"))


async def test_settings_are_changed_in_a_dialog_that_checks_them(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        await session.press("c", "ctrl+s")
        dialog = session.app.screen
        assert isinstance(dialog, Change)
        assert "these are the settings already" in session.dialog()
        dialog.query_one("#budget", Input).value = "3"
        await session.press("ctrl+s")
        assert "budget: 15 tests were made already" in session.dialog()
        dialog.query_one("#iterations", Input).value = "x"
        await session.press("ctrl+s")
        assert "iterations: expected a whole number, found 'x'" in session.dialog()
        dialog.query_one("#budget", Input).value = "200"
        dialog.query_one("#iterations", Input).value = "5"
        dialog.query_one("#prioritization", Select).value = "random"
        await session.press("ctrl+s")
        assert session.asked() == [
            ("change", {"settings": {"pair": "model2model/random", "iterations": 5, "budget": 200}})
        ]


async def test_a_run_without_an_engine_is_guided_too(run, started):
    fake_moments.guided(run)
    async with Attached(run) as session:
        await session.press("1")
        session.screen.query_one(WorldMap).select(["crate_02"])
        await session.press("p", "enter")
        assert "it waits for an engine, space starts one" in session.said()
        assert not started
        await session.press("u")
        assert "an engine starts for it" in session.said()
        assert session.asked() == [("pin", {"models": [2]}), ("undo", {})]
        assert len(started) == 1


async def test_a_finished_run_goes_on_from_a_try(run, started):
    fake_moments.finished(run)
    async with Attached(run) as session:
        await session.press("r", "space", "s")
        assert (
            session.said().count("the run is finished; u, h, f, c, p, w and o continue from here")
            == 3
        )
        await session.press("w", *"01", "enter")
        assert session.asked() == [("try", {"models": [0]})]
        assert len(started) == 1


async def test_one_key_leaves_out_the_model_that_only_helps(run, started):
    fake_moments.helped(run)
    async with Attached(run) as session:
        assert "Minimal but for crate_01" in session.text("#happening")
        assert "crate_01 only helps: press H to leave it out" in " ".join(
            session.text("#happening").split()
        )
        await session.press("H")
        assert session.asked() == [("leave_out", {"model": 1})]
        assert (
            "crate_01 is left out. A new search begins from 1 model; an engine starts for it"
            in session.said()
        )
        run.hold()
        run.write("engine_started", pid=2, jobs=2, version="0", simulator="none")
        fresh = next(
            test
            for test in run.state.confirm_tests
            if test.without == "crate_01" and test.outcome == "similar"
        )
        run.write("left_out", without=1, environment=[0], evidence_test=fresh.id, by_user=True)
        await session.look()
        assert "crate_01, which only helped." in session.text("#happening")
        await session.press("H")
        assert session.asked() == []
        assert "no certificate shows a model that only helps" in session.said()


async def test_a_list_of_models_brings_the_map_to_a_small_terminal(run):
    fake_moments.guided(run).hold()
    async with Attached(run, (80, 24)) as session:
        await session.press("2")
        world = session.screen.query_one(WorldMap)
        assert not world.is_on_screen
        await session.press("p", "down")
        assert world.is_on_screen and world.aims and world.model_at_cursor == "crate_01"


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (
            fake_moments.isolating,
            "I works once the search for a world that passes is over; i stops it",
        ),
        (fake_moments.mid_round, "I works once the reduction is over"),
    ],
)
async def test_no_run_inside_begins_before_all_is_over(run, make, why):
    make(run).hold()
    async with Attached(run) as session:
        await session.press("I")
        assert session.said() == why


async def test_a_key_that_is_not_possible_is_so_everywhere_and_says_why(run):
    fake_moments.mid_round(run).hold()
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


async def test_an_engine_is_started_for_what_the_last_one_did_not_read(run, started):
    fake_moments.guided(run).hold()
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
    fake_moments.waiting(run).hold()
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
    fake_moments.mid_round(run).hold()
    async with Attached(run) as session:
        run.let_go()
        run.path.unlink()
        session.screen.look()
        await session.pilot.pause()
        assert "was deleted while it was open" in " ".join(session.text("#happening").split())
        await session.press("v", "u")
        assert "the run file is gone" in session.said()
        await session.press("q")
        assert session.app._exit


# Holds a run file open as an engine does, in a process of its own.
WRITER = """
import sys
from pathlib import Path
from ddenv.runfile.events import Paused
from ddenv.runfile.store import RunFile
file = RunFile(Path(sys.argv[1]))
file.own()
file.append(Paused())
print("ready", flush=True)
sys.stdin.read()
"""


def test_a_command_is_written_while_another_program_has_the_run_file_open(run):
    fake_moments.mid_round(run).close()
    words = [sys.executable, "-c", WRITER, str(run.path)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        assert writer.stdout.readline() == b"ready\n"
        poll = Poll(run.path)
        assert poll.look().state.paused
        assert poll.file.send("resume") == 1
        poll.close()
        writer.stdin.close()
