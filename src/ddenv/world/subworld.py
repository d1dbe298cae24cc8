"""Writes a world without some of its models: the original text with those models cut out, every other byte as it was."""

from __future__ import annotations

import re

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
