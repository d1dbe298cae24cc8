"""Serves the scene to browsers on this machine: a page, Meshcat's viewer, and a websocket that
feeds it.

Meshcat's own server listens on all interfaces, accepts drawing commands from any local program, and
keeps every property ever set. This one listens on the loopback interface only, accepts no commands,
and lets no foreign page read the scene. Its address has a token, so that other users of this
machine cannot watch.

The address of each run is remembered: pages that are still open come back to a scene that is
started again there. A page must not tell its token to whoever has taken the port meanwhile. So it
first asks for a proof: who serves the port has to sign a challenge with the token, and with its own
port, so that nobody can have another scene sign.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import json
import logging
import re
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import meshcat
import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

from ddenv.errors import UserError
from ddenv.page.html import of_scripts, policy
from ddenv.runs.preferences import read_state, write_state
from ddenv.runs.programs import FIRST_PORT
from ddenv.scene.player import Player

# Where the scenes of runs were served last, so many of them.
FILE = "scenes.json"
MOST = 50
TOKEN_BYTES = 16
_TOKEN = re.compile(r"[\w-]{22}")
LOOPBACK = "127.0.0.1"
TRIES = 1000
_LOCAL_NAMES = ("localhost", LOOPBACK, "::1")
_VIEWER = Path(meshcat.viewer_assets_path()) / "dist"
_PAGE = Path(__file__).with_name("page.html")
# Meshcat's control panel brings its own styles.
_POLICY = {
    "script-src": "'self'",
    "style-src": "'unsafe-inline'",
    "img-src": "'self' data: blob:",
    "connect-src": "'self' ws://127.0.0.1:* ws://localhost:*",
    "frame-ancestors": "'none'",
}
_PING = 15  # time between pings, s: lost browsers are noticed after about this time
# Maximum number of messages waiting for a slow browser before it skips some of the robot's moves.
_CROWDED = 100


class Server:
    """Sends the scene to all browsers. `welcome()` returns the messages that a new browser needs
    first.
    """

    def __init__(self, token: str = "") -> None:
        self.viewers: set[_Feed] = set()
        self.welcome: Callable[[], list[bytes]] = list
        self.caption = ""
        # Answers what a browser asks for.
        self.player: Player | None = None
        self.token = token or secrets.token_urlsafe(TOKEN_BYTES)
        self.port = 0
        routes: list[Any] = [
            (f"/{self.token}/feed", _Feed, {"server": self}),
            (f"/{self.token}/", _Page, {"server": self}),
            (
                rf"/{self.token}/(main\.min\.js)",
                tornado.web.StaticFileHandler,
                {"path": str(_VIEWER)},
            ),
            (
                rf"/{self.token}/(playback\.js)",
                tornado.web.StaticFileHandler,
                {"path": str(_PAGE.parent)},
            ),
            (
                rf"/{self.token}/(pairs|play|still|way|ghost-way)(?:/(-?\d{{1,9}}))?",
                _Asked,
                {"server": self},
            ),
            (rf"/alive/{name_of(self.token)}/([0-9a-f]{{32}})", _Alive, {"server": self}),
        ]
        application = tornado.web.Application(
            routes,
            default_handler_class=_Stranger,
            compress_response=True,
            log_function=lambda _: None,
            websocket_ping_interval=_PING,
            websocket_max_message_size=4096,
        )
        self._http = tornado.httpserver.HTTPServer(application)
        for name in ("tornado.general", "tornado.access"):
            logging.getLogger(name).setLevel(logging.ERROR)

    def listen(self, before: int = 0) -> str:
        """Starts on the port `before`, or else the first free one from `FIRST_PORT` up; returns the
        URL. Raises UserError.
        """
        for number in filter(None, (before, *range(FIRST_PORT, FIRST_PORT + TRIES))):
            try:
                sockets = tornado.netutil.bind_sockets(number, LOOPBACK)
            except OSError:
                continue
            self._http.add_sockets(sockets)
            self.port = number
            return f"http://{LOOPBACK}:{number}/{self.token}/"
        raise UserError(f"no free port from {FIRST_PORT} to {FIRST_PORT + TRIES - 1}")

    def send(self, message: bytes | str, newest_only: bool = False) -> None:
        """Sends a drawing message or a caption to every browser."""
        for viewer in tuple(self.viewers):
            viewer.pass_on(message, newest_only)

    def say(self, **words: Any) -> None:
        """Changes the caption over the picture."""
        caption = json.dumps(words | {"port": self.port})
        if caption != self.caption:
            self.caption = caption
            self.send(caption)

    async def close(self) -> None:
        self._http.stop()
        for viewer in tuple(self.viewers):
            viewer.close(1001, "the scene has ended")
        await self._http.close_all_connections()


class _Handler(tornado.web.RequestHandler):
    def initialize(self, server: Server) -> None:
        self._server = server

    def set_default_headers(self) -> None:
        self.set_header("Cache-Control", "no-store")


class _Page(_Handler):
    def get(self) -> None:
        page = _PAGE.read_text()
        self.set_header("Referrer-Policy", "no-referrer")
        scripts = f"{_POLICY['script-src']} {of_scripts(page)}"
        self.set_header("Content-Security-Policy", policy(_POLICY | {"script-src": scripts}))
        self.finish(page)


class _Alive(_Handler):
    """Proves to a page whose scene was gone that this is its scene."""

    def get(self, challenge: str) -> None:
        self.finish(proof(self._server.token, challenge, self._server.port))


class _Asked(_Handler):
    """Answers what a page asks for; reading is all that it can do."""

    def get(self, what: str, number: str | None) -> None:
        test = int(number or 0)
        player = self._server.player
        assert player is not None
        try:
            if what == "pairs":
                self.finish(player.pairs())
            elif what == "play":
                self.finish(player.play(test))
            else:
                self.set_header("Content-Type", "application/octet-stream")
                # Each message after its length in 4 bytes.
                self.finish(
                    b"".join(
                        len(one).to_bytes(4, "big") + one for one in player.drawings(what, test)
                    )
                )
        except UserError as error:
            self.set_status(404)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(str(error))


class _Stranger(tornado.web.RequestHandler):
    """Refuses all who do not know the token."""

    def prepare(self) -> None:
        self.set_status(403)
        self.finish("the address of this scene has a token; copy all of it from ddenv\n")


class _Feed(tornado.websocket.WebSocketHandler):
    def initialize(self, server: Server) -> None:
        self._server = server
        self._on_the_way = 0

    async def get(self, *args: str, **kwargs: str) -> None:
        # Tornado's own check would let in a page whose host name was made to resolve to this
        # machine (DNS rebinding).
        if not self.check_origin(self.request.headers.get("Origin", f"http://{LOOPBACK}")):
            raise tornado.web.HTTPError(403)
        await super().get(*args, **kwargs)

    def check_origin(self, origin: str) -> bool:
        # Any page in the user's browser can reach a loopback port; only our own page may read, also
        # through a tunnel.
        try:
            return urlsplit(origin).hostname in _LOCAL_NAMES
        except ValueError:
            return False

    def open(self, *_: str, **__: str) -> None:
        for message in self._server.welcome():
            self.pass_on(message)
        if self._server.caption:
            self.pass_on(self._server.caption)
        self._server.viewers.add(self)

    def on_message(self, _: str | bytes) -> None:
        """Ignores everything that browsers send."""

    def on_close(self) -> None:
        self._server.viewers.discard(self)

    def pass_on(self, message: bytes | str, newest_only: bool = False) -> None:
        """Sends `message`; drops a `newest_only` one while too many messages are waiting."""
        if newest_only and self._on_the_way > _CROWDED:
            return
        try:
            sent = self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            self._server.viewers.discard(self)
            return
        self._on_the_way += 1
        sent.add_done_callback(self._arrived)

    def _arrived(self, sent: asyncio.Future[None]) -> None:
        self._on_the_way -= 1
        # Retrieved, or asyncio would warn about it; a broken connection closes itself.
        sent.exception()


def last_address(run: Path) -> tuple[int, str]:
    """The port, 0 for none, and the token with which the scene of `run` was served last; a new
    token if there was none.
    """
    match _known().get(str(run.resolve())):
        case [int(port), str(token)] if 0 < port <= 65535 and _TOKEN.fullmatch(token):
            return port, token
    return 0, secrets.token_urlsafe(TOKEN_BYTES)


def remember(run: Path, port: int, token: str) -> None:
    """Remembers it, for this user alone, if it can be written."""
    known = _known()
    known.pop(name := str(run.resolve()), None)
    write_state(FILE, dict([*known.items(), (name, [port, token])][-MOST:]))


def _known() -> dict[str, object]:
    known = read_state(FILE)
    if isinstance(known, dict):
        return known
    return {}


def name_of(token: str) -> str:
    """What a page calls the scene without telling its token."""
    return hashlib.sha256(token.encode()).hexdigest()


def proof(token: str, challenge: str, port: int) -> str:
    """That the scene at `port` knows the token."""
    return hmac.new(token.encode(), f"{challenge} {port}".encode(), "sha256").hexdigest()
