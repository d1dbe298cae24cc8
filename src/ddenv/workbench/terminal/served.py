"""The workbench in a browser: textual-serve starts one for each page, only on this machine's own
address.

The address has a token, so that other users of this machine cannot act as this one.
"""

from __future__ import annotations

import getpass
import hmac
import secrets
import shlex
import socket
import sys
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.page.html import of_scripts, policy
from ddenv.runs.folder import find_run
from ddenv.runs.programs import how_to_install

HOST = "127.0.0.1"
TOKEN_BYTES = 16
# textual-serve's own page fetches fonts from elsewhere.
PAGE = Path(__file__).with_name("served_page")

# The page's own, in pixels.
FONT_SIZE = 16


def serve(port: int, run: str | None = None, font_size: int = FONT_SIZE) -> None:
    """Serves until interrupted; each page has its own workbench, attached to `run` if given, in
    letters of `font_size` pixels.

    Raises UserError if textual-serve is not installed, the port is taken, or the run does not
    exist.
    """
    try:
        from textual_serve.server import Server
    except ModuleNotFoundError:
        raise UserError(f"serving needs another package: {how_to_install('serve')}") from None
    words = [sys.executable, "-m", "ddenv"]
    if run is not None:
        from ddenv.workbench.shared.observed import Observed

        Observed(path := find_run(run)).close()
        words += ["open", str(path.resolve())]
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise UserError(f"--port {port}: {error.strerror}; give another --port") from None
    token = secrets.token_urlsafe(TOKEN_BYTES)

    class Guarded(Server):
        """Answers only requests of its own pages, and prints only ddenv's lines."""

        async def _make_app(self) -> Any:
            from aiohttp import web

            app = web.Application(middlewares=[guard(port, token)])
            app.add_subapp(f"/{token}", await super()._make_app())
            return app

        async def on_startup(self, app: Any) -> None:
            size = "" if font_size == FONT_SIZE else f"?fontsize={font_size}"
            user = getpass.getuser()
            lines = (
                f"The workbench is at http://{HOST}:{port}/{token}/{size} (ctrl+c ends it).",
                f"Anyone with that address acts as {user} on this machine: the workbench can "
                "read, write and start programs in your name.",
                "Other machines cannot reach it. From yours, type there first:",
                f"  ssh -L {port}:{HOST}:{port} {user}@{socket.gethostname()}",
            )
            print("\n".join(lines), flush=True)

        def initialize_logging(self) -> None:
            """Requests are not logged."""

    Guarded(shlex.join(words), host=HOST, port=port, title="ddenv", templates_path=PAGE).serve()


def guard(port: int, token: str) -> Any:
    """Refuses requests without the token, and those of other web pages in a browser on this
    machine.
    """
    from aiohttp import web

    own = {f"{host}:{port}" for host in (HOST, "localhost")}
    sources = " ".join(f"ws://{host}" for host in sorted(own))

    @web.middleware
    async def only_own(request: Any, handler: Any) -> Any:
        origin = request.headers.get("Origin")
        given = request.path.encode().split(b"/")[1]
        if not hmac.compare_digest(given, token.encode()):
            raise web.HTTPForbidden(
                text=(
                    "the address of this workbench has a token; copy all of it from 'ddenv serve'\n"
                )
            )
        if request.host not in own or (
            origin is not None and origin.removeprefix("http://") not in own
        ):
            raise web.HTTPForbidden(text=f"open http://{HOST}:{port} itself\n")
        response = await handler(request)
        if not response.prepared:
            # Other pages must not show it in a frame to catch clicks.
            response.headers["X-Frame-Options"] = "DENY"
            response.headers["Referrer-Policy"] = "no-referrer"
            if response.content_type == "text/html" and hasattr(response, "text"):
                text = response.text
            else:
                text = ""
            # What a page may load and run: the terminal of textual-serve, and the connection to the
            # workbench.
            rules = {
                "script-src": f"'self' {of_scripts(text or '')}".strip(),
                # The terminal writes the style of each cell.
                "style-src": "'self' 'unsafe-inline'",
                "font-src": "'self'",
                "img-src": "'self' data:",
                "connect-src": f"'self' {sources}",
                "frame-ancestors": "'none'",
            }
            response.headers["Content-Security-Policy"] = policy(rules)
        return response

    return only_own
