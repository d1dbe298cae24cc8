"""The history of a run: its tree, going back in it, and two of its environments side by side."""

from dataclasses import replace

import fake_moments
import fake_run
from attached import Attached
from textual.widgets import DataTable

from ddenv.runfile import branches
from ddenv.runfile.fold import fold
from ddenv.runfile.progress import Node
from ddenv.workbench.help.dialogs import SideBySide
from ddenv.workbench.history import History, lines
from ddenv.workbench.widgets.lines import Lines
from ddenv.workbench.widgets.question import Question


def tree(*parents, here=0):
    """The lines of a tree given by each node's parent, with the nodes' numbers."""
    nodes = [
        Node(number=number, parent=parent, how="reduced", what="", environment=())
        for number, parent in enumerate((None, *parents))
    ]
    return [f"{row.lines}{row.node.number}" for row in branches.rows(nodes, here)]


def test_the_way_to_where_the_run_is_goes_straight_down():
    assert tree() == ["0"]
    assert tree(0, 1, 2, here=3) == ["0", "1", "2", "3"]
    assert tree(0, 1, 1, 3, 0, here=4) == ["0", "├─5", "1", "├─2", "3", "4"]
    assert tree(0, 1, 1, 3, 0, here=2) == ["0", "├─5", "1", "├─3", "│ 4", "2"]
    assert tree(0, 1, 1, here=1) == ["0", "1", "├─2", "3"]
    # Long histories are drawn at once.
    assert tree(*range(1500), here=1500)[-1] == "1500"


def test_what_a_node_is_has_a_sign_words_and_tests_of_its_own(run):
    state = fold(fake_moments.guided(run).file.events())
    told = [
        (branches.sign(node, state.node), branches.words(node, state.node)) for node in state.nodes
    ]
    assert told == [("○", ""), ("○", ""), ("✗", "taken back"), ("●", "here")]
    # The test of the reduction that was taken back is not the last one's own.
    assert [node.own_tests for node in state.nodes] == [0, 5, 6, 6]
    assert state.nodes[-1].tests == 7
    state = fold(
        fake_moments.finished(fake_run.FakeRun(run.path.with_name("other.ddenv"))).file.events()
    )
    assert branches.words(state.nodes[-1], 0) == "minimal"
    assert branches.words(replace(state.nodes[-1], rejected=True), 0) == "was minimal"


def cells(session):
    table = session.app.screen.query_one(DataTable)
    return [[cell.plain for cell in table.get_row_at(row)] for row in range(table.row_count)]


async def test_the_history_follows_the_run_and_compares(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        await session.press("h")
        history = session.app.screen
        assert isinstance(history, History)
        assert [row[0] for row in cells(session)] == [
            "○ 11 models",
            "○ 6 models",
            "├─✗ 4 models",
            "● 5 models",
        ]
        assert [row[4] for row in cells(session)] == ["3 of 4", "1 of 1", "1 of 1", "1 of 1"]
        assert [row[5] for row in cells(session)] == ["", "", "taken back", "here"]
        assert history.under_cursor.number == 3
        said = history.query_one(Lines)
        decided = " ".join(said.render_line(row).text[10:].strip() for row in range(6))
        assert decided.startswith("took back without A: 6 models again pinned crate_00")
        await session.press("c")
        assert "mark one environment first" in session.said()
        await session.press("m", "c")
        assert "this is the marked one" in session.said()
        await session.press("up", "c")
        assert isinstance(session.app.screen, SideBySide)
        first, second = (
            session.screen.snapshot.state.nodes[3],
            session.screen.snapshot.state.nodes[2],
        )
        told = {name: sides for name, *sides in lines(first, second, 3)}
        assert told["only in this one"] == ["2: crate_02, crate_03", "1: crate_05"]
        assert told["in both"][0] == "3: crate_00, crate_01, crate_04" and told["own tests"] == [
            "6",
            "6",
        ]
        await session.press("escape")
        run.start_round(2, run.elements[:5])
        run.reduce(0, run.elements[:2], run.similar(0))
        await session.look()
        history._look()
        assert [row[0] for row in cells(session)][-2:] == ["○ 5 models", "● 2 models"]
        assert history.under_cursor.number == 2
        await session.press("escape")
        assert session.app.screen is session.screen
        assert session.commands() == []


async def test_enter_goes_back_after_a_question_and_starts_an_engine_where_none_works(run, started):
    fake_moments.finished(run)
    async with Attached(run, (80, 24)) as session:
        await session.press("h", "enter")
        assert "the run is there already" in session.said()
        await session.press("up", "enter")
        assert isinstance(session.app.screen, Question)
        words = " ".join(session.dialog().split())
        assert "Go on from 6 models (#1, part A)? The run pauses there." in words
        await session.press("escape")
        assert isinstance(session.app.screen, History)
        await session.press("enter", "y")
        assert session.app.screen is session.screen
        assert session.asked() == [("go_back", {"node": 1})]
        assert (
            "back to 6 models (#1, part A); the run pauses there, and space begins a new search; "
            "an engine"
        ) in session.said()
        assert len(started) == 1
