"""What to type to come back to a run."""

from __future__ import annotations

import shlex
from pathlib import Path

from ddenv.workbench.wording import plain


def attach_name(run: Path) -> str:
    """A run's name if it lies in the runs folder, else its path, quoted for a shell."""
    from ddenv.launch.folder import find_run

    name = run.stem if find_run(run.stem) == run else str(run)
    return shlex.quote(plain(name))
