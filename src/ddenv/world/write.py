"""Writes a world without some of its models: the original text with those models cut out, every other byte as it was."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

from ddenv.errors import UserError
from ddenv.world.model import World

_LINE_START = re.compile(rb"(\r\n|\n|\r)[ \t]*\Z")


def without(world: World, removed: frozenset[str]) -> bytes:
    """The text of `world` with the models named in `removed` cut out, each with the indentation and line it stood on."""
    unknown = removed - {model.name for model in world.models}
    if unknown:
        raise ValueError(f"no such model: {sorted(unknown)[0]}")
    spans = sorted(span for model in world.models if model.name in removed for span in model.spans)
    kept, at = [], 0
    for start, end in spans:
        kept.append(_LINE_START.sub(b"", world.text[at:start]) if _ends_line(world.text, end) else world.text[at:start])
        at = end
    kept.append(world.text[at:])
    return b"".join(kept)


def _ends_line(text: bytes, end: int) -> bool:
    return text[end : end + 1] in (b"\n", b"\r", b"")


def write_file(path: Path, content: bytes) -> None:
    """Writes all of `content` or nothing: a temporary file beside `path`, then a rename. Raises UserError."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o666 & ~_umask())
        Path(name).replace(path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
