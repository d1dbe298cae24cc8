"""What holds on every screen: help, the list of commands, keys of the user's own, and the program
in a browser.
"""

import asyncio
import os
import re
import socket
import subprocess
import sys
from typing import ClassVar

import fake_moments
import fake_run
import pytest
from textual.binding import Binding
from textual.command import CommandPalette
from textual.screen import Screen
from textual.widgets import OptionList, Static

from ddenv.workbench.app import Config, Workbench
from ddenv.workbench.help.command_palette import Commands
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.shortcuts import Help, commands, groups
from ddenv.workbench.map.world_map import WorldMap
from tests.waiting import PATIENCE, eventually
from tests.workbench.setup.setup_session import Opened


def told(screen):
    """The help's words as a user sees them."""
    table = screen.query_one(Static)
    return "\n".join(
        "".join(segment.text for segment in table.render_line(y)) for y in range(table.size.height)
    )


async def test_help_begins_with_the_focused_pane_and_shows_the_users_own_keys(run):
    fake_moments.mid_round(run)
    async with Workbench(run.path, config=Config(keys={"run.pause": "f8"})).run_test(
        size=(80, 24)
    ) as pilot:
        await pilot.pause()
        found = groups(pilot.app.screen)
        assert len(found) == 3
        assert [group.title for group in found][1:] == ["This screen", "Everywhere"]
        pilot.app.action_help()
        await pilot.pause()
        assert isinstance(pilot.app.screen, Help)
        words = told(pilot.app.screen)
        assert words.index(found[0].title) < words.index("This screen") < words.index("Everywhere")
        assert re.search("^ *f8 +pause", words, re.MULTILINE)
        await pilot.press("end", "escape")
        assert not isinstance(pilot.app.screen, Help)


@pytest.mark.screens
async def test_every_action_and_model_is_a_command_and_names_are_no_markup(runs):
    names = [f"[bold]box_{number}[/]" for number in range(3)]
    run = fake_run.FakeRun(runs / "m.ddenv", world=fake_run.world_text(names))
    fake_moments.mid_round(run)
    run.close()
    async with Workbench(run.path).run_test(size=(120, 36)) as pilot:
        await pilot.pause()
        shortcuts = commands(pilot.app.screen)
        assert all(shortcut.words for shortcut in shortcuts)
        assert {shortcut.id for shortcut in shortcuts} >= {"run.pause", "run.pin", "app.leave"}
        await offers(pilot, "choose the colours", "choose the colours")
        await offers(pilot, "box_1", "go to [bold]box_1[/] on the map\n")


async def test_a_model_is_a_command_of_the_setup_screen_too(scenarios):
    async with Opened((80, 24)) as session:
        world = session.screen.query_one(WorldMap)
        await session.press("f4")
        assert not world.is_on_screen
        hits = [hit async for hit in Commands(session.screen).search("crate_01")]
        assert [hit.text for hit in hits] == ["go to crate_01 on the map"]
        hits[0].command()
        await eventually(lambda: world.is_on_screen and world.model_at_cursor == "crate_01")


async def offers(pilot, query, words):
    """The list of commands offers what has these words, for a query."""
    await pilot.press("ctrl+p")
    assert isinstance(pilot.app.screen, CommandPalette)
    await pilot.press(*query)
    listed = pilot.app.screen.query_one(OptionList)

    async def offered():
        prompts = [listed.get_option_at_index(index).prompt for index in range(listed.option_count)]
        return any(words in f"{prompt}\n" for prompt in prompts)

    # What matches is found by and by.
    await eventually(offered, lambda: f"'{words}' is not offered")
    await pilot.press("escape")


class Choosy(Screen):
    """Some of its actions cannot be done now."""

    BINDINGS: ClassVar = [
        Binding("a", "now", "now", id="choosy.now", tooltip="can be done"),
        Binding("b", "later", "later", id="choosy.later", tooltip="cannot be done yet"),
        Binding("c", "never", "never", id="choosy.never", tooltip="makes no sense here"),
    ]

    def check_action(self, action, parameters):
        return {"later": None, "never": False}.get(action, True)

    def compose(self):
        ids = [binding.id for binding in self.BINDINGS]
        yield KeyFooter(ids)


