"""Starts the workbench: reads the user's config, checks the terminal, runs the app."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError

if TYPE_CHECKING:
    from textual.screen import Screen

# One character of each kind that is drawn.
SIGNS = "╭▶●⠒█…"


def run_workbench(
    run: Path | None = None,
    reading: Mapping[str, Any] | None = None,
    *,
    watch: bool = False,
    file: Path | None = None,
    first: Callable[[], Screen[Any]] | None = None,
) -> int:
    """Runs the workbench until the user quits; returns the exit code. Raises UserError without a
    run file or a terminal.
    """
    # With the usual ones the slowest keys take twice as long. There is no garbage yet: the app
    # begins to look for it.
    gc.set_threshold(20_000, 20, 20)
    gc.disable()
    from ddenv.workbench.app import Workbench
    from ddenv.workbench.config import read_config
    from ddenv.workbench.terminal.themes import fitting

    config = read_config()
    app = Workbench(run, reading, watch=watch, config=config, file=file, first=first)
    check_terminal()
    if not config.theme:
        app.theme = fitting(app.console.color_system)
    result = app.run()
    if isinstance(result, int):
        return result
    return app.return_code or 0


def check_terminal() -> None:
    """Raises UserError if no screen can be shown."""
    if os.environ.get("TEXTUAL_DRIVER"):
        # Something else than a terminal shows it, such as a browser.
        return
    output = sys.__stderr__
    if (
        output is not None
        and sys.__stdout__ is not None
        and sys.__stdout__.isatty()
        and not output.isatty()
    ):
        # The screen is drawn on stderr, which may go to a file.
        os.dup2(sys.__stdout__.fileno(), output.fileno())
    if output is None or sys.__stdin__ is None or not (output.isatty() and sys.__stdin__.isatty()):
        raise UserError(
            "the workbench needs a terminal; 'ddenv run', 'ddenv resume' and 'ddenv report' work "
            "without one"
        )
    if os.environ.get("TERM") == "dumb":
        raise UserError(
            "TERM=dumb: this terminal cannot show a screen; 'ddenv run' and 'ddenv resume' need "
            "none"
        )
    try:
        SIGNS.encode(output.encoding)
    except (UnicodeEncodeError, LookupError):
        raise UserError(
            f"this terminal's encoding is {output.encoding}, which cannot draw the screen; type: "
            "export LANG=C.UTF-8"
        ) from None
