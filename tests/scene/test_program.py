"""The program: what it serves, to whom, and how it ends."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
import umsgpack
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from ddenv.runfile.lock import engine_lock
from ddenv.runfile.reading import plain
from ddenv.runfile.store import Live
from ddenv.runfile.tested import Wanted
from ddenv.runs import programs
from ddenv.runs.preferences import state_file
from ddenv.scene import server
from tests.tiers import slow
from tests.waiting import PATIENCE, wait_until


def url_of(process: subprocess.Popen) -> str:
    line = process.stdout.readline().strip()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{22}/", line), process.stderr.read()
    return line


def feed_of(url: str) -> str:
    return url.replace("http:", "ws:") + "feed"


def listening(pid: int) -> list[str]:
    """Local addresses (hexadecimal, as the kernel writes them) that a process listens on."""
    inodes = set()
    for handle in Path(f"/proc/{pid}/fd").iterdir():
        found = re.fullmatch(r"socket:\[(\d+)\]", str(handle.readlink()))
        inodes |= {found[1]} if found else set()
    addresses = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in inodes:
                addresses.append(words[1])
    return addresses


Told = list[bytes | str]


async def messages(
    url: str, enough: Callable[[Told], bool] = bool, headers: dict[str, str] | None = None
) -> Told:
    """What a browser is told from its first moment until that is `enough`."""
    connection = await websocket_connect(
        HTTPRequest(feed_of(url), headers=headers or {}), max_message_size=10_000_000
    )
    found: Told = []
    while not enough(found):
        found.append(await asyncio.wait_for(connection.read_message(), PATIENCE))
        assert found[-1] is not None, "the scene has hung up"
    connection.close()
    return found


def captions(found: Told) -> list[dict[str, str]]:
    return [json.loads(message) for message in found if isinstance(message, str)]


def titled(title: str) -> Callable[[Told], bool]:
    """Whether the last caption has a title that begins so."""
    return lambda found: any(words["title"].startswith(title) for words in captions(found)[-1:])


def matrix_of(found: Told, path: str) -> np.ndarray:
    """Where a browser has put what is at a path: the last transform, 4 x 4."""
    handlers = {code: lambda ext: ext for code in range(0x11, 0x19)}
    commands = [
        umsgpack.unpackb(one, ext_handlers=handlers) for one in found if isinstance(one, bytes)
    ]
    matrices = [
        one["matrix"] for one in commands if one["type"] == "set_transform" and one["path"] == path
    ]
    return np.array(matrices[-1]).reshape(4, 4).T if matrices else np.eye(4)


@pytest.fixture
def url(writer, start_scene) -> str:
    """A scene of a run after its baseline."""
    writer.baseline()
    return url_of(start_scene(writer.path))


def refusal(url: str, code: int) -> bytes:
    """What the scene says to a page that it refuses with this code."""
    with pytest.raises(HTTPError) as refused:
        urlopen(url)
    assert refused.value.code == code
    return refused.value.read()


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="needs Linux's /proc/net/tcp")
def test_listens_on_loopback_only(writer, start_scene):
    process = start_scene(writer.path)
    port = int(url_of(process).split(":")[2].split("/")[0])
    assert listening(process.pid) == [f"0100007F:{port:04X}"]


async def test_nobody_watches_without_the_token(url):
    root, token = url.rsplit("/", 2)[:2]
    for path in (
        "",
        "static/",
        "feed",
        "main.min.js",
        f"{token[:-1]}/",
        f"{'x' * len(token)}/",
        f"{token[:-1]}/feed",
    ):
        refusal(f"{root}/{path}", 403)
        with pytest.raises(HTTPClientError, match="403"):
            await websocket_connect(feed_of(f"{root}/{path}").removesuffix("feed"))


async def test_a_browser_gets_the_scene_and_its_words(url):
    def mention(found, words):
        return sum(isinstance(message, bytes) and words in message for message in found)

    def drawn_and_moving(found):
        return (
            captions(found)
            and mention(found, b"set_object") > 10
            and mention(found, b"/world/robot") > 2
        )

    words = captions(await messages(url, drawn_and_moving))[-1]
    assert (words["name"], words["models"]) == ("small", "4 of 4 models")
    assert (words["title"], words["kind"], words["test"]) == (
        "the failure f · test 1 · similar",
        "replay",
        1,
    )


def test_a_page_may_ask_for_itself_and_finished_tests_and_for_nothing_else(url):
    def told(path=""):
        with urlopen(url + path) as answer:
            return answer.read()

    assert b"main.min.js" in told()
    assert len(told("main.min.js")) > 100_000
    assert b"requestAnimationFrame" in told("playback.js")
    assert len(json.loads(told("play/1"))["robot"]) == 81
    assert json.loads(told("pairs")) == {"tests": 1, "pairs": []}
    drawn = told("way/1")
    assert int.from_bytes(drawn[:4], "big") == len(drawn) - 4
    for path in ("play/2", "play/0", "play/-1", "play/999999999", "still/7", "ghost-way/7"):
        assert refusal(url + path, 404).count(b"\n") == 0
    for path in (
        "play/--1",
        "play/1-",
        "play/1/2",
        "play/x",
        "play/1000000000",
        "index.js",
        "main.js",
    ):
        refusal(url + path, 403)
    for path in ("../__init__.py", "%2e%2e/%2e%2e/visualizer.py"):
        refusal(url + path, 403)


@pytest.mark.programs
async def test_a_running_test_is_followed(in_round, start_scene):
    in_round.start_test(2, candidate=1)
    with engine_lock(in_round.path):
        in_round.run.set_live(
            [Live(slot=0, test=2, time=1.5, pose=(1.0, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0))]
        )
        url = url_of(start_scene(in_round.path))
        words = captions(await messages(url, titled("round 1 · part B · test 2 · runs now")))[-1]
        assert words["time"] == "1.5 s of 45 s"
        # The board is pushed 0.5 m, and the robot drives 0.3 m, so far as its wheels roll.
        board = {"board": (1.5, -1.5, 0.1, 1.0, 0.0, 0.0, 0.0)}
        in_round.run.set_live(
            [
                Live(
                    slot=0,
                    test=2,
                    time=1.8,
                    pose=(1.3, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0),
                    models=board,
                )
            ]
        )
        found = await messages(url, lambda told: matrix_of(told, "/world/models/003 board")[0, 3])
        assert matrix_of(found, "/world/models/003 board")[:3, 3] == pytest.approx([0.5, 0.0, 0.0])
        wheel = matrix_of(found, "/world/robot/wheel 0")
        assert math.atan2(wheel[0, 2], wheel[0, 0]) == pytest.approx(0.3 / 0.1651)
    # The engine is gone without an event, and leaves its rows behind: the scene goes back to the
    # failure.
    await messages(url, titled("the failure f"))
    found = await messages(url_of(start_scene(in_round.path)), titled("the failure f"))
    assert not any("runs now" in words["title"] for words in captions(found))


@pytest.mark.programs
async def test_a_viewer_says_what_is_shown(in_round):
    begun = in_round.run.events()[-1].id
    in_round.reduce()
    process = programs.start_scene(in_round.path)
    try:
        url = url_of(process)
        process.stdin.write("nonsense\n" + f"{json.dumps(plain(Wanted(begun, 1, 1)))}\n")
        process.stdin.flush()
        await messages(url, titled("part B · not tested yet"))
        process.stdin.write(f"{json.dumps(plain(Wanted()))}\n")
        process.stdin.close()
        await messages(url, titled("the failure in what is left"))
    finally:
        process.kill()
        process.wait()


async def test_pages_from_elsewhere_are_refused_and_own_ones_are_welcome_also_through_a_tunnel(url):
    evil = "http://evil.example"
    # The last one has a name that was made to lead here.
    for origin, host in (
        *(
            (origin, None)
            for origin in (evil, "http://127.0.0.1.evil.example", "null", "http://[", "file://", "")
        ),
        (f"{evil}:7000", "evil.example:7000"),
    ):
        with pytest.raises(HTTPClientError) as error:
            await messages(url, headers={"Origin": origin} | ({"Host": host} if host else {}))
        assert error.value.code == 403, origin
    for origin in ("http://localhost:8123", "http://127.0.0.1:7000", "http://[::1]:7000"):
        assert await messages(url, headers={"Origin": origin})


@pytest.mark.parametrize(
    "number",
    slow(pytest.mark.programs, [signal.SIGTERM, signal.SIGINT, signal.SIGHUP], but=[signal.SIGINT]),
)
async def test_browsers_come_and_go_and_it_ends_cleanly(writer, start_scene, number):
    writer.baseline()
    url = url_of(process := start_scene(writer.path))
    for _ in range(2):
        assert await messages(url)
    connection = await websocket_connect(feed_of(url))
    connection.protocol.stream.close()
    assert await messages(url)
    connection = await websocket_connect(feed_of(url))
    process.send_signal(number)
    assert await asyncio.to_thread(process.wait, PATIENCE) == 0
    assert process.stderr.read() == ""
    connection.close()


def test_ends_with_its_parent(writer):
    code = (
        "import subprocess, sys\n"
        f"child = subprocess.Popen([sys.executable, '-m', 'ddenv.scene', {str(writer.path)!r}], "
        "stdout=subprocess.PIPE)\n"
        "print(child.pid, child.stdout.readline().decode(), flush=True)"
    )
    parent = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True
    )
    port = int(parent.stdout.split(":")[2].split("/")[0])

    def gone():
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) != 0

    try:
        wait_until(gone, lambda: "the scene outlives its parent")
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(parent.stdout.split()[0]), signal.SIGKILL)


@pytest.mark.programs
def test_a_scene_that_is_started_again_has_its_address_and_proves_it(writer, start_scene):
    # A port that the scenes of other tests do not try.
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    token = server.Server().token
    server.remember(writer.path, port, token)
    kept = state_file(server.FILE)
    assert kept.stat().st_mode & 0o777 == 0o600
    first = start_scene(writer.path)
    url = url_of(first)
    assert url == f"http://127.0.0.1:{port}/{token}/"
    second = url_of(start_scene(writer.path))
    assert second.endswith(f"/{token}/") and second != url
    first.kill()
    first.wait()
    server.remember(writer.path, port, token)
    assert url_of(start_scene(writer.path)) == url
    challenge, root = "0" * 32, f"http://127.0.0.1:{port}/alive"
    name, other = server.name_of(token), server.name_of("x")
    with urlopen(f"{root}/{name}/{challenge}") as answer:
        proof = answer.read().decode()
    assert proof == server.proof(token, challenge, port) != server.proof(token, challenge, port + 1)
    for path in (f"{other}/{challenge}", f"{token}/{challenge}", f"{name}/1"):
        refusal(f"{root}/{path}", 403)
    kept.write_text('{"x": [1, 2, 3]')
    assert server.last_address(writer.path)[0] == 0


def one_line(process: subprocess.Popen) -> str:
    """What a scene says that ends with a user's error."""
    assert process.wait(PATIENCE) == 2
    error = process.stderr.read()
    assert error.startswith("ddenv.scene: ") and error.count("\n") == 1
    return error


@pytest.mark.parametrize(
    "words",
    slow(
        pytest.mark.programs,
        [["missing.ddenv"], [__file__]],
        but=[[__file__]],
    ),
)
def test_user_errors_are_one_line(start_scene, words):
    one_line(process := start_scene(*words))
    assert process.stdout.read() == ""


@pytest.mark.programs
async def test_a_run_file_that_is_damaged_before_or_while_it_is_shown_is_one_line(
    writer, start_scene
):
    process = start_scene(writer.path)
    connection = await websocket_connect(feed_of(url_of(process)))
    writer.append("nonsense", {})
    for damaged in (process, start_scene(writer.path)):
        assert "unknown kind" in await asyncio.to_thread(one_line, damaged)
    connection.close()
