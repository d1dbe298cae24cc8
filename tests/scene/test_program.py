"""The program: what it serves, to whom, and how it ends."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import Live


def url_of(process: subprocess.Popen) -> str:
    line = process.stdout.readline().strip()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/static/", line), process.stderr.read()
    return line


def feed_of(url: str) -> str:
    return url.replace("http:", "ws:").removesuffix("static/")


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


async def messages(url: str, seconds: float, headers: dict[str, str] | None = None) -> list[bytes | str]:
    """What a browser is told in its first `seconds`."""
    connection = await websocket_connect(HTTPRequest(feed_of(url), headers=headers or {}), max_message_size=10_000_000)
    found, end = [], time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        try:
            found.append(await asyncio.wait_for(connection.read_message(), left))
        except TimeoutError:
            break
    connection.close()
    return found


def caption(found: list[bytes | str]) -> dict[str, str]:
    return json.loads([message for message in found if isinstance(message, str)][-1])


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
    with urlopen(url.removesuffix("static/")) as answer:
        assert answer.url == url
    for path in ("index.js", "../__init__.py", "%2e%2e/%2e%2e/visualizer.py", "main.js"):
        with pytest.raises(HTTPError):
            urlopen(url + path)


async def test_a_browser_gets_the_scene_and_its_words(writer, start_scene):
    writer.baseline()
    found = await messages(url_of(start_scene(writer.path)), 1.0)
    drawn = [message for message in found if isinstance(message, bytes) and b"set_object" in message]
    assert len(drawn) > 10
    words = caption(found)
    assert (words["name"], words["models"]) == ("small", "4 of 4 models")
    assert words["title"] == "the failure f · test 1 · similar · replay at 4×"
    moves = [message for message in found if isinstance(message, bytes) and b"/world/robot" in message]
    assert len(moves) > 5


async def test_a_running_test_is_followed(writer, start_scene):
    writer.baseline()
    writer.round()
    writer.start_test(2, candidate=1)
    with engine_lock(writer.path):
        writer.run.set_live([Live(0, 2, 1.5, (1.0, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0))])
        url = url_of(start_scene(writer.path))
        words = caption(await messages(url, 0.7))
        assert words["title"] == "round 1 · part B · test 2 · runs now"
        assert words["time"] == "1.5 s of 45 s"
        writer.run.set_live([])
        writer.finish_test(2, "similar")
    # The engine is gone without an event: the scene goes back to the failure.
    assert caption(await messages(url, 3.6))["title"].startswith("the failure f")


async def test_rows_of_a_killed_engine_are_not_live(writer, start_scene):
    writer.baseline()
    writer.round()
    writer.start_test(2, candidate=1)
    writer.run.set_live([Live(0, 2, 1.5, (1.0, 0.0, 0.13, 1.0, 0.0, 0.0, 0.0))])
    url = url_of(start_scene(writer.path))
    assert caption(await messages(url, 0.5))["title"].startswith("the failure f")


async def test_pages_from_elsewhere_are_refused(writer, start_scene):
    url = url_of(start_scene(writer.path))
    for origin in ("http://evil.example", "http://127.0.0.1.evil.example", "null", "http://[", "file://", ""):
        with pytest.raises(HTTPClientError) as error:
            await messages(url, 0.3, {"Origin": origin})
        assert error.value.code == 403, origin


async def test_a_name_made_to_lead_here_is_refused(writer, start_scene):
    url = url_of(start_scene(writer.path))
    with pytest.raises(HTTPClientError) as error:
        await messages(url, 0.3, {"Origin": "http://evil.example:7000", "Host": "evil.example:7000"})
    assert error.value.code == 403


async def test_own_pages_are_welcome_also_through_a_tunnel(writer, start_scene):
    url = url_of(start_scene(writer.path))
    for origin in ("http://localhost:8123", "http://127.0.0.1:7000", "http://[::1]:7000"):
        assert await messages(url, 0.1, {"Origin": origin})


async def test_browsers_come_and_go(writer, start_scene):
    writer.baseline()
    process = start_scene(writer.path)
    url = url_of(process)
    for _ in range(3):
        assert await messages(url, 0.2)
    connection = await websocket_connect(feed_of(url))
    connection.protocol.stream.close()
    await asyncio.sleep(0.3)
    assert process.poll() is None
    assert await messages(url, 0.2)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_ends_cleanly(writer, start_scene, number):
    writer.baseline()
    process = start_scene(writer.path)
    connection = await websocket_connect(feed_of(url_of(process)))
    process.send_signal(number)
    assert await asyncio.to_thread(process.wait, 5) == 0
    assert process.stderr.read() == ""
    connection.close()


def test_ends_with_its_parent(writer):
    code = (
        "import subprocess, sys\n"
        f"child = subprocess.Popen([sys.executable, '-m', 'ddenv.scene', {str(writer.path)!r}], stdout=subprocess.PIPE)\n"
        "print(child.pid, child.stdout.readline().decode(), flush=True)"
    )
    parent = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=20, check=True)
    port = int(parent.stdout.split(":")[2].split("/")[0])
    deadline = time.monotonic() + 5
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                return
        time.sleep(0.05)
    os.kill(int(parent.stdout.split()[0]), signal.SIGKILL)
    pytest.fail("the scene outlives its parent")


def test_a_chosen_port_and_the_next_free_one(writer, start_scene):
    first = url_of(start_scene(writer.path))
    second = url_of(start_scene(writer.path))
    assert first != second
    taken = first.split(":")[2].split("/")[0]
    process = start_scene(writer.path, "--port", taken)
    assert process.wait(10) == 2
    assert process.stderr.read().count("\n") == 1


@pytest.mark.parametrize(
    "words", [["missing.ddenv"], [], [__file__], [__file__, "--port", "many"], [__file__, "--wrong"]]
)
def test_user_errors_are_one_line(start_scene, words):
    process = start_scene(*words)
    assert process.wait(10) == 2
    error = process.stderr.read()
    assert error.startswith("ddenv.scene: ")
    assert error.count("\n") == 1
    assert process.stdout.read() == ""


@pytest.mark.parametrize("port", ["-1", "70000", "99999999999"])
def test_ports_that_do_not_exist(writer, start_scene, port):
    process = start_scene(writer.path, "--port", port)
    assert process.wait(10) == 2
    assert process.stderr.read().count("\n") == 1


def test_a_damaged_run_file_is_one_line(writer, start_scene):
    writer.run.append("nonsense", {})
    process = start_scene(writer.path)
    assert process.wait(10) == 2
    error = process.stderr.read()
    assert "unknown kind" in error
    assert error.count("\n") == 1


async def test_a_run_file_that_is_damaged_while_shown(writer, start_scene):
    process = start_scene(writer.path)
    connection = await websocket_connect(feed_of(url_of(process)))
    writer.run.append("nonsense", {})
    assert await asyncio.to_thread(process.wait, 5) == 2
    assert process.stderr.read().count("\n") == 1
    connection.close()
