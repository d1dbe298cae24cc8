"""The table of candidates: what it lists, where its cursor is, and that only what is seen is made
into text.
"""

from collections import defaultdict
from dataclasses import replace

import fake_moments
import fake_run
import pytest
from attached import SRC
from textual.app import App

from ddenv.runfile import state as runs_state
from ddenv.runfile.fold import fold
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, PersistentTuple, Round, RunState, Split, Trial
from ddenv.workbench.run.candidate_rows import COLUMNS, fitting, listed, words
from ddenv.workbench.run.candidates import Candidates


def snapshot(run, engine="alive") -> Snapshot:
    return Snapshot(state=fold(run.file.events()), live=tuple(run.file.live()), engine=engine)


def rows_of(shown: Snapshot) -> list[dict[str, str]]:
    listing = listed(shown)
    # A cell without words is not there.
    return [defaultdict(str, words(shown, listing, row)) for row in range(len(listing))]


def large(number: int, judged: int = 0) -> Snapshot:
    """A round of so many candidates of which some are judged, each with one test."""
    names = tuple(f"m{place}" for place in range(number // 2))
    split = Split(environment=names, partitions=tuple((name,) for name in names))
    found = []
    for index in range(number):
        verdict, tests = ("dissimilar", (index + 1,)) if index < judged else ("", ())
        kind = "complement" if index % 2 else "partition"
        found.append(
            Candidate(
                index=index,
                kind=kind,
                partition=index // 2,
                split=split,
                distance=0.5,
                verdict=verdict,
                tests=tests,
            )
        )
    candidates = PersistentTuple.of(found)
    tests = PersistentTuple.of(
        runs_state.Test(
            id=id,
            environment=0,
            phase="round",
            round=1,
            candidate=id - 1,
            run=0,
            seed=0,
            outcome="pass",
            distance=1.0,
        )
        for id in range(1, judged + 1)
    )
    state = RunState(status="running", elements=names, environment=names, tests=tests)
    return Snapshot(
        state=state.changed(
            round=Round(number=1, n_partitions=len(names), split=split, candidates=candidates)
        ),
        live=(),
        engine="alive",
    )


class Table(App):
    CSS_PATH = str(SRC / "workbench/run/run.tcss")

    def compose(self):
        yield Candidates()

    @property
    def table(self) -> Candidates:
        return self.query_one(Candidates)

    def lines(self) -> list[str]:
        return [self.table.render_line(y).text.rstrip() for y in range(self.table.size.height)]


def test_rows_say_how_many_tests_of_how_many_and_how_they_ended(run):
    rows = rows_of(snapshot(fake_moments.mid_round(run)))
    shown = [rows[0][name] for name in ("tests", "evidence", "to f", "real", "verdict")]
    assert shown == ["4/4", "2◇ 2○", "2.3 m", "8.0 s", "○ dissimilar"]
    assert rows[1]["tests"] == "1/4"
    assert rows[1]["verdict"].startswith("▶ 2")
    assert (rows[3]["tests"], rows[3]["evidence"], rows[3]["real"]) == ("", "", "")
    # Without an engine nothing runs.
    assert rows_of(snapshot(run, "absent"))[1]["verdict"] == ""
    waiting = fake_moments.waiting(fake_run.FakeRun(run.path.with_name("b.ddenv")))
    assert rows_of(snapshot(waiting))[0]["verdict"] == "? a or x"


def test_what_a_candidate_drops_has_a_sign_and_a_word(run):
    rows = rows_of(snapshot(fake_moments.piled(run)))
    # Parts: 00 to 03, 04 to 06, 07 to 10. 02 lies on 05, 01 on 02, and 07 on 04.
    assert [(row["candidate"], row["verdict"].split(" ")[0]) for row in rows] == [
        ("part A↓", "○"),
        ("without A", "▶"),
        ("part B", ""),
        ("without B↓", "drops"),
        ("part C↓", "drops"),
        ("without C", ""),
    ]
    assert (rows[3]["verdict"], rows[4]["verdict"]) == ("drops 3 models", "drops crate_07")
    run.try_out([name for name in run.elements if name != "crate_04"])
    assert "try 1↓" in [row["candidate"] for row in rows_of(snapshot(run))]


FRESH = ("environment", "runs", "ended", "f", "shown", "verdict")


def told_of(run, engine="alive") -> list[tuple[str, ...]]:
    return [tuple(row[name] for name in FRESH) for row in rows_of(snapshot(run, engine))]


def test_a_certificate_in_the_making_counts_runs_without_broken_ones(run):
    assert told_of(fake_moments.certifying(run)) == [
        ("what is left", "12", "11● 1○", "92 %", "≥ 53 %", ""),
        ("- crate_00", "3", "1◇ 2○ 1✗", "0 %", "", "▶ 26.8/45 s"),
        ("- crate_01", "", "", "", "", "▶ 10.8/45 s"),
        ("whole, missed", "1", "1●", "", "", ""),
    ]
    assert [row[-1] for row in told_of(run, "absent")] == ["", "", "", ""]


def test_a_finished_certificate_has_its_verdicts_in_words(run):
    assert told_of(fake_moments.finished(run), "absent") == [
        ("what is left", "23", "23●", "100 %", "≥ 81 %", "● kept"),
        ("- crate_00", "11", "2◇ 9○", "0 %", "≤ 55 %", "● needed"),
        ("- crate_01", "12", "1● 11○", "8 %", "≤ 62 %", "● needed"),
        ("whole world", "23", "22● 1○", "96 %", "", ""),
    ]


def test_what_is_not_shown_says_so(run):
    verdicts = [row[-1] for row in told_of(fake_moments.not_shown(run), "absent")]
    assert verdicts == ["● kept", "? not shown", "✗ tests broke", ""]


def test_a_second_certificate_counts_its_own_runs(run):
    fake_moments.finished(run).start_certificate()
    run.certify_all(2, None, "sps")
    assert [row[:2] for row in told_of(run)] == [
        ("what is left", "3"),
        ("- crate_00", ""),
        ("- crate_01", ""),
        ("whole, missed", ""),
    ]


def test_a_search_that_goes_on_has_its_candidates_again(run):
    fake_moments.certifying(run).write("rate_lost", node=1, lost=2, again=[], tests=[])
    assert listed(snapshot(run)).of[0] == "round"


def test_trials_of_this_place_stand_above_the_candidates(run):
    state = snapshot(fake_moments.mid_round(run)).state
    judged = [
        Trial(
            number=number, models=("crate_00",), node=state.node, verdict="dissimilar", tests=(1,)
        )
        for number in range(1, 6)
    ]
    similar = Trial(
        number=6, models=("crate_00", "crate_01"), node=state.node, verdict="similar", tests=(1,)
    )
    trials = (
        *judged,
        similar,
        Trial(number=7, models=(), node=state.node),
        Trial(number=8, models=(), node=state.node + 1),
    )
    rows = rows_of(Snapshot(state=state.changed(trials=trials), live=(), engine="alive"))
    assert [row["candidate"] for row in rows[:5]] == ["try 4", "try 5", "try 6", "try 7", "part A"]
    assert [row["verdict"] for row in rows[:4]] == [
        "○ dissimilar",
        "○ dissimilar",
        "● a adopts it",
        "",
    ]


def test_what_matters_least_has_no_column_where_there_is_little_room(run):
    listing = listed(snapshot(fake_moments.mid_round(run)))
    widths = {
        width: [column.name for column in fitting(listing, width)] for width in (20, 41, 54, 58, 80)
    }
    assert widths[20] == widths[41] == ["#", "candidate", "models", "tests", "verdict"]
    assert widths[54] == ["#", "candidate", "models", "tests", "evidence", "verdict"]
    assert "real" in widths[58]
    assert widths[80] == [column.name for column in COLUMNS]
    assert sum(column.width for column in fitting(listing, 80)) == 80


@pytest.mark.parametrize("size", [(20, 5), (60, 12), (150, 20)])
async def test_lines_are_as_wide_as_the_table_and_columns_stand_in_line(run, size):
    async with (app := Table()).run_test(size=size) as pilot:
        app.table.show(snapshot(fake_moments.mid_round(run)))
        await pilot.pause()
        strips = [app.table.render_line(y) for y in range(app.table.size.height)]
        assert {strip.cell_length for strip in strips} == {app.table.size.width}
        header, first = (strip.text for strip in strips[:2])
        if size[0] >= 60:
            assert header.index("models") + len("models") == first.index(" 2 ") + 2


async def test_keys_and_mouse_move_the_cursor_and_escape_gives_it_back():
    async with (app := Table()).run_test(size=(60, 11)) as pilot:
        table = app.table
        table.show(large(100))
        table.focus()
        await pilot.pause()
        for key, row in (
            ("end", 99),
            ("pageup", 89),
            ("up", 88),
            ("home", 0),
            ("pagedown", 10),
            ("down", 11),
        ):
            await pilot.press(key)
            assert table.cursor_row == row
            assert table.under_cursor.index == row
        assert app.lines()[-1].startswith("12  without F")
        assert table.chosen is table.under_cursor
        table.follow()
        assert table.chosen is None
        await pilot.click(Candidates, offset=(4, 3))
        assert (table.cursor_row, table.following) == (table.scroll_offset.y + 2, False)
        await pilot.click(Candidates, offset=(4, 0))
        assert table.cursor_row == table.scroll_offset.y + 2


async def test_what_is_looked_at_stays_where_it_is():
    async with (app := Table()).run_test(size=(60, 11)) as pilot:
        table = app.table
        table.show(large(10_000))
        table.focus()
        await pilot.press("end")
        table.scroll_to(y=500, animate=False)
        table.show(large(10_000, judged=700))
        await pilot.pause()
        assert (table.scroll_offset.y, table.cursor_row) == (500, 9_999)
        assert app.lines()[1].startswith("501")
        assert app.lines()[1].endswith("○ dissimilar")
        # A trial more moves everything down by a row.
        shown = large(10_000, judged=700)
        table.show(
            replace(shown, state=shown.state.changed(trials=(Trial(number=1, models=(), node=0),)))
        )
        await pilot.pause()
        assert app.lines()[1].startswith("501")
        assert table.under_cursor.index == 9_999
