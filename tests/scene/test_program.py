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
from ddenv.runfile.store import Live
from ddenv.runs import programs
from ddenv.runs.remembered import state_file
from ddenv.runs.wanted import Wanted, written
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


async def messages(url: str, enough: Callable[[Told], bool] = bool, headers: dict[str, str] | None = None) -> Told:
    """What a browser is told from its first moment until that is `enough`."""
    connection = await websocket_connect(HTTPRequest(feed_of(url), headers=headers or {}), max_message_size=10_000_000)
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
    commands = [umsgpack.unpackb(one, ext_handlers=handlers) for one in found if isinstance(one, bytes)]
    matrices = [one["matrix"] for one in commands if one["type"] == "set_transform" and one["path"] == path]
    return np.array(matrices[-1]).reshape(4, 4).T if matrices else np.eye(4)


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="needs Linux's /proc/net/tcp")
def test_listens_on_loopback_only(writer, start_scene):
    process = start_scene(writer.path)
    port = int(url_of(process).split(":")[2].split("/")[0])
    assert listening(process.pid) == [f"0100007F:{port:04X}"]


def test_page_and_viewer_are_served_and_nothing_else(writer, start_scene):
    url = url_of(start_scene(writer.path))
    with urlopen(url) as answer:
        assert b"main.min.js" in answer.read()
    with urlopen(url + "main.min.js") as answer:
        assert len(answer.read()) > 100_000
    for path in ("index.js", "../__init__.py", "%2e%2e/%2e%2e/visualizer.py", "main.js"):
        with pytest.raises(HTTPError):
            urlopen(url + path)


async def test_nobody_watches_without_the_token(writer, start_scene):
    url = url_of(start_scene(writer.path))
    root, token = url.rsplit("/", 2)[:2]
    for path in ("", "static/", "feed", "main.min.js", f"{token[:-1]}/", f"{'x' * len(token)}/", f"{token[:-1]}/feed"):
        with pytest.raises(HTTPError) as refused:
            urlopen(f"{root}/{path}")
        assert refused.value.code == 403
        with pytest.raises(HTTPClientError, match="403"):
            await websocket_connect(feed_of(f"{root}/{path}").removesuffix("feed"))


async def test_a_browser_gets_the_scene_and_its_words(writer, start_scene):
    writer.baseline()

    def mention(found, words):
        return sum(isinstance(message, bytes) and words in message for message in found)

    def drawn_and_moving(found):
        return captions(found) and mention(found, b"set_object") > 10 and mention(found, b"/world/robot") > 2

    words = captions(await messages(url_of(start_scene(writer.path)), drawn_and_moving))[-1]
    assert (words["name"], words["models"]) == ("small", "4 of 4 models")
    assert (words["title"], words["kind"], words["test"]) == ("the failure f · test 1 · similar", "replay", 1)


def test_a_page_may_ask_for_finished_tests_and_for_nothing_else(writer, start_scene):
    writer.baseline()
    url = url_of(start_scene(writer.path))
    with urlopen(url + "playback.js") as answer:
        assert b"requestAnimationFrame" in answer.read()
    with urlopen(url + "play/1") as answer:
        assert len(json.load(answer)["robot"]) == 81
    with urlopen(url + "pairs") as answer:
        assert json.load(answer) == {"tests": 1, "pairs": []}
    with urlopen(url + "way/1") as answer:
        drawn = answer.read()
        assert int.from_bytes(drawn[:4], "big") == len(drawn) - 4
    for path in ("play/2", "play/0", "play/999999999", "still/7", "ghost-way/7"):
        with pytest.raises(HTTPError) as refused:
            urlopen(url + path)
        assert refused.value.code == 404
        assert refused.value.read().count(b"\n") == 0
    for path in ("play/-1", "play/1/2", "play/x", "play/1000000000"):
        with pytest.raises(HTTPError) as refused:
            urlopen(url + path)
        assert refused.value.code == 403


