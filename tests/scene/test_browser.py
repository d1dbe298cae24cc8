"""The page in a real browser: a headless Chromium, spoken to through its DevTools protocol, draws
it with software GL.
"""

from __future__ import annotations

import base64
import io
import json
import math
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image
from tornado.websocket import websocket_connect

from ddenv.report.report import write_report
from tests.waiting import PATIENCE, eventually, wait_until

CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium on this machine: the picture cannot be looked at"
)

ROBOT_YELLOW = (240, 190, 20)
_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader"),
    *(
        "--enable-unsafe-swiftshader",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
    ),
    *(
        "--disable-sync",
        "--disable-quic",
        "--disable-dev-shm-usage",
        "--hide-scrollbars",
        "--remote-debugging-port=0",
    ),
)


@contextmanager
def chromium(size: tuple[int, int]):
    """A browser with an empty profile; gives the port of its protocol."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        words = [
            CHROMIUM,
            *_FLAGS,
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
            "about:blank",
        ]
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            yield _protocol_port(Path(profile) / "DevToolsActivePort")
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _protocol_port(file: Path) -> int:
    wait_until(
        lambda: file.exists() and file.read_text().splitlines(), lambda: "chromium did not start"
    )
    return int(file.read_text().splitlines()[0])


class Page:
    """One tab. `do` sends a command of the protocol and gives its result."""

    def __init__(self, connection) -> None:
        self._connection = connection
        self._count = 0

    @classmethod
    async def open(cls, port: int) -> Page:
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
            tabs = json.load(answer)
        address = next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")
        return cls(await websocket_connect(address, max_message_size=100_000_000))

    async def do(self, method: str, **parameters):
        self._count += 1
        await self._connection.write_message(
            json.dumps({"id": self._count, "method": method, "params": parameters})
        )
        while True:
            message = await self._connection.read_message()
            if message is None:
                raise ConnectionError("the browser is gone")
            answer = json.loads(message)
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise RuntimeError(answer["error"])
                return answer["result"]

    async def heed(self) -> None:
        """From now on notes what a page's policy forbids; `forbidden` tells."""
        note = (
            "document.addEventListener('securitypolicyviolation', (event) => "
            "forbidden.push(event.violatedDirective + ' '"
        )
        source = f"window.forbidden = []; {note} + event.blockedURI))"
        await self.do("Page.enable")
        await self.do("Page.addScriptToEvaluateOnNewDocument", source=source)

    async def value(self, expression: str):
        """What a JavaScript expression gives, promises awaited."""
        result = await self.do(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        return result["result"].get("value")

    async def screenshot(self) -> bytes:
        """The picture, as PNG."""
        return base64.b64decode((await self.do("Page.captureScreenshot", format="png"))["data"])

    async def picture(self) -> np.ndarray:
        """What the window shows, height x width x (red, green, blue)."""
        return np.asarray(Image.open(io.BytesIO(await self.screenshot())).convert("RGB"))


async def shows(page: Page, expression: str) -> None:
    """Returns when a JavaScript expression is true."""

    async def is_true():
        try:
            return await page.value(expression)
        except RuntimeError as error:
            # A page that is being exchanged gives no answer yet.
            if "navigated" not in str(error):
                raise
            return False

    await eventually(is_true, lambda: expression)


def near(picture: np.ndarray, color: tuple[int, int, int], reach: int = 40) -> int:
    """How many pixels are of about this colour."""
    return int((np.abs(picture.astype(int) - color).max(axis=2) <= reach).sum())


@pytest.mark.browser
@pytest.mark.witness
async def test_the_picture_shows_robot_goal_and_failure(reduced, start_scene):
    process = start_scene(reduced.path)
    url = process.stdout.readline().strip()
    with chromium((900, 600)) as port:
        page = await Page.open(port)
        await page.heed()
        await page.do("Page.navigate", url=url)
        ready = (
            "typeof viewer !== 'undefined' && viewer.num_messages_received > 30 && "
            "viewer.renderer.info.render.calls > 5"
        )
        await shows(page, ready)
        await shows(page, "document.title === 'small · ddenv'")
        await shows(
            page, "document.querySelector('#caption .models').textContent === '2 of 4 models'"
        )
        await shows(
            page,
            "viewer.scene_tree.find(['world', 'models', '003 board']).object.visible === false",
        )
        await shows(
            page, "viewer.scene_tree.find(['world', 'removed', 'all']).object.visible === true"
        )
        await page.value(
            "document.querySelectorAll('.card').forEach((card) => card.style.opacity = 0)"
        )
        assert await page.value("forbidden") == []

        pictures = []

        async def is_drawn() -> bool:
            pictures.append(await page.picture())
            return near(pictures[-1], ROBOT_YELLOW) > 100

        # The browser shows a frame some time after it was drawn: until then, and now and again
        # later, the canvas is white.
        await eventually(is_drawn, lambda: "no robot's yellow")
        picture = pictures[-1]
        process.terminate()
        process.wait(PATIENCE)
        await shows(page, "document.getElementById('lost').style.display === 'block'")
        # The page comes back to a scene that is started again.
        assert start_scene(reduced.path).stdout.readline().strip() == url
        await shows(
            page,
            (
                "document.getElementById('lost').style.display !== 'block' && typeof play !== "
                "'undefined' && play !== null"
            ),
        )
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 200
    assert near(picture, ROBOT_YELLOW) > 100
    assert near(picture, (20, 180, 75)) > 100, "the goal's green"
    assert near(picture, (235, 40, 35)) > 100, "the failure's red"


def place_of(path: str) -> str:
    return f"viewer.scene_tree.find(['world', {path}]).object.position.x"


@pytest.mark.browser
async def test_a_finished_test_is_played_with_a_slider_steps_and_a_ghost(reduced, start_scene):
    url = start_scene(reduced.path).stdout.readline().strip()
    with chromium((900, 600)) as port:
        page = await Page.open(port)
        await page.heed()
        await page.do("Page.navigate", url=url)
        await shows(page, "typeof play !== 'undefined' && play !== null && play.test === 2")
        # It plays by itself: the robot moves.
        await shows(page, place_of("'robot'") + " > 0.1")
        await page.value("document.getElementById('toggle').click()")
        assert await page.value("going") is False
        slide = (
            "(at) => { const one = document.getElementById('time'); one.value = at; "
            "one.dispatchEvent(new Event('input')); }"
        )
        await page.value(f"({slide})(4)")
        assert await page.value(place_of("'robot'")) == pytest.approx(1.55, abs=0.01)
        assert await page.value(place_of("'models', '003 board'")) == pytest.approx(
            0.25 - 1, abs=0.01
        )
        # The edges of its partition go with it.
        await page.value(
            "said = { ...said, parts: [['B', '#f0a028', 1, -1.5, 0.25, '003 board']] }"
        )
        await shows(
            page, place_of("'parts', '003 board'") + " === " + place_of("'models', '003 board'")
        )
        await page.value("document.getElementById('on').click()")
        assert await page.value("document.getElementById('clock').value") == "4.1 s of 8.0 s"
        await page.value(
            "document.dispatchEvent(new KeyboardEvent('keydown', {key: ',', bubbles: true}))"
        )
        assert (
            await page.value("document.getElementById('time').getAttribute('aria-valuetext')")
            == "4.0 s of 8.0 s"
        )
        # Two runs at once, and where they part.
        await page.value("chosen = true; load(2, {ghost: 1, equal: 0, apart: 2.5})")
        await shows(page, "ghost !== null && time === 0")
        await page.value("document.getElementById('parting').click()")
        assert await page.value("time") == 2.5
        ghost, robot = await page.value(place_of("'ghost'")), await page.value(place_of("'robot'"))
        assert (ghost, robot) == pytest.approx((2.5 / 8 * 3.0, 2.5 / 8 * 3.1), abs=0.01)
        assert await page.value(place_of("'parting'")) == pytest.approx(ghost)
        await page.value("document.getElementById('follow').click()")
        assert await page.value("home().x") == pytest.approx(-robot)
        await page.value("document.getElementById('removed').click()")
        assert await page.value("node('removed').visible") is False
        # A test that is not there is told in words.
        await page.value("load(77)")
        await shows(
            page, "document.getElementById('trouble').textContent.includes('test 77 has not ended')"
        )
        # Its wheels turn as far as its way makes them roll, and the ghost's as far as its own.
        wheel = "Math.abs(viewer.scene_tree.find(['world', '{}', 'wheel 0']).object.quaternion.y)"
        assert await page.value(wheel.format("robot")) == pytest.approx(
            abs(math.sin(robot / 0.1651 / 2)), abs=0.01
        )
        assert await page.value(wheel.format("ghost")) == pytest.approx(
            abs(math.sin(ghost / 0.1651 / 2)), abs=0.01
        )
        assert await page.value("forbidden") == []
        unnamed = "[...document.querySelectorAll('#play button, #play input, #play select')]"
        unnamed += (
            ".filter((one) => !one.textContent.trim() && !one.getAttribute('aria-label') && "
            "!one.labels?.length).length"
        )
        assert await page.value(unnamed) == 0


async def forbidden_of(url: str, ready: str) -> list[str]:
    """What the policy of a page forbids until it is `ready`."""
    with chromium((900, 600)) as port:
        page = await Page.open(port)
        await page.heed()
        await page.do("Page.navigate", url=url)
        await shows(page, f"document.readyState === 'complete' && ({ready})")
        return await page.value("forbidden")


@pytest.mark.browser
async def test_a_report_looks_as_it_should_and_runs_nothing(run_folder):
    page = run_folder / "report.html"
    write_report(run_folder / "a.ddenv", page)
    styled = "getComputedStyle(document.querySelector('h1')).margin !== ''"
    assert await forbidden_of(page.as_uri(), styled) == []
    (run_folder / "bad.html").write_text(
        page.read_text().replace("<main>", "<main><script>document.title = 'run'</script>")
    )
    assert await forbidden_of((run_folder / "bad.html").as_uri(), "document.title !== 'run'") == [
        "script-src-elem inline"
    ]


@pytest.fixture
def run_folder(reduced, tmp_path):
    return tmp_path


@pytest.mark.browser
async def test_the_served_workbench_is_drawn_within_its_policy(home):
    pytest.importorskip("textual_serve")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [sys.executable, "-m", "ddenv", "serve", "--port", str(port)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server:
        try:
            url = re.search(r"http://\S+/", server.stdout.readline())[0]
            assert await forbidden_of(url, "document.body.classList.contains('-first-byte')") == []
        finally:
            server.terminate()