async def test_footer_help_and_commands_offer_only_what_can_be_done_now(run):
    async with Workbench(run.path).run_test(size=(80, 24)) as pilot:
        await pilot.app.push_screen(screen := Choosy())
        await pilot.pause()
        footer = screen.query_one(KeyFooter)
        assert [(entry.words, entry.enabled) for entry in footer.entries] == [
            ("now", True),
            ("later", False),
        ]
        own = next(group for group in groups(screen) if group.title == "This screen")
        assert [(each.id, each.enabled) for each in own.shortcuts] == [
            ("choosy.now", True),
            ("choosy.later", False),
        ]
        assert [each.id for each in commands(screen) if each.id.startswith("choosy")] == [
            "choosy.now"
        ]


def test_serving_is_for_this_machine_alone(runs):
    refused = subprocess.run(
        [sys.executable, "-m", "ddenv", "serve", "--host", "0.0.0.0"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert refused.returncode == 2 and "only served on 127.0.0.1" in refused.stderr


def test_without_the_package_it_says_what_to_install(monkeypatch):
    from ddenv.errors import UserError
    from ddenv.workbench.terminal.served import serve

    monkeypatch.setitem(sys.modules, "textual_serve", None)
    monkeypatch.setitem(sys.modules, "textual_serve.server", None)
    with pytest.raises(
        UserError, match=r"pip install '\.\[serve\]' in a checkout of ddenv-workbench"
    ):
        serve(8000)


async def listens(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


async def test_a_browser_gets_the_app_and_other_pages_do_not(run):
    aiohttp = pytest.importorskip("aiohttp")
    pytest.importorskip("textual_serve")
    fake_moments.finished(run).close()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [
        sys.executable,
        "-m",
        "ddenv",
        "serve",
        "--port",
        str(port),
        "--font-size",
        "28",
        str(run.path),
    ]
    server = await asyncio.create_subprocess_exec(
        *words, stdout=asyncio.subprocess.PIPE, env=dict(os.environ)
    )
    own = f"http://127.0.0.1:{port}"
    try:
        said = [(await server.stdout.readline()).decode() for _ in range(4)]
        home = re.search(rf"({own}/[\w-]{{22}}/)\?fontsize=28 ", said[0])[1]
        assert "acts as" in said[1] and f"ssh -L {port}:127.0.0.1:{port}" in said[3]
        async with aiohttp.ClientSession() as session:
            await eventually(lambda: listens(port))
            async with session.get(f"{home}?fontsize=28") as page:
                text = await page.text()
                assert page.status == 200 and "textual.js" in text and 'data-font-size="28"' in text
                assert page.headers["Content-Security-Policy"].startswith("default-src 'none'")
            for path in (
                "/",
                "/ws",
                "/static/js/textual.js",
                f"/{'x' * 22}/",
                home.removeprefix(own)[:-1] + "x/",
            ):
                async with session.get(f"{own}{path}") as page:
                    assert page.status == 403
            with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                await session.ws_connect(f"{own}/ws", headers={"Origin": own})
            async with session.get(home, headers={"Host": "elsewhere.example"}) as page:
                assert page.status == 403
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await session.ws_connect(
                    f"{home}ws", headers={"Origin": "http://elsewhere.example"}
                )
            async with session.ws_connect(
                f"{home}ws?width=120&height=36", headers={"Origin": own}
            ) as socketed:
                seen = b""
                while b"crates" not in seen:
                    message = await socketed.receive(timeout=PATIENCE)
                    assert message.type is aiohttp.WSMsgType.BINARY, message
                    seen += message.data
                await socketed.send_json(["stdin", "\x11"])
    finally:
        server.terminate()
        await server.wait()


async def test_a_picture_of_the_screen_needs_no_folder_for_downloads(run, tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_downloads_path", lambda: tmp_path / "none")
    monkeypatch.chdir(tmp_path)
    app = Workbench(run.created().path)
    async with app.run_test() as pilot:
        await pilot.press("f12")
        await eventually(lambda: any(file.stat().st_size for file in tmp_path.glob("*.svg")))
