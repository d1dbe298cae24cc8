"""`python -m ddenv.scene RUN`: serves the 3-D scene of a run until it is stopped or its parent
exits.

The first line of output is the URL; a line of input says what to show (`Wanted`). User errors are
one line on standard error, with exit code 2.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.reading import Invalid, read
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import Wanted
from ddenv.scene.player import Player
from ddenv.scene.server import Server, last_address, remember
from ddenv.scene.stage import Stage

PERIOD = 0.1  # time between two updates of the scene, s


def main() -> int:
    parent = os.getppid()
    try:
        with RunFile(Path(sys.argv[1])) as run:
            asyncio.run(_serve(run, parent))
    except UserError as error:
        print(f"ddenv.scene: {error}", file=sys.stderr)
        return 2
    return 0


async def _serve(run: RunFile, parent: int) -> None:
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
    url = server.listen(before)
    remember(run.path, server.port, token)
    player.tick(time.monotonic())
    print(url, flush=True)
    os.set_blocking(sys.stdin.fileno(), False)

    def point() -> None:
        """Shows what the last line of standard input asks for: a viewer writes each line at
        once.
        """
        if not (said := os.read(sys.stdin.fileno(), 1 << 16)):
            loop.remove_reader(sys.stdin.fileno())
            return
        with suppress(Invalid):
            player.show(read(Wanted, said.decode(errors="replace").splitlines()[-1]))

    # Without a pipe nobody asks for anything.
    with suppress(PermissionError):
        loop.add_reader(sys.stdin.fileno(), point)
    while not ended.is_set() and os.getppid() == parent:
        if server.viewers:
            player.tick(time.monotonic())
        await asyncio.sleep(PERIOD)
    await server.close()


if __name__ == "__main__":
    sys.exit(main())
