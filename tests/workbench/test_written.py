"""What reaches the terminal: only what changed, and on it stands what the widgets drew."""

import re

from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.geometry import Region
from textual.strip import Strip

from ddenv.workbench.app import Workbench
from ddenv.workbench.terminal.written import Written

RED, PLAIN = Style.parse("red on black"), Style.parse("white on black")
CONSOLE = Console(color_system="truecolor", force_terminal=True)


def layout(*rows):
    """An update of a whole screen: each row is pairs of text and style."""
    strips = [[Strip([Segment(text, style) for text, style in row])] for row in rows]
    return LayoutUpdate(strips, Region(0, 0, strips[0][0].cell_length, len(rows)))


def sent(written, update):
    return written.sequence(update, CONSOLE)


def shown(*sequences):
    """The cells (character, codes of its style) on a terminal that was sent all this, by (row, column)."""
    cells, codes, row, column = {}, (), 0, 0
    for numbers, letter, text in re.findall(r"\x1b\[([0-9;]*)([A-Za-z])|([^\x1b]+)", "".join(sequences)):
        if letter == "H":
            row, column = (int(number) - 1 for number in numbers.split(";"))
        elif letter == "m":
            parts = re.findall(r"[34]8;2;\d+;\d+;\d+|\d+", numbers)
            codes = () if parts[0] == "0" else codes
            for part in parts if parts[0] != "0" else parts[1:]:
                kind = part[:1] if part[:1] in "34" else part
                codes = (*(code for code in codes if code[:1] != kind), part)
        for char in text:
            cells[row, column] = char, frozenset(codes)
            column += 1
    return cells


def test_only_cells_that_changed_are_sent():
    written = Written()
    first = sent(written, layout([("models: 12", PLAIN)], [("rounds: 3", PLAIN)]))
    assert "models: 12" in first and "rounds: 3" in first
    assert sent(written, layout([("models: 12", PLAIN)], [("rounds: 3", PLAIN)])) == ""
    change = sent(written, layout([("models: 13", PLAIN)], [("rounds: 3", PLAIN)]))
    assert re.sub(r"\x1b\[[0-9;]*m", "", change) == "\x1b[1;10H3"
    written.forget()
    assert "models: 13" in sent(written, layout([("models: 13", PLAIN)], [("rounds: 3", PLAIN)]))


def test_what_is_sent_in_parts_looks_as_if_all_was_sent():
    frames = [
        layout([("▀▀ part A ", PLAIN), ("similar", RED)], [("part B    ", RED), ("running", PLAIN)]),
        layout([("▀█ part A ", RED), ("similar", RED)], [("part B    ", RED), ("runs 12", PLAIN)]),
        layout([("▀█", PLAIN), (" part A ", Style.parse("bold")), ("similar", RED)], [(" " * 17, RED)]),
    ]
    written = Written()
    steps = [sent(written, frame) for frame in frames]
    for number, frame in enumerate(frames, start=1):
        now, whole = shown(*steps[:number]), shown(sent(Written(), frame))
        assert {place: char for place, (char, _) in now.items()} == {place: char for place, (char, _) in whole.items()}
        # The colour of the text of a blank is not seen, and not sent.
        assert all(now[place][1] == codes for place, (char, codes) in whole.items() if char != " ")


def test_a_piece_with_wide_characters_is_sent_as_a_whole():
    written = Written()
    sent(written, layout([("世界 12", PLAIN)]))
    assert "世界 13" in sent(written, layout([("世界 13", PLAIN)]))


def test_a_part_of_the_screen_changes_only_that():
    written = Written()
    sent(written, layout([("left right", PLAIN)], [("below here", PLAIN)]))
    chops = [{0: None, 5: Strip([Segment("night", PLAIN)])}, {0: None, 5: None}]
    change = sent(written, ChopsUpdate(chops, [(0, 5, 10)], [[5, 10], [5, 10]]))
    assert shown(change).keys() == {(0, 5)}


async def test_all_is_sent_again_to_a_terminal_that_was_left_or_resized(monkeypatch):
    app = Workbench()
    async with app.run_test(size=(80, 24)) as pilot:
        forgotten = []
        monkeypatch.setattr(app._written, "forget", lambda: forgotten.append(True))
        app.app_resume_signal.publish(app)
        await pilot.resize_terminal(100, 30)
        await pilot.pause()
        assert len(forgotten) >= 2
