"""The workbench in a browser: textual-serve starts one for each page, only on this machine's own address."""

from __future__ import annotations

import getpass
import shlex
import socket
import sys
from pathlib import Path
from typing import Any

from ddenv.errors import UserError

HOST = "127.0.0.1"


def serve(port: int, run: str | None = None) -> None:
    """Serves until interrupted; each page has its own workbench, attached to `run` if given.

    Raises UserError if textual-serve is not installed, the port is taken, or the run does not exist.
    """
    try:
        from textual_serve.server import Server
    except ModuleNotFoundError:
        raise UserError("serving needs another package: pip install 'ddenv[serve]'") from None
    words = [sys.executable, "-m", "ddenv"]
    if run is not None:
        from ddenv.runs.folder import find_run

        words += ["open", str(_existing(find_run(run)))]
    _check_free(port)

    class Guarded(Server):
        """Answers only requests of its own pages, and prints only ddenv's lines."""

        async def _make_app(self) -> Any:
            app = await super()._make_app()
            app.middlewares.append(guard(port))
            return app

        async def on_startup(self, app: Any) -> None:
            print("\n".join(address_lines(port)), flush=True)

        def initialize_logging(self) -> None:
            """Requests are not logged."""

    Guarded(shlex.join(words), host=HOST, port=port, title="ddenv").serve()


def address_lines(port: int) -> list[str]:
    """The address, and who can use it."""
    return [
        f"The workbench is at http://{HOST}:{port} (ctrl+c ends it).",
        f"Any user of this machine who opens that address acts as {getpass.getuser()}: the workbench can read, write and "
        "start programs in your name.",
        "Other machines cannot reach it. From yours, type there first:",
        f"  ssh -L {port}:{HOST}:{port} {getpass.getuser()}@{socket.gethostname()}",
    ]


def guard(port: int) -> Any:
    """Refuses requests of other web pages in a browser on this machine."""
    from aiohttp import web

    own = {f"{host}:{port}" for host in (HOST, "localhost")}

    @web.middleware
    async def only_own(request: Any, handler: Any) -> Any:
        origin = request.headers.get("Origin")
        if request.host not in own or (origin is not None and origin.removeprefix("http://") not in own):
            raise web.HTTPForbidden(text=f"open http://{HOST}:{port} itself")
        response = await handler(request)
        if not response.prepared:
            # Other pages must not show it in a frame to catch clicks.
            response.headers["X-Frame-Options"] = "DENY"
        return response

    return only_own


def _existing(run: Path) -> Path:
    from ddenv.workbench.run.observed import Observed

    Observed(run).close()
    return run.resolve()


def _check_free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise UserError(f"--port {port}: {error.strerror}; give another --port") from None
