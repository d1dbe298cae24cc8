"""Downloads what a world lacks from Gazebo Fuel while the screen goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from ddenv.errors import UserError

if TYPE_CHECKING:
    from ddenv.world.files.fuel import FuelModel
    from ddenv.world.scenario import Reading


@dataclass
class Download:
    """How far a download is: `words` on the model that comes, what was `fetched`, and the `error` it ended with.

    It stops before its next bytes once it is `stopped`.
    """

    words: str = "asking Fuel"
    fetched: list[str] = field(default_factory=list)
    error: str = ""
    ended: bool = False
    stopped: bool = False


def start_download(world: Path, reading: Reading) -> Download:
    """Fetches the models that `world` lacks, in a thread that does not hold up the end of the workbench when a server hangs."""
    from ddenv.runs.fetching import fetch_missing

    download = Download()

    def show(model: FuelModel) -> Callable[[int, int | None], None]:
        def shown(received: int, total: int | None) -> None:
            if download.stopped:
                raise UserError("stopped")
            whole = "" if total is None else f" of {total / 1e6:.1f}"
            download.words = f"{model.name}: {received / 1e6:.1f}{whole} MB"

        return shown

    def run() -> None:
        try:
            fetch_missing(world, reading, show, download.fetched.append)
        except UserError as error:
            download.error = str(error)
        download.ended = True

    Thread(target=run, daemon=True).start()
    return download
