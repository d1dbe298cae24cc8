"""Where the scene of a run was served last: pages that are still open come back to a scene that is started again there.

A page must not tell its token to whoever has taken the port meanwhile. So it first asks for a proof: who serves the port has to
sign a challenge with the token, and with its own port, so that nobody can have another scene sign.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import re
import secrets
from pathlib import Path

from ddenv.runs.remembered import read_state, state_file

FILE = "scenes.json"
# Runs that are remembered.
MOST = 50
TOKEN_BYTES = 16
_TOKEN = re.compile(r"[\w-]{22}")


def last_address(run: Path) -> tuple[int, str]:
    """The port, 0 for none, and the token with which the scene of `run` was served last; a new token if there was none."""
    found = _known().get(str(run.resolve()))
    match found:
        case [int(port), str(token)] if 0 < port <= 65535 and _TOKEN.fullmatch(token):
            return port, token
    return 0, secrets.token_urlsafe(TOKEN_BYTES)


def remember(run: Path, port: int, token: str) -> None:
    """Remembers it, for this user alone, if it can be written."""
    name = str(run.resolve())
    known = {each: where for each, where in _known().items() if each != name}
    kept = dict([*known.items(), (name, [port, token])][-MOST:])
    place = state_file(FILE)
    fresh = place.with_name(f"{place.name}.{os.getpid()}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w") as file:
            json.dump(kept, file)
        fresh.replace(place)
    except OSError:
        return


def _known() -> dict[str, object]:
    known = read_state(FILE)
    return known if isinstance(known, dict) else {}


def name_of(token: str) -> str:
    """What a page calls the scene without telling its token."""
    return hashlib.sha256(token.encode()).hexdigest()


def proof(token: str, challenge: str, port: int) -> str:
    """That the scene at `port` knows the token."""
    return hmac.new(token.encode(), f"{challenge} {port}".encode(), "sha256").hexdigest()
