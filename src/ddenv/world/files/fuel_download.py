"""Downloads a model from Gazebo Fuel into its cache, where Gazebo finds it, too.

What comes is not trusted: only https, within limits, and nothing is written outside of the cache. A
version of a model is in the cache whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from http.client import HTTPException, HTTPResponse
from lzma import LZMAError
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import (
    HTTPDefaultErrorHandler,
    HTTPErrorProcessor,
    HTTPRedirectHandler,
    HTTPSHandler,
    OpenerDirector,
    ProxyHandler,
    Request,
    UnknownHandler,
)

from ddenv.world.access import SDF_ENDINGS, Unusable
from ddenv.world.files.fuel import HOSTS, FuelModel, caches, quoted, refuse_link_out

# The longest wait for a byte, s.
TIMEOUT = 30.0
# The longest wait for a whole model, s.
LONGEST = 3600.0
# The maximum size of an archive, bytes.
ARCHIVE_LIMIT = 1_000_000_000
# The maximum size of all files in it, bytes, and their maximum number.
FILES_LIMIT = 4_000_000_000
MOST_FILES = 20_000
CHUNK = 1 << 16  # bytes
# The header in which Fuel says what the newest version is.
VERSION = "X-Ign-Resource-Version"
# Beside the model's own files: what was downloaded.
RECORD = "ddenv-fetched.json"
# How the standard library says that a zip file cannot be unpacked.
DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    LZMAError,
    EOFError,
    NotImplementedError,
    RuntimeError,
    ValueError,
)

# Gets the bytes that have come so far, and how many will, if the server says it.
Shown = Callable[[int, int | None], None]


@dataclass(frozen=True)
class Archive:
    """What the server sent: a zip file with one version of a model."""

    url: str
    version: str
    size: int
    sha256: str


def download(model: FuelModel, shown: Shown) -> tuple[Path, Archive | None]:
    """Downloads a model into the first of Fuel's caches; returns its folder there, and what came.

    A folder that is there already is left as it is: None. Raises Unusable, with nothing left
    behind.
    """
    cache = caches()[0]
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".ddenv-", dir=cache) as temporary:
            file = Path(temporary, "archive.zip")
            unpacked = Path(temporary, "model")
            archive = _receive(model, file, shown)
            folder = cache / HOSTS[0] / model.folder / archive.version
            refuse_link_out(folder)
            if folder.exists():
                return folder, None
            _unpack(file, unpacked)
            (unpacked / RECORD).write_text(json.dumps(asdict(archive)))
            folder.parent.mkdir(parents=True, exist_ok=True)
            unpacked.rename(folder)
            return folder, archive
    except (OSError, HTTPException) as error:
        raise Unusable(_reason(error)) from None


def _receive(model: FuelModel, file: Path, shown: Shown) -> Archive:
    """Writes what the server sends to `file`."""
    url = f"{replace(model, version=model.version or 'tip').url}/{quoted(model.name)}.zip"
    with _opener().open(Request(url, headers={"User-Agent": "ddenv"}), timeout=TIMEOUT) as response:
        version = response.headers.get(VERSION) or model.version
        if not re.fullmatch("[1-9][0-9]{0,8}", version) or model.version not in ("", version):
            raise Unusable(
                f"the server sent version '{version[:20]}' in place of "
                f"{model.version or 'the newest one'}"
            )
        digest = _copy(response, file, shown)
        if not zipfile.is_zipfile(file):
            raise Unusable(
                f"the server sent {response.headers.get_content_type()[:40]}, which is no zip file"
            )
    return Archive(url, version, file.stat().st_size, digest)


def _opener() -> OpenerDirector:
    """Opens https alone: a redirection to anything else fails, too."""
    opener = OpenerDirector()
    for handler in (
        ProxyHandler,
        HTTPSHandler,
        HTTPRedirectHandler,
        HTTPDefaultErrorHandler,
        HTTPErrorProcessor,
        UnknownHandler,
    ):
        opener.add_handler(handler())
    return opener


def _copy(response: HTTPResponse, file: Path, shown: Shown) -> str:
    """Writes what comes to `file`; returns its SHA-256."""
    said = response.headers.get("Content-Length") or ""
    total = int(said) if re.fullmatch("[0-9]{1,18}", said) else None
    received = 0
    digest = hashlib.sha256()
    started = time.monotonic()
    with file.open("wb") as written:
        while True:
            if max(received, total or 0) > ARCHIVE_LIMIT:
                raise Unusable(f"is larger than {ARCHIVE_LIMIT / 1e6:.0f} MB, the maximum")
            if time.monotonic() - started > LONGEST:
                raise Unusable(f"took longer than {LONGEST / 60:.0f} min, the maximum")
            shown(received, total)
            # Unlike `read`, it returns what has come.
            chunk = response.read1(CHUNK)
            if not chunk:
                break
            written.write(chunk)
            digest.update(chunk)
            received += len(chunk)
    if total is not None and received != total:
        raise Unusable(f"the connection broke after {received} of {total} bytes")
    return digest.hexdigest()


def _unpack(file: Path, folder: Path) -> None:
    """Writes the files of a zip file into the new `folder`; their checksums are compared as they
    are read.
    """
    try:
        with zipfile.ZipFile(file) as zipped:
            entries = zipped.infolist()
            if len(entries) > MOST_FILES or sum(entry.file_size for entry in entries) > FILES_LIMIT:
                raise Unusable(
                    f"has more than {MOST_FILES} files or {FILES_LIMIT / 1e6:.0f} MB, the maximum"
                )
            if not any(
                entry.filename == "model.config" or entry.filename.endswith(SDF_ENDINGS)
                for entry in entries
            ):
                raise Unusable(
                    "the zip file that the server sent holds neither model.config nor an SDF file"
                )
            for entry in filter(_leads_out, entries):
                what = f"'{entry.filename[:80]}', which leads out of its folder"
                raise Unusable(f"the zip file that the server sent holds {what}")
            zipped.extractall(folder)
    except DAMAGED as error:
        raise Unusable(f"the zip file that the server sent is damaged: {error}") from None


def _leads_out(entry: zipfile.ZipInfo) -> bool:
    """Whether a file of a zip file is a link, or would be outside of its folder."""
    name = entry.filename
    is_link = stat.S_ISLNK(entry.external_attr >> 16)
    return is_link or name.startswith("/") or ".." in name.split("/") or "\\" in name


def _reason(error: OSError | HTTPException) -> str:
    if isinstance(error, HTTPError):
        if error.code == 404:
            return "is not in Fuel"
        return f"the server answered {error.code} {error.reason}"
    cause = error.reason if isinstance(error, URLError) else error
    if isinstance(cause, TimeoutError):
        return f"the server sent nothing for {TIMEOUT:g} s"
    if isinstance(cause, OSError):
        return cause.strerror or str(cause)
    return str(cause) or type(cause).__name__