@pytest.mark.programs
async def test_a_running_test_is_followed(writer, start_scene):
    writer.baseline()
    writer.round()
    writer.start_test(2, candidate=1)
    with engine_lock(writer.path):
        writer.run.set_live([Live(0, 2, 1.5, (1.0, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0))])
        url = url_of(start_scene(writer.path))
        words = captions(await messages(url, titled("round 1 · part B · test 2 · runs now")))[-1]
        assert words["time"] == "1.5 s of 45 s"
        # The board is pushed 0.5 m, and the robot drives 0.3 m, so far as its wheels roll.
        board = {"board": (1.5, -1.5, 0.1, 1.0, 0.0, 0.0, 0.0)}
        writer.run.set_live([Live(0, 2, 1.8, (1.3, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0), board)])
        found = await messages(url, lambda told: matrix_of(told, "/world/models/003 board")[0, 3])
        assert matrix_of(found, "/world/models/003 board")[:3, 3] == pytest.approx([0.5, 0.0, 0.0])
        wheel = matrix_of(found, "/world/robot/wheel 0")
        assert math.atan2(wheel[0, 2], wheel[0, 0]) == pytest.approx(0.3 / 0.1651)
        writer.run.set_live([])
        writer.finish_test(2, "similar")
    # The engine is gone without an event: the scene goes back to the failure.
    await messages(url, titled("the failure f"))


@pytest.mark.programs
async def test_a_viewer_says_what_is_shown(writer):
    writer.baseline()
    writer.round()
    begun = writer.run.events()[-1].id
    writer.reduce()
    process = programs.start_scene(writer.path)
    try:
        url = url_of(process)
        process.stdin.write("nonsense\n" + written(Wanted(begun, 1, 1)))
        process.stdin.flush()
        await messages(url, titled("part B · not tested yet"))
        process.stdin.write(written(Wanted()))
        process.stdin.close()
        await messages(url, titled("the failure in what is left"))
    finally:
        process.kill()
        process.wait()


@pytest.mark.programs
async def test_rows_of_a_killed_engine_are_not_live(writer, start_scene):
    writer.baseline()
    writer.round()
    writer.start_test(2, candidate=1)
    writer.run.set_live([Live(0, 2, 1.5, (1.0, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0))])
    url = url_of(start_scene(writer.path))
    found = await messages(url, titled("the failure f"))
    assert not any("runs now" in words["title"] for words in captions(found))


async def test_pages_from_elsewhere_are_refused(writer, start_scene):
    url = url_of(start_scene(writer.path))
    for origin in ("http://evil.example", "http://127.0.0.1.evil.example", "null", "http://[", "file://", ""):
        with pytest.raises(HTTPClientError) as error:
            await messages(url, headers={"Origin": origin})
        assert error.value.code == 403, origin


@pytest.mark.programs
async def test_a_name_made_to_lead_here_is_refused(writer, start_scene):
    url = url_of(start_scene(writer.path))
    with pytest.raises(HTTPClientError) as error:
        await messages(url, headers={"Origin": "http://evil.example:7000", "Host": "evil.example:7000"})
    assert error.value.code == 403


async def test_own_pages_are_welcome_also_through_a_tunnel(writer, start_scene):
    url = url_of(start_scene(writer.path))
    for origin in ("http://localhost:8123", "http://127.0.0.1:7000", "http://[::1]:7000"):
        assert await messages(url, headers={"Origin": origin})


@pytest.mark.programs
async def test_browsers_come_and_go(writer, start_scene):
    writer.baseline()
    process = start_scene(writer.path)
    url = url_of(process)
    for _ in range(3):
        assert await messages(url)
    connection = await websocket_connect(feed_of(url))
    connection.protocol.stream.close()
    assert await messages(url)
    assert process.poll() is None


@pytest.mark.parametrize(
    "number", slow(pytest.mark.programs, [signal.SIGTERM, signal.SIGINT, signal.SIGHUP], but=[signal.SIGINT])
)
async def test_ends_cleanly(writer, start_scene, number):
    writer.baseline()
    process = start_scene(writer.path)
    connection = await websocket_connect(feed_of(url_of(process)))
    process.send_signal(number)
    assert await asyncio.to_thread(process.wait, PATIENCE) == 0
    assert process.stderr.read() == ""
    connection.close()


