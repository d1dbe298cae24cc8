"""The text of a step, its question, and what is said of the answers."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.widget import Widget
from textual.widgets import Static

from ddenv.learn.lesson import Block, Question
from ddenv.learn.lesson_course import LETTERS, Page
from ddenv.learn.variables import Variable
from ddenv.text import plain, truncated

# The widths of what stands before an entry of a list, an answer, and a remark on it: longer lines
# go on below the words.
BULLET = 2
ANSWER = 6
REMARK = 4
STYLES = {"": "", "strong": "bold", "emphasis": "italic", "code": "bold"}
CHANGED = "▸"
WIDTH = 15


class LessonPane(VerticalScroll):
    """Scrolls where a text is longer than its panel. A click on an answer gives it; the arrows put
    a cursor on one.
    """

    _page: Page | None = None
    # The answer under the cursor; None before an arrow was pressed.
    cursor: int | None = None

    def compose(self) -> ComposeResult:
        yield Static("", id="lesson-text", markup=False)

    def show(self, page: Page) -> None:
        if self._page is None or page.question != self._page.question or page.chosen is not None:
            self.cursor = None
        self._page = page
        self._draw(page)
        if page.chosen is None and not page.hint:
            self.scroll_home(animate=False)
        else:
            self.call_after_refresh(self.scroll_end, animate=False)
        self.call_after_refresh(self._say_what_is_next)

    def _draw(self, page: Page) -> None:
        room = self.scrollable_content_region.width
        self.query_one("#lesson-text", Static).update(page_text(page, room, self.cursor))

    def _choose(self, by: int) -> bool:
        """Moves the cursor from answer to answer, once all is in sight; False if no question is
        open.
        """
        page = self._page
        if (
            page is None
            or page.question is None
            or page.chosen is not None
            or self.scroll_y < self.max_scroll_y
        ):
            return False
        last = len(page.question.answers) - 1
        if self.cursor is None:
            self.cursor = 0 if by > 0 else last
        else:
            self.cursor = max(0, min(self.cursor + by, last))
        self._draw(page)
        return True

    def action_scroll_up(self) -> None:
        if not self._choose(-1):
            super().action_scroll_up()

    def action_scroll_down(self) -> None:
        if not self._choose(1):
            super().action_scroll_down()

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        super().watch_scroll_y(old_value, new_value)
        self._say_what_is_next()

    def _say_what_is_next(self) -> None:
        """In the frame: that there is more to read, or which letters are answers."""
        if not isinstance(self.parent, Widget):
            return
        said = ""
        if self.scroll_y < self.max_scroll_y:
            said = "enter shows the rest"
        elif (
            self._page is not None and self._page.question is not None and self._page.chosen is None
        ):
            said = f"{letters(self._page.question)}, or ↑ ↓ and enter; s skips"
        self.parent.border_subtitle = said

    def read_on(self) -> bool:
        """Scrolls on to what was not in sight; False if all of the page was."""
        if self.scroll_y >= self.max_scroll_y:
            return False
        self.scroll_page_down(animate=False)
        return True


def letters(question: Question) -> str:
    used = LETTERS[: len(question.answers)]
    # After e there are gaps.
    if used[-1] <= "e":
        return f"{used[0]} to {used[-1]}"
    return " ".join(used)


def page_text(page: Page, room: int = 0, cursor: int | None = None) -> Text:
    parts = [_blocks(page.text, room)]
    if page.question is not None:
        parts.append(_question(page.question, page, room, cursor))
    parts.append(_blocks(page.after, room))
    return Text("\n\n").join(part for part in parts if part)


def _blocks(blocks: Sequence[Block], room: int) -> Text:
    text = Text()
    for before, block in zip((None, *blocks), blocks, strict=False):
        if before is not None:
            text.append("\n" if before.listed and block.listed else "\n\n")
        words = Text("• " if block.listed else "")
        for span, style in block.spans:
            words.append(plain_words(span), STYLES[style])
        text.append_text(_hung(words, BULLET, room) if block.listed else words)
    return text


def _hung(text: Text, indent: int, room: int) -> Text:
    """A paragraph whose lines after the first are indented, if it takes more than `room`
    columns.
    """
    if text.cell_len <= room or room < 4 * indent:
        return text
    # The first line has the sign in the place of the indent.
    sign, words = text.divide([indent])
    lines = words.wrap(Console(width=room), room - indent)
    return Text("").join([sign, Text(f"\n{' ' * indent}").join(line for line in lines)])


def plain_words(words: str) -> str:
    """Without control characters; a space at an end stays."""
    lead = " " if words[:1] == " " else ""
    tail = " " if words[-1:] == " " and words.strip() else ""
    return f"{lead}{plain(words)}{tail}"


def _question(question: Question, page: Page, room: int, cursor: int | None) -> Text:
    text = Text().append(plain(question.text), "bold")
    for place, answer in enumerate(question.answers):
        mark, style = ("▸", "reverse") if place == cursor else (" ", "")
        if page.chosen is not None:
            mark = " "
            style = "dim"
            if answer.right:
                mark = "✓"
                style = "bold"
            elif place == page.chosen:
                mark = "✗"
                style = "bold"
        line = _hung(Text(f" {mark} {LETTERS[place]}  {plain(answer.text)}", style), ANSWER, room)
        if page.chosen is None:
            line.apply_meta({"@click": f"screen.answer({place})"})
        text.append("\n").append_text(line)
    # Answered, the hint would only take the room of what is said of the answers.
    if page.chosen is not None:
        right = f"{LETTERS[question.right]} is right."
        verdict = "✓ Right." if page.chosen == question.right else f"✗ No: {right}"
        text.append(f"\n\n{f'Skipped. {right}' if page.chosen < 0 else verdict}", "bold")
        for mark, why in page.remarks:
            text.append("\n").append_text(_hung(Text(f"{mark} {plain(why)}"), REMARK, room))
    elif page.hint:
        text.append(f"\nHint: {plain(question.hint)}", "italic")
    return text


class Variables(Widget):
    """A line each."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._variables: tuple[Variable, ...] = ()

    def show(self, variables: tuple[Variable, ...]) -> None:
        self._variables = variables
        self.refresh()

    def render(self) -> Text:
        text = Text(no_wrap=True)
        room = max(8, self.size.width - WIDTH - 3)
        for one in self._variables:
            style = "bold" if one.changed else ""
            text.append(f"{CHANGED if one.changed else ' '} {one.name:<{WIDTH}} ", style or "dim")
            text.append(f"{truncated(plain(one.value) or '–', room)}\n", style)
        return text
