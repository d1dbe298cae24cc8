"""The rules of what may be decided: the engine obeys what they allow, and refuses the rest in the
same words.
"""

import tempfile
import threading
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ddenv.engine.control import _EVENTS, Control, Stopped
from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.guiding.commands import (
    KINDS,
    Context,
    GoBack,
    Pause,
    Resume,
    StartEngine,
    Step,
    Stop,
    Undo,
    parse,
    refusal,
    send,
    written,
)
from ddenv.guiding.key_offers import ACTIONS, Pointed, offer
from ddenv.runfile.store import RunFile
from ddenv.workbench.run.run_keys import GUIDING
from ddenv.workbench.run.run_screen import RunScreen
from tests.engine.fake import ELEMENTS, new_run
from tests.engine.guided import COMMANDS, Disturbed, at_once
from tests.engine.killing import killed
from tests.engine.oracles import flaky
from tests.tiers import examples

__all__ = ["at_once"]

# As they stand in run files.
WRITTEN = [
    ("pause", {}),
    ("resume", {}),
    ("step", {}),
    ("step", {"unit": "round"}),
    ("accept", {"round": 1, "candidate": 0}),
    ("reject", {"round": 1, "candidate": 0}),
    ("accept_mode", {"mode": "ask"}),
    ("veto", {"round": 2, "candidate": 3}),
    ("unveto", {"round": 2, "candidate": 3}),
    ("pin", {"models": [1, 2]}),
    ("unpin", {"models": [1]}),
    ("try", {"models": []}),
    ("adopt", {"trial": 1}),
    ("leave_out", {"model": 1}),
    ("accept_other", {"test": 7}),
    ("accept_other", {"test": 7, "instead": True}),
    ("undo", {}),
    ("go_back", {"node": 0}),
    ("change", {"settings": {"budget": None, "iterations": 2}}),
    ("stop", {}),
]
ANY = st.one_of(
    COMMANDS,
    st.sampled_from([each for each in WRITTEN if each[0] != "stop"]),
    st.tuples(
        st.sampled_from(["accept", "reject"]),
        st.fixed_dictionaries({"round": st.integers(1, 3), "candidate": st.integers(0, 2)}),
    ),
)


def test_each_command_is_written_as_it_is_read():
    assert {kind for kind, _ in WRITTEN} == set(KINDS)
    for kind, data in WRITTEN:
        assert written(parse(kind, data)) == (kind, data)


def test_the_engine_knows_what_to_do_for_each_command():
    # It carries these out itself; of each other one it writes the event.
    assert {Pause, Resume, Step, Stop, Undo, GoBack} | set(_EVENTS) == set(KINDS.values())


@pytest.mark.parametrize(
    ("kind", "data", "why"),
    [
        ("dance", {}, "there is no command 'dance'"),
        ("veto", {"round": 1}, "no such candidate: is missing"),
        (
            "veto",
            {"round": True, "candidate": 0},
            "no such round: should be a valid integer, found True",
        ),
        ("pin", {"models": "wall"}, "no such models: should be a valid array, found 'wall'"),
        ("try", {"models": [True]}, "no such models: 0: should be a valid integer, found True"),
        ("step", {"unit": "year"}, "no such unit: should be 'test' or 'round', found 'year'"),
        ("accept_mode", {"mode": "no"}, "no such mode: should be 'automatic' or 'ask', found 'no'"),
        ("change", {"settings": []}, "no such settings: should be an object, found []"),
    ],
)
def test_data_that_makes_no_sense_is_no_command(kind, data, why):
    with pytest.raises(UserError) as refused:
        parse(kind, data)
    assert str(refused.value) == why


def begun(folder, salt, plan, moment, mode):
    """The file of a run that was guided by `plan` until its engine was killed after so many
    events.
    """
    path, plan = new_run(Path(folder)), sorted(plan, key=lambda one: one[0])
    pool = Disturbed(path, flaky(salt, "wall", "beam"), 2, plan, salt)
    with closing(pool.viewer):
        killed(path, pool, [moment], accept_mode=mode)
    return path


