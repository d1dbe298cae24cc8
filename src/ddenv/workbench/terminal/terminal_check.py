"""Whether there is a terminal that can show a screen: told in a line, before anything is drawn."""

from __future__ import annotations

import os
import sys

from ddenv.errors import UserError

# Of each kind of sign that is drawn, one.
SIGNS = "╭▶●⠒█…"


def check_terminal() -> None:
    """Raises UserError where no screen can be shown."""
    if os.environ.get("TEXTUAL_DRIVER"):
        # Something else than a terminal shows it, such as a browser.
        return
    if not all(stream is not None and stream.isatty() for stream in (sys.__stdin__, sys.__stderr__)):
        raise UserError(
            "the workbench needs a terminal; 'ddenv run', 'ddenv resume' and 'ddenv report' work without one"
        )
    if os.environ.get("TERM") == "dumb":
        raise UserError("TERM=dumb: this terminal can show no screen; 'ddenv run' and 'ddenv resume' need none")
    encoding = sys.__stderr__.encoding
    try:
        SIGNS.encode(encoding)
    except (UnicodeEncodeError, LookupError):
        raise UserError(
            f"this terminal's text is {encoding}, which has no signs to draw with; type: export LANG=C.UTF-8"
        ) from None
