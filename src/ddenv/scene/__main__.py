"""`python -m ddenv.scene RUN [--port N] [--pointed]`: serves the 3-D scene of a run until it is stopped or its parent exits.

The first line of output is the URL. User errors are one line on standard error, with exit code 2.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from ddenv.errors import UserError
from ddenv.runfile.reading import Invalid, read
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import Wanted
from ddenv.scene.player import Player
from ddenv.scene.server import Server, last_address, remember
from ddenv.scene.stage import Stage

PERIOD = 0.1  # time between two updates of the scene, s


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UserError(f"{message}; usage: python -m ddenv.scene RUN [--port N] [--pointed]")


def main() -> int:
    parent = os.getppid()
    parser = _Parser(prog="python -m ddenv.scene", description="Serves the 3-D scene of a run on this machine.")
    parser.add_argument("run", type=Path, metavar="RUN", help="a run file")
    parser.add_argument("--port", type=int, default=0, help="port on 127.0.0.1; 0 picks a free one from 7000 upwards")
    parser.add_argument("--pointed", action="store_true", help="read what to show from standard input")
    try:
        arguments = parser.parse_args()
        with RunFile(arguments.run) as run:
            asyncio.run(_serve(run, arguments.port, parent, arguments.pointed))
    except UserError as error:
        print(f"ddenv.scene: {error}", file=sys.stderr)
        return 2
    return 0


async def _serve(run: RunFile, port: int, parent: int, pointed: bool) -> None:
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        loop.add_signal_handler(name, ended.set)
    before, token = last_address(run.path)
    server = Server(token)
    stage = Stage(server.send)
    server.welcome = stage.messages
    player = Player(run, stage, server.say)
    server.player = player
    url = server.listen(port, before)
    remember(run.path, server.port, token)
    player.tick(time.monotonic())
    print(url, flush=True)
    if pointed:
        os.set_blocking(sys.stdin.fileno(), False)
        loop.add_reader(sys.stdin.fileno(), _point, player, loop)
    while not ended.is_set() and os.getppid() == parent:
        if server.viewers:
            player.tick(time.monotonic())
        await asyncio.sleep(PERIOD)
    await server.close()


def _point(player: Player, loop: asyncio.AbstractEventLoop) -> None:
    """Shows what the last line of standard input asks for: a viewer writes each line at once."""
    said = os.read(sys.stdin.fileno(), 1 << 16)
    if not said:
        loop.remove_reader(sys.stdin.fileno())
        return
    with suppress(Invalid):
        player.show(read(Wanted, said.decode(errors="replace").splitlines()[-1]))


if __name__ == "__main__":
    sys.exit(main())
