"""Long lists of lines."""

from textwrap import wrap

import pytest
from rich.text import Text
from textual.app import App

from ddenv.workbench.widgets.lines import Lines


class Log(App):
    def compose(self):
        yield Lines(lambda item, width: Text(str(item)), tail=True)


@pytest.mark.parametrize("at_a_time", [1, 3, 25])
async def test_the_last_lines_are_shown_from_the_first_that_does_not_fit(at_a_time):
    async with Log().run_test(size=(40, 10)) as pilot:
        lines = pilot.app.query_one(Lines)
        for count in range(at_a_time, 60, at_a_time):
            lines.show(range(count))
            await pilot.pause()
            assert lines.scroll_offset.y == lines.max_scroll_y == max(0, count - 10)
            assert lines.vertical_scrollbar.position == lines.scroll_offset.y


async def test_long_items_take_the_lines_that_they_need():
    class Wrapped(App):
        def compose(self):
            yield Lines(lambda part, _: Text(part), parts=wrap)

    async with Wrapped().run_test(size=(20, 10)) as pilot:
        lines = pilot.app.query_one(Lines)
        items = ["a sentence that takes three lines at this width", "short"]
        lines.show(items)
        lines.show([*items, "one more"])
        shown = [lines.render_line(row).text.strip() for row in range(lines.virtual_size.height)]
        assert " ".join(shown) == " ".join([*items, "one more"]) and len(shown) == 5
        await pilot.resize_terminal(60, 10)
        await pilot.pause()
        assert lines.virtual_size.height == 3


async def test_who_scrolled_up_is_left_there():
    async with Log().run_test(size=(40, 10)) as pilot:
        lines = pilot.app.query_one(Lines)
        lines.show(range(30))
        await pilot.pause()
        lines.scroll_to(y=5, animate=False, immediate=True)
        lines.show(range(31))
        await pilot.pause()
        assert lines.scroll_offset.y == 5