def test_ends_with_its_parent(writer):
    code = (
        "import subprocess, sys\n"
        f"child = subprocess.Popen([sys.executable, '-m', 'ddenv.scene', {str(writer.path)!r}], stdout=subprocess.PIPE)\n"
        "print(child.pid, child.stdout.readline().decode(), flush=True)"
    )
    parent = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True)
    port = int(parent.stdout.split(":")[2].split("/")[0])

    def gone():
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) != 0

    try:
        wait_until(gone, lambda: "the scene outlives its parent")
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(parent.stdout.split()[0]), signal.SIGKILL)


def test_a_scene_that_is_started_again_has_its_address_and_proves_it(writer, start_scene):
    first = start_scene(writer.path)
    url = url_of(first)
    port, token = int(url.split(":")[2].split("/")[0]), url.split("/")[-2]
    kept = state_file(server.FILE)
    assert kept.stat().st_mode & 0o777 == 0o600
    second = url_of(start_scene(writer.path))
    assert second.endswith(f"/{token}/") and second != url
    first.kill()
    first.wait()
    server.remember(writer.path, port, token)
    assert url_of(start_scene(writer.path)) == url
    challenge, root = "0" * 32, f"http://127.0.0.1:{port}/alive"
    with urlopen(f"{root}/{server.name_of(token)}/{challenge}") as answer:
        assert (
            answer.read().decode() == server.proof(token, challenge, port) != server.proof(token, challenge, port + 1)
        )
    for path in (
        f"{root}/{server.name_of('x')}/{challenge}",
        f"{root}/{token}/{challenge}",
        f"{root}/{server.name_of(token)}/1",
    ):
        with pytest.raises(HTTPError):
            urlopen(path)
    kept.write_text('{"x": [1, 2, 3]')
    assert server.last_address(writer.path)[0] == 0


@pytest.mark.programs
def test_a_chosen_port_and_the_next_free_one(writer, start_scene):
    first = url_of(start_scene(writer.path))
    second = url_of(start_scene(writer.path))
    assert first != second
    taken = first.split(":")[2].split("/")[0]
    process = start_scene(writer.path, "--port", taken)
    assert process.wait(PATIENCE) == 2
    assert process.stderr.read().count("\n") == 1


@pytest.mark.parametrize(
    "words",
    slow(
        pytest.mark.programs,
        [["missing.ddenv"], [], [__file__], [__file__, "--port", "many"], [__file__, "--wrong"]],
        but=[[__file__]],
    ),
)
def test_user_errors_are_one_line(start_scene, words):
    process = start_scene(*words)
    assert process.wait(PATIENCE) == 2
    error = process.stderr.read()
    assert error.startswith("ddenv.scene: ")
    assert error.count("\n") == 1
    assert process.stdout.read() == ""


@pytest.mark.programs
@pytest.mark.parametrize("port", ["-1", "70000", "99999999999"])
def test_ports_that_do_not_exist(writer, start_scene, port):
    process = start_scene(writer.path, "--port", port)
    assert process.wait(PATIENCE) == 2
    assert process.stderr.read().count("\n") == 1


@pytest.mark.programs
def test_a_damaged_run_file_is_one_line(writer, start_scene):
    writer.append("nonsense", {})
    process = start_scene(writer.path)
    assert process.wait(PATIENCE) == 2
    error = process.stderr.read()
    assert "unknown kind" in error
    assert error.count("\n") == 1


@pytest.mark.programs
async def test_a_run_file_that_is_damaged_while_shown(writer, start_scene):
    process = start_scene(writer.path)
    connection = await websocket_connect(feed_of(url_of(process)))
    writer.append("nonsense", {})
    assert await asyncio.to_thread(process.wait, PATIENCE) == 2
    assert process.stderr.read().count("\n") == 1
    connection.close()
