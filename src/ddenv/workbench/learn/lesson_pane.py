"""The text of a step, its question, and what is said of the answers."""

from __future__ import annotations

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.widgets import Static

from ddenv.learn.lesson import Question
from ddenv.learn.lesson_course import LETTERS, Page
from ddenv.learn.markup import Block
from ddenv.workbench.wording import plain

STYLES = {"": "", "strong": "bold", "emphasis": "italic", "code": "bold"}


class LessonPane(VerticalScroll):
    """Scrolls where a text is longer than its panel. A click on an answer gives it."""

    def compose(self) -> ComposeResult:
        yield Static("", id="lesson-text", markup=False)

    def show(self, page: Page) -> None:
        """Another page, from its beginning; with a hint or an answer, its end: that is new."""
        self.query_one("#lesson-text", Static).update(page_text(page))
        if page.chosen is None and not page.hint:
            self.scroll_home(animate=False)
        else:
            self.call_after_refresh(self.scroll_end, animate=False)

    def read_on(self) -> bool:
        """Scrolls on to what was not in sight; False if all of the page was."""
        if self.scroll_y >= self.max_scroll_y:
            return False
        self.scroll_page_down(animate=False)
        return True


def page_text(page: Page) -> Text:
    """A page as text; nothing on it depends on colour alone."""
    parts = [_block(each) for each in page.text]
    if page.question is not None:
        parts.append(_question(page.question, page))
    parts += [_block(each) for each in page.after]
    return Text("\n\n").join(parts)


def _block(block: Block) -> Text:
    text = Text("• " if block.listed else "")
    for words, style in block.spans:
        text.append(plain_words(words), STYLES[style])
    return text


def plain_words(words: str) -> str:
    """Without control characters; a space at an end stays."""
    lead, tail = words[:1] == " ", words[-1:] == " "
    return f"{' ' if lead else ''}{plain(words)}{' ' if tail and words.strip() else ''}"


def _question(question: Question, page: Page) -> Text:
    text = Text().append(plain(question.text), "bold")
    for place, answer in enumerate(question.answers):
        mark, style = " ", ""
        if page.chosen is not None:
            mark = "✓" if answer.right else "✗" if place == page.chosen else " "
            style = "bold" if answer.right or place == page.chosen else "dim"
        line = Text(f"\n {mark} {LETTERS[place]}  {plain(answer.text)}", style)
        if page.chosen is None:
            line.apply_meta({"@click": f"screen.answer({place})"})
        text.append_text(line)
    if page.hint:
        text.append(f"\nHint: {plain(question.hint)}", "italic")
    if page.chosen is not None:
        text.append_text(_verdict(question, page))
    return text


def _verdict(question: Question, page: Page) -> Text:
    """Right or wrong, why, and what is wrong with the other answers."""
    if page.chosen is None or page.chosen < 0:
        first = f"\n\nSkipped. {LETTERS[question.right]} is right."
    elif question.answers[page.chosen].right:
        first = "\n\n✓ Right."
    else:
        first = f"\n\n✗ No: {LETTERS[question.right]} is right."
    text = Text().append(first, "bold")
    for mark, why in page.remarks:
        text.append(f"\n{mark} {plain(why)}")
    return text
