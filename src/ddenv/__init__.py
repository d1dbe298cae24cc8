"""ddenv: find the few models of a world that make a robot fail."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError

if TYPE_CHECKING:
    from ddenv.reduction.evidence import Traits
    from ddenv.reduction.reduce import Reduction, reduce
    from ddenv.robot.external.protocol import Ended, SimulatorSetup, SubWorld
    from ddenv.robot.protocol import Reading, Setup, Twist, WheelSpeeds

__version__ = "0.1.0"

__all__ = [
    "Ended",
    "Reading",
    "Reduction",
    "Setup",
    "SimulatorSetup",
    "SubWorld",
    "Traits",
    "Twist",
    "UserError",
    "WheelSpeeds",
    "__version__",
    "reduce",
]

_HOMES = {
    "ddenv.reduction.reduce": ("Reduction", "Traits", "reduce"),
    "ddenv.robot.external.protocol": ("Ended", "SimulatorSetup", "SubWorld"),
    "ddenv.robot.protocol": ("Reading", "Setup", "Twist", "WheelSpeeds"),
}


if not TYPE_CHECKING:
    # A type checker knows these names from above, and reports any other.
    def __getattr__(name: str) -> Any:
        # The command line and the screens begin fast because nothing numerical is imported for
        # them.
        for home, names in _HOMES.items():
            if name in names:
                return getattr(import_module(home), name)
        raise AttributeError(f"module 'ddenv' has no attribute '{name}'")
