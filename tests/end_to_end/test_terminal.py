"""The workbench in a real terminal: tmux, which is killed in the middle of a run."""

import pytest

from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
from tests.conftest import DATA
from tests.end_to_end.terminal import state_of
from tests.waiting import wait_until


@pytest.mark.terminal
@pytest.mark.parametrize(
    ("width", "height"), [pytest.param(120, 36), pytest.param(80, 24, marks=pytest.mark.witness)]
)
def test_pause_step_accept_and_a_killed_terminal(terminal, tmp_path, width, height):
    first = terminal(width, height, "run", DATA / "wall.yaml", "--name", "one", "--jobs", "1")
    first.see("baseline")
    run = tmp_path / "runs" / "one.ddenv"
    with RunFile(run) as viewer:
        viewer.send("pause")
    first.kill()

    bench = terminal(width, height, "open", "one")
    bench.see("paused")
    assert engine_is_alive(run)
    bench.press("t")
    bench.see("accept: ask")
    wait_until(lambda: not any(test.outcome == "running" for test in state_of(run).tests))
    before = len(state_of(run).finished_tests)
    bench.press("s")
    bench.see(f"‖ paused   {before + 1} test")
    bench.press("Space")
    bench.see("a accepts it")
    bench.press("a")
    wait_until(lambda: len(state_of(run).environment) < 6)

    made = len(state_of(run).finished_tests)
    bench.kill()
    # The engine goes on.
    wait_until(
        lambda: (
            len(state_of(run).finished_tests) > made
            or state_of(run).status in ("waiting", "finished")
        )
    )
    assert engine_is_alive(run) or state_of(run).status == "finished"
    again = terminal(width, height, "open", "one")
    again.see("The reduction waits for you")
    again.press("t")
    again.see("finished")
    assert set(state_of(run).environment) == {"deck", "wall"}
    again.press("q")


@pytest.mark.terminal
def test_the_first_screen_offers_the_ditch(terminal):
    setup = terminal(80, 24)
    screen = setup.see("ditch")
    assert "ditch" in screen
    assert "43 models" in setup.see("43 models")
    setup.press("q")
