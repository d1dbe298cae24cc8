"""Tests played back on the map: the robot moves with the time, frame by frame, alone or over
another test, by keys and mouse.
"""

from array import array

import fake_moments
import fake_run
import pytest
from attached import Attached
from textual.events import MouseScrollDown
from textual.widgets import OptionList

from ddenv.map.raster import ARROWS, HOLLOW
from ddenv.workbench.map.map_words import legend
from ddenv.workbench.playback import playback_screen
from ddenv.workbench.playback.met import Met
from ddenv.workbench.playback.playback_screen import SPEEDS, Playback, Playing, others
from ddenv.workbench.playback.timeline import NOW, Timeline
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.why.why_screen import WhyScreen


def robots(screen):
    """The signs of the robots on the map, and their cells."""
    text = [screen.map._canvas.text(row) for row in range(screen.map.size.height)]
    signs = ARROWS + HOLLOW
    return {
        (char, (y, x))
        for y, line in enumerate(text)
        for x, char in enumerate(line)
        if char in signs
    }


async def settled(session):
    await session.app.workers.wait_for_complete()
    await session.pilot.pause()
    return session.app.screen


@pytest.fixture
def two_ways(run):
    """Without crate_00 the run of the same seed ends sooner."""
    return fake_moments.faster_without(run)


async def test_the_row_under_the_cursor_is_played_and_the_robot_moves(two_ways):
    async with Attached(two_ways) as session:
        await session.press("2", "home", "P")
        screen = await settled(session)
        assert isinstance(screen, Playback)
        before = robots(screen)
        await session.press("right", "right", "full_stop", "full_stop", "full_stop", "comma")
        assert screen.playing.time == pytest.approx(2.2)
        await session.press("end")
        assert screen.playing.time == 45.0
        assert robots(screen) != before
        await session.press("home")
        assert robots(screen) == before
        await session.press("escape")
        assert isinstance(session.app.screen, RunScreen)
        # A certificate's row without a model is played over its partner.
        await session.press("down", "P")
        first, second = (one.test for one in (await settled(session))._tests)
        assert (first.without, second.without, first.seed) == (None, "crate_00", second.seed)


async def test_time_goes_on_by_the_clock_at_the_chosen_speed_and_stops_at_the_end(
    two_ways, monkeypatch
):
    clock = [0.0]
    monkeypatch.setattr(playback_screen, "now", lambda: clock[0])
    async with Attached(two_ways) as session:
        await session.press("P")
        screen = await settled(session)
        await session.press("less_than_sign", "less_than_sign", "space")
        clock[0] = 3.0
        screen._tick()
        assert screen.playing.time == pytest.approx(3.0)
        assert "▶ 3.0 s of 45.0 s · 1 × real time" in str(
            screen.query_one("#playback-time").border_title
        )
        await session.press("greater_than_sign")
        clock[0] = 13.0
        screen._tick()
        assert screen.playing.time == pytest.approx(23.0)
        clock[0] = 100.0
        screen._tick()
        assert (screen.playing.time, screen.playing.on) == (45.0, False)
        await session.press("space")
        assert screen.playing.on and screen.playing.time == 0.0


async def test_two_tests_are_overlaid_and_p_goes_to_where_they_part(two_ways):
    async with Attached(two_ways) as session:
        await session.press("W")
        assert isinstance(await settled(session), WhyScreen)
        await session.press("enter")
        screen = await settled(session)
        assert [one.test.id for one in screen._tests] == [38, 61]
        # Until they part both are in one cell, and the first one hides the other.
        assert {char in HOLLOW for char, _ in robots(screen)} == {False}
        await session.press("p")
        assert screen.playing.time == pytest.approx(45 * 5 / 79)
        assert " 0.1" in str(screen.query_one("#playback-time").border_title)
        await session.press("end")
        assert {char in HOLLOW for char, _ in robots(screen)} == {False, True}
        lines = screen.query_one(Timeline).render().plain.split("\n")
        assert [line[0] for line in lines] == ["→", "⇒"]
        assert all("≠" in line for line in lines)
        # The second test ends sooner.
        assert lines[1].index("┤") < lines[0].index(NOW)
        assert "a in only one of them" in legend(screen.map.shown, 100).plain
        await session.press("x")
        assert [one.test.id for one in screen._tests] == [61, 38]


