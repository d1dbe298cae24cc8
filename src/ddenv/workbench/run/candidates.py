"""The table of this round's candidates, of the baseline's runs before the first round, or of the
certificate after the last.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip

from ddenv.evidence.claims import FreshRuns
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, Test, Trial
from ddenv.workbench.run.candidate_rows import Column, Item, Listed, Words, fitting, listed, words
from ddenv.workbench.shared.bindings import keys

STRONG = Style(bold=True)
WEAK = Style(dim=True)
# More rows than there are.
FAR = 1_000_000_000


class Candidates(ScrollView, can_focus=True, inherit_bindings=False):
    """Only rows in sight become text: a DataTable takes seconds to list 5,000 candidates, at each
    round.

    The cursor follows the run until it is moved by hand.
    """

    HELP = (
        "evidence: ● f again   ◇ another failure   ○ goal reached   ✗ broke   ◷ took too long   "
        "↓ drops a model"
    )
    ALLOW_SELECT = False
    COMPONENT_CLASSES: ClassVar = {"candidates--header", "candidates--cursor"}
    BINDINGS: ClassVar = keys(
        "candidates",
        ("up", "up", "move(-1)", "", "the candidate above: the map shows its models"),
        ("down", "down", "move(1)", "", "the candidate below: the map shows its models"),
        ("page_up", "pageup", "page(-1)", "", "one page of candidates up"),
        ("page_down", "pagedown", "page(1)", "", "one page of candidates down"),
        ("first", "home,ctrl+home", f"move({-FAR})", "", "the first candidate"),
        ("last", "end,ctrl+end", f"move({FAR})", "", "the last candidate"),
        ("choose", "enter", "move(0)", "", "stay on this candidate"),
    )

    def __init__(
        self, chosen: Callable[[], object] = lambda: None, *, id: str | None = None
    ) -> None:
        """`chosen` is called when the cursor was moved by hand, or given back to the run: a message
        would be a frame later.
        """
        super().__init__(id=id)
        self._chosen = chosen
        self.following = True
        self.cursor_row = 0
        self.columns: tuple[Column, ...] = fitting(Listed(), 0)
        self._snapshot = Snapshot()
        self._listed = Listed()

    @property
    def item(self) -> Item | None:
        """What the row under the cursor is about, also in the tables of the baseline and of a
        certificate.
        """
        return self._listed.item(self.cursor_row)

    @property
    def under_cursor(self) -> Candidate | Trial | None:
        item = self.item
        if isinstance(item, Test | FreshRuns):
            return None
        return item

    @property
    def chosen(self) -> Candidate | Trial | None:
        if self.following:
            return None
        return self.under_cursor

    def words(self, row: int) -> Words:
        return words(self._snapshot, self._listed, row)

    def show(self, snapshot: Snapshot) -> None:
        before = self._listed
        self._listed = listed(snapshot)
        self._snapshot = snapshot
        if self._listed.of != before.of:
            self.following = True
            self.cursor_row = 0
            self.scroll_to(y=0, animate=False, force=True)
        elif shift := len(self._listed.trials) - len(before.trials):
            # The row that the user looks at stays where it is.
            self.cursor_row += shift
            if self.scroll_offset.y:
                self.scroll_to(y=self.scroll_offset.y + shift, animate=False, force=True)
        self.cursor_row = min(self.cursor_row, max(0, len(self._listed) - 1))
        self._arrange()
        if self.following and snapshot.focus is not None and self._listed.of[0] == "round":
            self._put(len(self._listed.trials) + snapshot.focus.index)
        self.refresh()

    def follow(self) -> None:
        self.following = True
        self._chosen()

    def action_move(self, rows: int) -> None:
        self._by_hand(self.cursor_row + rows)

    def action_page(self, pages: int) -> None:
        self._by_hand(self.cursor_row + pages * self._page)

    def on_click(self, event: events.Click) -> None:
        row = event.y - 1 + self.scroll_offset.y
        if event.y > 0 and row < len(self._listed):
            event.stop()
            self._by_hand(row)

    def _by_hand(self, row: int) -> None:
        self.following = False
        self._put(min(max(row, 0), max(0, len(self._listed) - 1)), reveal=True)
        self._chosen()

    # From rows to lines: the first one is the header, and does not scroll.

    @property
    def _page(self) -> int:
        return max(1, self.size.height - 1)

    @property
    def _in_sight(self) -> bool:
        return self.scroll_offset.y <= self.cursor_row < self.scroll_offset.y + self._page

    def _put(self, row: int, reveal: bool = False) -> None:
        """Moves the cursor. The view goes with it, if the cursor was in sight."""
        reveal = reveal or self._in_sight
        lines = (each + 1 - self.scroll_offset.y for each in (self.cursor_row, row))
        self.cursor_row = row
        self.refresh(*(Region(0, y, self.size.width, 1) for y in lines if y > 0))
        if reveal:
            self._reveal()

    def _reveal(self) -> None:
        if self.size.height and not self._in_sight:
            above = self.cursor_row < self.scroll_offset.y
            self.scroll_to(
                y=self.cursor_row - (0 if above else self._page - 1), animate=False, force=True
            )

    def on_resize(self) -> None:
        self._arrange()
        self._reveal()

    def _arrange(self) -> None:
        self.columns = fitting(self._listed, max(0, self.container_size.width - 1))
        self.virtual_size = Size(0, len(self._listed) + 1)
        self.refresh()

    def render_line(self, y: int) -> Strip:
        row = y - 1 + self.scroll_offset.y
        if y == 0:
            style = self.get_component_rich_style("candidates--header")
            return self._strip({column.name: column.name for column in self.columns}, style)
        cells = self.words(row)
        if not cells:
            return Strip.blank(self.size.width, self.rich_style)
        is_cursor = row == self.cursor_row
        if is_cursor:
            style = self.get_component_rich_style("candidates--cursor")
        else:
            style = self.rich_style
        return self._strip(cells, style)

    def _strip(self, cells: Words, style: Style) -> Strip:
        *others, last = self.columns
        row = "".join(_aligned(column, cells.get(column.name, "")) for column in others)
        words = cells.get(last.name, "")
        if words.startswith(("●", "▶", "?")):
            emphasis = STRONG
        elif words.startswith(("○", "⊘")):
            emphasis = WEAK
        else:
            emphasis = Style()
        segments = [Segment(row, style), Segment(_aligned(last, f"  {words}"), style + emphasis)]
        return Strip(segments).adjust_cell_length(self.size.width, style)


def _aligned(column: Column, text: str) -> str:
    """As wide as its column, with a space before it except in the first."""
    if column.right:
        return " " * (column.width - cell_len(text)) + text
    before = "" if column.name in ("#", "environment", "verdict") else " "
    room = column.width - len(before)
    return before + (
        set_cell_size(text, room) if cell_len(text) <= room else f"{set_cell_size(text, room - 1)}…"
    )