RUNS = {
    "salt": st.integers(0, 3),
    "plan": st.lists(st.tuples(st.integers(0, 20), COMMANDS), max_size=4),
    "moment": st.integers(3, 90),
}


@examples(0.3)
@given(**RUNS, mode=st.sampled_from(["automatic"]), asked=st.lists(ANY, min_size=1, max_size=6))
@example(salt=0, plan=[], moment=3, mode="automatic", asked=[("accept_mode", {"mode": "ask"})] * 2)
def test_the_engine_obeys_what_the_rules_allow_and_refuses_the_rest_in_their_words(
    salt, plan, moment, mode, asked
):
    with tempfile.TemporaryDirectory() as folder:
        path = begun(folder, salt, plan, moment, mode)
        with RunFile(path) as file:
            file.own()
            journal = Journal(file)
            control = Control(journal, threading.Event())
            for kind, data in asked:
                before = journal.state
                why = refusal(parse(kind, data), Context(before))
                command = file.send(kind, **data)
                control.poll()
                after = journal.state
                assert after.last_command == command
                if why:
                    assert after.refusal == (command, why)
                    assert after.decisions == before.decisions
                else:
                    assert after.refusal == before.refusal
                    decided = kind not in ("pause", "resume", "step", "accept_mode")
                    # The mode of now, asked for again, is no decision.
                    decided |= after.accept_mode != before.accept_mode
                    assert len(after.decisions) == len(before.decisions) + decided


@examples(0.3)
@given(
    **RUNS,
    models=st.sets(st.sampled_from(ELEMENTS), max_size=3),
    follows=st.booleans(),
    row=st.integers(0, 9),
)
def test_what_a_key_offers_is_what_the_engine_obeys(salt, plan, moment, models, follows, row):
    with tempfile.TemporaryDirectory() as folder:
        path = begun(folder, salt, plan, moment, "automatic")
        with RunFile(path) as file:
            file.own()
            state = Journal(file).state
            rows = [*(state.round.candidates if state.round else ()), *state.trials, None]
            pointed = Pointed(
                rows[row % len(rows)], follows, tuple(name for name in ELEMENTS if name in models)
            )
            for action in ACTIONS:
                offered = offer(action, Context(state), pointed)
                if offered.command is None or isinstance(offered.command, StartEngine):
                    continue
                assert not offered.why_not
                journal = Journal(file)
                if offer(action, Context(journal.state), pointed) != offered:
                    continue
                command = send(file, offered.command)
                Control(journal, threading.Event()).poll()
                assert journal.state.refusal[0] != command


@examples(0.3)
@given(
    **RUNS,
    models=st.sets(st.sampled_from(ELEMENTS), max_size=3),
    engine=st.sampled_from(["alive", "starting", "absent"]),
    barred=st.sampled_from(["", "watching only"]),
)
def test_the_footer_offers_what_the_rules_allow(salt, plan, moment, models, engine, barred):
    with tempfile.TemporaryDirectory() as folder:
        with RunFile(begun(folder, salt, plan, moment, "automatic")) as file:
            state = Journal(file).state
        now = Context(state, engine, barred)
        said, pointed = {}, Pointed(models=tuple(models))
        footer = SimpleNamespace(say=said.__setitem__, is_attached=True)
        screen = SimpleNamespace(
            pointed=pointed, asking=SimpleNamespace(situation=now), _footer=footer
        )
        screen.poll = SimpleNamespace(watch=False)
        RunScreen._show_keys(screen)
        for action, binding in GUIDING.items():
            offered = offer(action, now, pointed)
            assert bool(said[binding.id]) == (not offered.why_not)
            if offered.command is not None:
                assert refusal(offered.command, now) == ""
            assert not barred or offered.why_not == barred


def test_a_stop_is_obeyed_once(tmp_path):
    path = new_run(tmp_path)
    with RunFile(path) as file:
        file.own()
        journal = Journal(file)
        control = Control(journal, threading.Event())
        command = file.send("stop")
        with pytest.raises(Stopped):
            control.poll()
        assert journal.state.last_command == command
