"""The why view: each model that is left, what happens without it, and the robot's ways with and
without it on one map.
"""

import fake_moments
import fake_run
import pytest
from attached import Attached
from click.testing import CliRunner
from textual.widgets import OptionList

from ddenv.cli.command_line import app as command_line
from ddenv.evidence.certificate import IN_TURN, Pairs
from ddenv.report.report import write_report
from ddenv.runfile.store import RunFile
from ddenv.runs import engine_job
from ddenv.runs.reasons import nearest, parting_sentence, reasons, sentence
from ddenv.text import percent
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.why.why_screen import WhyScreen
from tests.tiers import slow


async def opened(session):
    await session.press("W")
    await session.app.workers.wait_for_complete()
    await session.pilot.pause()
    screen = session.app.screen
    assert isinstance(screen, WhyScreen)
    return screen


def words(screen, selector):
    return str(screen.query_one(selector).render())


@pytest.mark.parametrize("watch", [False, True])
async def test_each_model_has_its_sentence_its_rate_and_its_two_ways(run, watch):
    fake_moments.finished(run)
    with RunFile(run.path) as file:
        known = reasons(file, run.state)
    async with Attached(run, watch=watch) as session:
        screen = await opened(session)
        assert "what is left: f in 23 of 23 fresh runs (80 % to 100 %)" in words(
            screen, "#why-header"
        )
        options = screen.query_one(OptionList)
        for number, one in enumerate(known):
            row = str(options.get_option_at_index(number).prompt)
            assert row.split()[:2] == ["AB"[number], one.without]
            said = words(screen, "#why-said")
            assert sentence(one) in said and parting_sentence(one) in said
            assert "fresh runs (" in said and "needed: without it" in said
            assert [way.name for way in screen.map.shown.ways] == ["with", "without"]
            assert one.without not in screen.map.shown.candidate.models
            await session.press("down")
        await session.press("c")
        assert session.app.clipboard.splitlines()[0].startswith(sentence(known[0]))
        await session.press("escape")
        assert isinstance(session.app.screen, RunScreen)
        assert session.commands() == []


async def test_without_a_certificate_it_says_what_to_do(run):
    fake_moments.uncertified(run)
    async with Attached(run, size=(80, 24)) as session:
        screen = await opened(session)
        assert "Make one, and come back: ddenv certify crates-1" in words(screen, "#why-empty")
        await session.press("c", "enter")
        assert session.app.clipboard == "ddenv certify crates-1"
        assert "no two runs" in session.said()


async def test_while_the_run_goes_on_it_waits_and_fills_by_itself(run):
    fake_moments.certifying(run).hold()
    async with Attached(run) as session:
        screen = await opened(session)
        assert "It is being made: 17 of about" in words(screen, "#why-empty")
        kept = percent(Pairs(both=11, second=1).keeps_at_least(0.03 * IN_TURN))
        assert f"so far at least {kept} of the whole world's rate is kept" in words(
            screen, "#why-empty"
        )
        run.certify_all(2, "crate_01", "ppp")
        run.finish_certificate(
            (None, "kept", 6 * "s"), ("crate_00", "needed", "opp"), ("crate_01", "needed", "ppp")
        )
        run.write("finished", minimal=True, reason="no single model can be removed")
        await session.look()
        screen._look()
        await session.app.workers.wait_for_complete()
        await session.pilot.pause()
        assert screen.query_one(OptionList).option_count == 2


def nothing_needed(run):
    fake_moments._rounds(run).start_certificate()
    run.certify_all(2, None, 6 * "s")
    run.finish_certificate((None, "kept", 6 * "s"))
    return run


@pytest.mark.parametrize(
    ("moment", "why"),
    [
        (fake_moments.mid_round, "The search is still running"),
        (nothing_needed, "No model is left to leave out"),
    ],
)
async def test_where_there_is_nothing_to_look_at_it_says_why(run, moment, why):
    moment(run).hold()
    async with Attached(run) as session:
        assert why in words(await opened(session), "#why-empty")


async def test_where_the_rate_is_lost_it_is_said_that_no_model_was_left_out(run):
    fake_moments._rounds(run).start_certificate()
    run.certify_all(2, None, 6 * "so")
    run.finish_certificate((None, "lost", 6 * "so"))
    async with Attached(run) as session:
        said = words(await opened(session), "#why-empty")
    assert (
        "none was left out: what is left keeps less than 80 %" in said
        and "f in 6 of 12 fresh runs" in said
    )
    typed = CliRunner().invoke(command_line, ["why", str(run.path)], standalone_mode=False)
    assert typed.output.split() == said.split()
    write_report(run.path, run.path.with_suffix(".md"))
    assert (
        "none was left out: what is left keeps less than 80 %"
        in run.path.with_suffix(".md").read_text()
    )


async def test_damaged_trajectories_are_told_and_the_rest_is_shown(run):
    fake_moments.finished(run)
    run.file._db.execute("DELETE FROM motion")
    async with Attached(run) as session:
        screen = await opened(session)
        said = words(screen, "#why-said")
        assert "Without crate_00 the robot reaches its goal" in said
        assert "Where the paths diverge is not known" in said and "has no trajectory" in said
        await session.press("enter")
        assert isinstance(session.app.screen, WhyScreen)


async def test_stacks_are_left_out_together(runs):
    data = fake_run.scenario()
    data["reduction"]["keep_supports"] = True
    run = fake_run.FakeRun(runs / "crates-1.ddenv", data)
    run.created().supports(("crate_01", "crate_00"))
    run.baseline()
    run.start_round(2)
    run.reduce(0, run.elements[:6], run.similar(0))
    run.start_certificate()
    run.certify_all(1, None, 6 * "s")
    run.certify_all(1, "crate_00", 4 * "p")
    run.finish_certificate((None, "kept", 6 * "s"), ("crate_00", "needed", 4 * "p"))
    async with Attached(run) as session:
        screen = await opened(session)
        assert "what rests on it (1 model)" in words(screen, "#why-said")
        assert set(screen.map.shown.candidate.models) == set(run.elements[2:6])
    run.close()


