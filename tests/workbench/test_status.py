"""The lines above and below the panels."""

from dataclasses import replace

import fake_moments
import fake_run
import pytest
from textual.app import App

from ddenv import __version__
from ddenv.runfile.fold import fold
from ddenv.runfile.progress import Node
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import PersistentTuple
from ddenv.workbench.run.status import Header, Status, branch_of, facts, fitted, heading


def snapshot(run, engine="alive", **changes) -> Snapshot:
    return Snapshot(
        state=fold(run.file.events()).changed(**changes),
        live=tuple(run.file.live()),
        engine=engine,
        spent=83,
    )


def mid_round(run) -> Snapshot:
    """While the user is asked before each reduction; three tests were ended early."""
    shown = snapshot(fake_moments.mid_round(run), accept_mode="ask")
    tests = PersistentTuple.of(replace(test, cut=test.id <= 3) for test in shown.state.tests)
    return replace(shown, state=shown.state.changed(tests=tests))


def said(shown, width=200, **more):
    return dict(fitted(facts(shown, **more), width))


def test_everything_is_said_where_there_is_room(run):
    told = said(mid_round(run), 260, scene="http://127.0.0.1:7000/static/", asked="pause")
    assert list(told) == [
        "state",
        "asked",
        "tests",
        "drift",
        "cut",
        "time",
        "left",
        "mode",
        "engine",
        "scene",
    ]
    assert told["drift"] == "f in 1 of 1 here, 3 of 4 in the whole world"
    assert told["state"] == "▶ running"
    assert told["tests"] == "10 tests: 4 similar 4 pass 2 other"
    assert (told["cut"], told["time"], told["engine"]) == (
        "3 ended early",
        "1 min 23 s",
        "engine ●",
    )
    assert told["left"].startswith("about ")
    assert " (" in told["left"]


@pytest.mark.parametrize("width", [100, 80])
def test_how_much_is_left_is_said_also_where_there_is_little_room(run, width):
    told = said(mid_round(run), width)
    assert told["left"].startswith("about ") and "tests" in told


@pytest.mark.parametrize("width", [200, 120, 100, 80])
def test_where_f_is_clearly_rarer_the_mark_and_the_key_stay(run, width):
    told = said(snapshot(fake_moments.rarer(run)), width)
    assert told["drift"].startswith("▼ f ") and told["drift"].endswith(": u goes back")


def test_broken_tests_do_not_count_in_the_drift(run):
    fake_moments.certifying(run)
    before = said(snapshot(run))["drift"]
    run.certify_all(2, None, "eee")
    assert said(snapshot(run))["drift"] == before
    run.certify_all(2, None, "s")
    assert said(snapshot(run))["drift"] != before


@pytest.mark.parametrize("width", [120, 100, 80, 64, 40])
def test_the_least_important_goes_first(run, width):
    told = said(mid_round(run), width, asked="pause")
    assert sum(len(words) + 3 for words in told.values()) <= width
    assert told["state"] == "▶ running"
    assert ("cut" in told) <= ("time" in told) <= ("left" in told) <= ("tests" in told)


def test_of_a_paused_run_the_tests_are_told_that_are_left(run):
    fake_moments.mid_round(run).write("paused")
    assert said(snapshot(run))["left"].split(" (")[0].endswith("tests left")
    assert "left" not in said(
        snapshot(fake_moments.finished(fake_run.FakeRun(run.path.with_name("b.ddenv"))))
    )


def test_a_budget_is_told_with_the_tests(run):
    state = snapshot(fake_moments.mid_round(run)).state
    scenario = state.scenario | {"reduction": state.scenario["reduction"] | {"budget": 12}}
    told = said(snapshot(run, scenario=scenario))
    assert told["tests"].startswith("10 of 12 tests")


def test_an_engine_that_is_gone_or_of_another_version_is_told(run):
    fake_moments.mid_round(run)
    assert said(snapshot(run, "absent"))["state"] == "✗ engine is gone: r resumes"
    assert said(snapshot(run, engine_version=__version__))["engine"] == "engine ●"
    assert (
        said(snapshot(run, engine_version="0.0.9"))["engine"]
        == f"engine ● 0.0.9, not {__version__}"
    )
    assert (
        said(snapshot(run, engine_version="99.0"))["engine"] == f"engine ● 99.0, not {__version__}"
    )
    assert said(snapshot(run, "absent", status="stopped"))["engine"] == "engine ○ off: r resumes"
    assert said(replace(snapshot(run, "absent"), gone=True))["state"] == "✗ the run file is gone"


def nodes(*parents, rejected=()):
    return tuple(
        Node(
            number=number,
            parent=parent,
            how="",
            what="",
            environment=(),
            rejected=number in rejected,
        )
        for number, parent in enumerate(parents)
    )


def test_a_branch_is_told_unless_it_is_the_newest(run):
    # 0 - 1 - 2, and from 1 later 3 - 4.
    tree = nodes(None, 0, 1, 1, 3)
    state = snapshot(fake_moments.mid_round(run)).state
    assert [branch_of(state.changed(nodes=tree, node=node)) for node in range(5)] == [
        None,
        None,
        1,
        None,
        None,
    ]
    undone = nodes(None, 0, 1, rejected={2})
    assert branch_of(state.changed(nodes=undone, node=1)) is None
    assert heading(state.changed(nodes=tree, node=2))[1][0].startswith("branch 1 · round 2")
    assert ">99 % smaller" in heading(state.changed(elements=tuple(map(str, range(5000)))))[1][0]
    assert "2 pinned" in heading(state.changed(pinned=frozenset(state.elements[:2])))[1][0]


class Lines(App):
    def compose(self):
        yield Header()
        yield Status()


@pytest.mark.parametrize("width", [20, 64, 80, 120])
async def test_lines_fit_and_are_drawn_only_when_they_changed(run, width, monkeypatch):
    shown = snapshot(
        fake_moments.mid_round(run), pinned=frozenset({"crate_00"}), nodes=nodes(None, 0, 0), node=1
    )
    async with (app := Lines()).run_test(size=(width, 4)) as pilot:
        header, status = app.query_one(Header), app.query_one(Status)
        header.show(shown)
        status.show(shown)
        await pilot.pause()
        assert header.render().cell_len <= max(width, 25)
        drawn = []
        for widget in (header, status):
            monkeypatch.setattr(widget, "refresh", lambda *_, **__: drawn.append(1))
            widget.show(replace(shown, live=()))
        assert drawn == []
