"""A run that needs a look rings and sends one notification; the title shows how far it is."""

import fake_moments
import pytest
from attached import Attached

from ddenv.workbench.app import BELL, Config, Workbench, attention


@pytest.mark.parametrize(
    ("environment", "sent"),
    [
        ({"TERM": "xterm-256color"}, "\x1b]9;ddenv: 2 left, really\x1b\\"),
        (
            {"TERM": "xterm-256color", "VTE_VERSION": "7600"},
            "\x1b]777;notify;ddenv;2 left, really\x1b\\",
        ),
        ({"TERM": "rxvt-unicode"}, "\x1b]777;notify;ddenv;2 left, really\x1b\\"),
    ],
)
def test_a_terminal_is_sent_one_notification_that_no_name_can_break(environment, sent):
    assert attention("ddenv", "2 left; really", environment) == BELL + sent
    control = attention("a\x1b]0;x\x07", "b\x1b\\\n", environment)[1:]
    assert control.count("\x1b") == 2
    assert BELL not in control


@pytest.fixture
def sent(monkeypatch):
    """What the terminal is sent."""
    written = []
    monkeypatch.setattr(Workbench, "_write", lambda _, sequence: written.append(sequence))
    return lambda: [each for each in written if each.startswith(BELL)]


async def test_the_end_of_a_run_is_noticed_once_and_only_if_it_is_seen(run, sent):
    fake_moments.mid_round(run).hold()
    async with Attached(run) as session:
        assert sent() == []
        assert session.app.title == "▶ 5 % crates: 6 of 11 models"
        run.finish(11, "pass")
        await session.look()
        assert sent() == []
        run.write("finished", minimal=False, reason="the search is over")
        run.let_go()
        await session.look()
        await session.pilot.pause()
        (one,) = sent()
        assert "ddenv crates-1: 6 of 11 models left, the search is over" in one
        assert session.app.title == "■ crates: 6 of 11 models, finished"
    async with Attached(run):
        assert len(sent()) == 1


async def test_a_reduction_that_waits_is_noticed(run, sent):
    run.created().baseline().hold()
    run.start_round(3)
    async with Attached(run) as session:
        run.write("accept_mode_changed", mode="ask")
        run.similar(0)
        run.write("waiting", candidate=0)
        await session.look()
        await session.pilot.pause()
        assert "waits for you" in sent()[0]


async def test_who_does_not_want_it_is_left_alone(run, sent):
    fake_moments.mid_round(run).hold()
    app = Workbench(run.path, config=Config(notify=False))
    async with app.run_test() as pilot:
        await app.workers.wait_for_complete()
        run.write("finished", minimal=False, reason="")
        app.screen.look()
        await pilot.pause()
        assert sent() == []
