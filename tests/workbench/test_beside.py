"""What threads tell the screen."""

import asyncio

import pytest
from textual.app import App
from textual.containers import Vertical
from textual.screen import Screen
from textual.widgets import Label

from ddenv.workbench.shared.background import call_if_open, is_open
from tests.waiting import eventually


class Panel(Vertical):
    """Closes when it may: what is in it has gone before."""

    def __init__(self):
        super().__init__()
        self.may_close = asyncio.Event()
        self.may_close.set()

    async def on_unmount(self):
        await self.may_close.wait()


class Page(Screen):
    def compose(self):
        with Panel():
            yield Label("", id="cost")

    def show_cost(self, words):
        self.query_one("#cost", Label).update(words)


@pytest.fixture
async def page():
    async with (app := App()).run_test():
        await app.push_screen(page := Page())
        yield page


async def test_an_open_screen_is_told(page):
    await asyncio.to_thread(call_if_open, page, page.show_cost, "3 tests")
    assert str(page.query_one(Label).content) == "3 tests"
    await page.app.push_screen(Page())
    await asyncio.to_thread(call_if_open, page, page.show_cost, "4 tests")
    assert str(page.query_one(Label).content) == "4 tests"


async def test_a_screen_that_is_being_closed_is_told_nothing_more(page):
    panel = page.query_one(Panel)
    panel.may_close.clear()
    closing = asyncio.ensure_future(page.app.pop_screen()())
    await eventually(lambda: not page.query(Label))
    assert not closing.done()
    assert not is_open(page)
    await asyncio.to_thread(call_if_open, page, page.show_cost, "3 tests")
    panel.may_close.set()
    await closing
    await asyncio.to_thread(call_if_open, page, page.show_cost, "3 tests")


async def test_an_app_that_ends_is_told_nothing_more(page):
    page.app.exit()
    await asyncio.to_thread(call_if_open, page, pytest.fail, "told")
