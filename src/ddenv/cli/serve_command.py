"""`ddenv serve`: the workbench in a browser of this machine."""

from __future__ import annotations

from typing import Any

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import whole
from ddenv.errors import UserError

PORT = 8000


def _refuse_host(_: Any, __: Any, value: str | None) -> None:
    if value is not None:
        raise UserError(
            "--host: the workbench is only served on 127.0.0.1, since anybody who can open it acts as you; "
            "from another machine use ssh -L"
        )


@click.command("serve")
@click.argument("run", required=False, shell_complete=runs)
@click.option("--port", type=whole(1, 65535), default=PORT, show_default=True, help="Port on 127.0.0.1.")
@click.option(
    "--font-size",
    type=whole(6, 72),
    default=16,
    show_default=True,
    help="Of the text, in pixels; 28 for a projector.",
)
@click.option("--host", hidden=True, expose_value=False, callback=_refuse_host)
def serve_command(run: str | None, port: int, font_size: int) -> int:
    """Serves the workbench to browsers on this machine; with RUN (a name or a file) attached to it."""
    from ddenv.workbench.terminal.served import serve

    serve(port, run, font_size)
    return 0