@pytest.mark.screens
async def test_o_offers_tests_with_the_same_seed_first(two_ways):
    state = two_ways.state
    found = others(state.tests, state.tests[37])
    assert {test.seed for test in found[:3]} == {10000}
    assert all(test.is_finished and test.id != 38 for test in found)
    async with Attached(two_ways) as session:
        await session.press("2", "home", "P", "o")
        assert session.app.screen.query_one(OptionList).highlighted == 1
        await session.press("enter")
        screen = await settled(session)
        assert len(screen._tests) == 2
        await session.press("o", "home", "enter")
        assert len(screen._tests) == 1


@pytest.mark.screens
async def test_arrows_go_to_other_tests_and_facts_play_theirs(two_ways):
    async with Attached(two_ways, size=(80, 24)) as session:
        await session.press("2", "home", "F", "left", "p")
        screen = await settled(session)
        assert isinstance(screen, Playback)
        number = screen._tests[0].test.id
        await session.press("down")
        assert screen._tests[0].test.id == number + 1
        await session.press(*["up"] * 3)
        assert screen._tests[0].test.id == number - 2
        await session.press("escape", "escape")
        assert isinstance(session.app.screen, RunScreen)


@pytest.mark.screens
async def test_a_click_on_the_slider_goes_there_and_the_wheel_turns_frames(two_ways):
    async with Attached(two_ways) as session:
        await session.press("P")
        screen = await settled(session)
        slider = screen.query_one(Timeline)
        middle = 2 + (slider._room - 1) // 2
        await session.pilot.mouse_down(slider, offset=(middle, 0))
        assert screen.playing.time == pytest.approx(22.5, abs=0.5)
        await session.pilot.hover(slider, offset=(middle + 20, 0))
        later = screen.playing.time
        assert later > 30
        await session.pilot.mouse_up(slider, offset=(middle + 20, 0))
        await session.pilot.hover(slider, offset=(5, 0))
        assert screen.playing.time == later
        slider.post_message(MouseScrollDown(slider, 5, 0, 0, 0, 0, False, False, False))
        await session.pilot.pause()
        assert 0 < screen.playing.time - later <= 0.1 + 1e-9


async def test_models_move_where_their_motion_is_stored(runs):
    world = fake_run.world_text()
    at = world.index(b'<model name="crate_03"')
    loose = world[:at] + world[at:].replace(b"<static>true</static>", b"", 1)
    run = fake_moments.finished(fake_run.FakeRun(runs / "loose-1.ddenv", world=loose))
    motion = array("d")
    for time, x in ((0.0, -1.8), (20.0, -1.8), (40.0, 4.0)):
        motion.extend((time, x, -2.0, 0.15, 1, 0, 0, 0))
    run.put_motion(1, motion, "crate_03")
    async with Attached(run) as session:
        session.app.screen.opening.play_row(run.state.tests[0])
        screen = await settled(session)
        assert "1 model that moved" in str(screen.query_one("#playback-world").border_title)

        def centre():
            return next(each.center for each in screen.map.place.prints if each.name == "crate_03")

        await session.press("right")
        assert centre() == pytest.approx((-1.8, -2.0))
        await session.press("end")
        assert centre() == pytest.approx((4.0, -2.0))
        await session.press("down")
        assert "no model moved" in str(screen.query_one("#playback-world").border_title)
        # The next test begins where the world's file has it.
        assert centre() != pytest.approx((4.0, -2.0))
    run.close()


async def test_without_trajectories_it_says_what_is_missing_and_shows_the_rest(two_ways):
    two_ways.file._db.execute("DELETE FROM motion")
    async with Attached(two_ways) as session:
        await session.press("P")
        screen = await settled(session)
        said = screen.query_one(Met).render().plain
        assert "▲ The run file has no path of the robot" in " ".join(said.split())
        assert "○ pass" in said or "●" in said
        await session.press("space", "right", "p", "o", "enter")
        assert session.app.is_running


async def test_a_test_that_runs_is_refused(run):
    run.created()
    run.start()
    run.hold()
    async with Attached(run) as session:
        await session.press("P")
        assert "no test is finished yet" in session.said()
        assert isinstance(session.app.screen, RunScreen)


def test_frames_are_where_the_run_file_has_rows_and_speeds_have_ends():
    playing = Playing(1.05)
    times = []
    for by in (1, 1, 1, -1, 20):
        playing.frames(by)
        times.append(playing.time)
    assert times == pytest.approx([0.1, 0.2, 0.3, 0.2, 1.05])
    playing.frames(-1)
    assert playing.time == pytest.approx(1.0)
    playing.go(0.55)
    playing.frames(-1)
    assert playing.time == pytest.approx(0.5)
    assert [playing.faster(1) for _ in range(3)] == [True, True, False]
    assert playing.speed == SPEEDS[-1]
    playing = Playing(0.0)
    playing.toggle()
    assert not playing.on
