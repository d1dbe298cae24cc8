"""What our pages may load and run: nothing that is not named, whatever a run file contains."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping

_NOTHING = {"default-src": "'none'", "base-uri": "'none'", "form-action": "'none'"}


def policy(allowed: Mapping[str, str]) -> str:
    """A Content-Security-Policy that allows only what `allowed` names, by directive."""
    return "; ".join(f"{directive} {sources}" for directive, sources in {**_NOTHING, **allowed}.items())


def of_scripts(page: str) -> str:
    """The sources of the `<script>` elements that a page has itself."""
    return " ".join(hashed(text) for text in re.findall(r"<script>(.*?)</script>", page, re.DOTALL))


def hashed(text: str) -> str:
    """The source that allows exactly `text`."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
