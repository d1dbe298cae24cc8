"""Starts the workbench: the user's config, whether there is a terminal that can show a screen, then the app."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.workbench.app import Workbench
from ddenv.workbench.help.config import read_config
from ddenv.workbench.terminal.themes import fitting

# One of each kind of sign that is drawn.
SIGNS = "╭▶●⠒█…"


def run_workbench(run: Path | None = None, reading: Mapping[str, Any] | None = None, *, watch: bool = False) -> int:
    """Runs the workbench until it is left; returns the exit code. Raises UserError without a run file or a terminal."""
    config = read_config()
    app = Workbench(run, reading, watch=watch, config=config)
    check_terminal()
    if not config.theme:
        app.theme = fitting(app.console.color_system)
    result = app.run()
    return result if isinstance(result, int) else app.return_code or 0


def check_terminal() -> None:
    """Raises UserError where no screen can be shown."""
    if os.environ.get("TEXTUAL_DRIVER"):
        # Something other than a terminal shows it, such as a browser.
        return
    output = sys.__stderr__
    if output is None or sys.__stdin__ is None or not (output.isatty() and sys.__stdin__.isatty()):
        raise UserError(
            "the workbench needs a terminal; 'ddenv run', 'ddenv resume' and 'ddenv report' work without one"
        )
    if os.environ.get("TERM") == "dumb":
        raise UserError("TERM=dumb: this terminal can show no screen; 'ddenv run' and 'ddenv resume' need none")
    try:
        SIGNS.encode(output.encoding)
    except (UnicodeEncodeError, LookupError):
        raise UserError(
            f"this terminal's text is {output.encoding}, which has no signs to draw with; type: export LANG=C.UTF-8"
        ) from None