@pytest.mark.parametrize("damaged", [False, True])
async def test_the_nearest_world_that_passes_stands_at_the_end_with_both_runs_side_by_side(
    run, damaged
):
    fake_moments.isolated(run)
    with RunFile(run.path) as file:
        known = nearest(file, run.state)
    if damaged:
        run.file._db.execute("DELETE FROM motion")
    async with Attached(run) as session:
        screen = await opened(session)
        options = screen.query_one(OptionList)
        await session.press("end")
        assert "nearest world that passes" in str(
            options.get_option_at_index(options.option_count - 1).prompt
        )
        said = words(screen, "#why-said")
        assert known.words[1:] in said
        assert set(screen.map.shown.candidate.models) == set(run.elements) - set(known.gone)
        if damaged:
            assert "has no trajectory" in said
            return
        assert known.sentences in said
        assert [way.name for way in screen.map.shown.ways] == ["fails", "passes"]
        await session.press("enter")
        await session.app.workers.wait_for_complete()
        played = session.app.screen
        assert [one.test.id for one in played._tests] == [
            known.parting.with_test,
            known.parting.without_test,
        ]


async def test_a_key_finds_the_nearest_world_that_passes_and_stops_that(run, started):
    fake_moments.finished(run)
    async with Attached(run) as session:
        screen = await opened(session)
        assert "world that passes" in session.text(KeyFooter)
        await session.press("i")
        assert started == [(run.path.name, fake_run.attended(run.state.jobs), engine_job.Isolate())]
        # The engine begins.
        run.hold()
        run.start_isolation(2)
        run.live((run.isolate(run.remove("crate_00", "crate_01"), 0), 0.5))
        await session.look()
        screen._look()
        assert words(screen, "#why-header").startswith(
            " finding the nearest world that passes: without 2 models ·"
        )
        await session.press("i")
        assert session.asked() == [("stop", {})]
        run.write("engine_stopped", reason="stopped by the user")
        run.let_go()
        await session.look()
        screen._look()
        assert "(stopped) · what is left" in words(screen, "#why-header")
        await session.press("i")
        assert len(started) == 2


@pytest.mark.parametrize(
    ("moment", "why"),
    [
        (fake_moments.mid_round, "its search is not over"),
        (fake_moments.isolated, "a nearest world that passes is known"),
    ],
)
async def test_why_the_nearest_world_that_passes_cannot_be_found_now(run, started, moment, why):
    moment(run)
    async with Attached(run) as session:
        await opened(session)
        await session.press("i")
        assert why in session.said()
    async with Attached(run, watch=True) as session:
        await opened(session)
        await session.press("i")
        assert "watching only" in session.said()
    assert (started, run.file.commands()) == ([], [])


def picture_of(session):
    """The whole screen as one text."""
    strips = session.app.screen._compositor.render_strips()
    return " ".join(
        " ".join("".join(segment.text for segment in strip).split()) for strip in strips
    )


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [(80, 24), (120, 36)], but=[(80, 24)]))
async def test_margins_are_one_key_away(run, size):
    fake_moments.with_margins(run)
    async with Attached(run, size=size) as session:
        await opened(session)
        await session.press("m")
        shown = picture_of(session)
        for said in ("crate_00.friction", "███|███", "f until 0 (end) … 0.2; then goal at"):
            assert said in " ".join(shown.split())
        await session.press("escape")
        assert isinstance(session.app.screen, WhyScreen)


async def test_a_number_is_shown_at_its_limits_and_played_beside_what_is_left(run):
    fake_moments.with_margins(run)
    async with Attached(run) as session:
        screen = await opened(session)
        assert "; other numbers" in str(screen.query_one("#why-models").border_title)
        options = screen.query_one(OptionList)
        rows = [
            str(options.get_option_at_index(number).prompt).split()
            for number in range(options.option_count)
        ]
        assert rows[-2:] == [
            ["crate_00.friction", "goal", "at", "0.4"],
            ["crate_01.y", "no", "f", "at", "0.31"],
        ]
        await session.press("up", "up")
        said = words(screen, "#why-said")
        assert "the robot reaches its goal at 0.4" in said
        assert (
            f"ddenv test {run.path.stem} --minimal --margin crate_00.friction=0.4 --repeat 10"
            in said
        )
        assert (
            f"ddenv export {run.path.stem} --margin crate_00.friction=0.4 --output changed.sdf"
            in said
        )
        assert [way.name for way in screen.map.shown.ways] == ["now", "at 0.4"]
        # A friction moves nothing; a place is outlined where f still shows, where it does not, and
        # where the model cannot be.
        assert screen.map.shown.limits == ()
        await session.press("down")
        middles = {verdict: ring[:-1, 1].mean() for verdict, ring in screen.map.shown.limits}
        assert middles == pytest.approx({"other": 0.31, "f": 0.69, "impossible": 1.25})
        assert "limits" in words(screen, "#why-legend")
        await session.press("up", "enter")
        assert "changed: crate_00.friction = 0.4" in words(session.app.screen, "#playback-header")
        await session.press("end")
        assert "reaches its goal" in session.said() or "pass" in picture_of(session)


async def test_where_no_margins_are_known_the_command_is_named(run):
    fake_moments.finished(run)
    async with Attached(run) as session:
        await opened(session)
        await session.press("m")
        assert f"ddenv margins {run.path.stem} finds how far" in picture_of(session)
