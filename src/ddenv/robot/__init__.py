"""One run of the robot in a sub-environment: simulated on Drake or by a command, and whether it
shows the failure.
"""

from __future__ import annotations

from importlib.util import find_spec

from ddenv.errors import UserError


def check_drake() -> None:
    """Raises UserError if Drake is not installed: there are systems without its wheels."""
    if find_spec("pydrake") is None:
        raise UserError(
            "the robot runs on Drake, which is not installed here: pip install drake (Linux and "
            "macOS); "
            "lessons, runs and their reports can be viewed without it"
        )
