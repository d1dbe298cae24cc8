"""What reaches the terminal: only what changed, and on it stands what the widgets drew."""

import re

import fake_moments
import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.app import App
from textual.geometry import Region
from textual.strip import Strip

from ddenv.workbench.app import Workbench
from ddenv.workbench.terminal.cell_diff import CellDiff

RED, PLAIN = Style.parse("red on black"), Style.parse("white on black")
CONSOLE = Console(color_system="truecolor", force_terminal=True)


def layout(*rows):
    """An update of a whole screen: each row is pairs of text and style."""
    strips = [[Strip([Segment(text, style) for text, style in row])] for row in rows]
    return LayoutUpdate(strips, Region(0, 0, strips[0][0].cell_length, len(rows)))


def sent(written, update):
    return written.sequence(update, CONSOLE)


def shown(*sequences):
    """The cells (character, codes of its style) on a terminal that was sent all this, by (row,
    column).
    """
    cells, codes, row, column = {}, "", 0, 0
    written = re.sub(r"\x1b\]8;[^\x1b]*\x1b\\\\|\n", "", "".join(sequences))
    for numbers, letter, text in re.findall(r"\x1b\[([0-9;]*)([A-Za-z])|([^\x1b]+)", written):
        if letter == "H":
            row, column = (int(number) - 1 for number in numbers.split(";"))
        elif letter == "m":
            codes = numbers.removeprefix("0")
        for char in text:
            cells[row, column] = char, codes
            column += cell_len(char)
    return cells


def test_only_cells_that_changed_are_sent():
    written = CellDiff()
    first = sent(written, layout([("models: 12", PLAIN)], [("rounds: 3", PLAIN)]))
    assert "models: 12" in first and "rounds: 3" in first
    assert sent(written, layout([("models: 12", PLAIN)], [("rounds: 3", PLAIN)])) == ""
    change = sent(written, layout([("models: 13", PLAIN)], [("rounds: 3", PLAIN)]))
    assert re.sub(r"\x1b\[[0-9;]*m", "", change) == "\x1b[1;10H3"
    # A piece with wide characters is sent as a whole.
    sent(written, layout([("世界 12", PLAIN)]))
    assert "世界 13" in sent(written, layout([("世界 13", PLAIN)]))
    written.forget()
    assert "models: 13" in sent(written, layout([("models: 13", PLAIN)], [("rounds: 3", PLAIN)]))


def test_what_is_sent_in_parts_looks_as_if_all_was_sent():
    frames = [
        layout(
            [("▀▀ part A ", PLAIN), ("similar", RED)], [("part B    ", RED), ("running", PLAIN)]
        ),
        layout([("▀█ part A ", RED), ("similar", RED)], [("part B    ", RED), ("runs 12", PLAIN)]),
        layout(
            [("▀█", PLAIN), (" part A ", Style.parse("bold")), ("similar", RED)], [(" " * 17, RED)]
        ),
    ]
    written = CellDiff()
    steps = [sent(written, frame) for frame in frames]
    for number, frame in enumerate(frames, start=1):
        assert shown(*steps[:number]) == shown(sent(CellDiff(), frame))


async def test_all_is_sent_again_to_a_terminal_that_was_left_or_resized(monkeypatch):
    app = Workbench()
    async with app.run_test(size=(80, 24)) as pilot:
        forgotten = []
        monkeypatch.setattr(app._written, "forget", lambda: forgotten.append(True))
        app.app_resume_signal.publish(app)
        await pilot.resize_terminal(100, 30)
        await pilot.pause()
        assert len(forgotten) >= 2


class Stranger(ChopsUpdate):
    """An update of a kind that only a later release of Textual has."""


def test_textual_draws_what_is_of_an_unknown_kind_or_made_in_another_way():
    written, known = CellDiff(), layout([("left right", PLAIN)])
    sent(written, known)
    stranger = Stranger([{0: Strip([Segment("night", PLAIN)])}], [(0, 0, 5)], [[5]])
    assert written.fewer(stranger) is stranger
    assert written.fewer(None) is None
    # What it wrote is not known: all is sent again.
    assert "left right" in sent(written, known)
    update = ChopsUpdate([{0: Strip([Segment("night", PLAIN)])}], [(0, 0, 5)], [[5]])
    fewer = written.fewer(update)
    update.spans = [(0, 0, 5, "something new")]
    update.render_segments = lambda console: "drawn by Textual"
    assert fewer.render_segments(CONSOLE) == "drawn by Textual"
    assert "left right" in sent(written, known)


# The contract with Textual's compositor, which is not public. If a release of Textual breaks it,
# the workbench still works, since Textual then draws by itself, but it sends more: read
# `textual/_compositor.py` and mend `terminal/cell_diff.py`.


@pytest.fixture
async def updates(run, monkeypatch):
    """All that Textual wants drawn while a run is looked at, and the terminal is resized."""
    found = []
    monkeypatch.setattr(App, "_display", lambda app, screen, update: found.append(update))
    monkeypatch.setattr(Workbench, "_display", lambda app, screen, update: found.append(update))
    fake_moments.mid_round(run)
    async with Workbench(run.path).run_test(size=(80, 24)) as pilot:
        await pilot.pause()
        await pilot.press("down", "1", "right", "question_mark")
        await pilot.press("escape")
        await pilot.resize_terminal(100, 30)
        await pilot.pause()
        await pilot.press("tab", "2")
        await pilot.pause()
    return [update for update in found if update is not None]


async def test_the_terminal_shows_what_textual_itself_would_show(updates):
    assert callable(getattr(App, "_display", None)), (
        "App._display is gone: nothing goes through cell_diff.py any more"
    )
    assert {type(update) for update in updates} == {LayoutUpdate, ChopsUpdate}
    assert all(isinstance(update, CompositorUpdate) for update in updates)
    written = CellDiff()
    ours, theirs = {}, {}
    for number, update in enumerate(updates):
        if type(update) is LayoutUpdate:
            # As the app does when the terminal is resized.
            written.forget()
            # More than once: what cannot be read is drawn by Textual after that.
            assert all(iter(line) is not line for line in update.strips)
        # Not `fewer`, which would let Textual draw what cannot be read.
        ours |= shown(sent(written, update))
        theirs |= shown(update.render_segments(CONSOLE))
        assert ours == theirs, f"update {number}, {type(update).__name__}"
