"""ddenv: find the few models of a world that make a robot fail."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError

if TYPE_CHECKING:
    from ddenv.reduction.evidence import Traits
    from ddenv.reduction.reduce import Reduction, reduce

__version__ = "0.1.0"
__all__ = ["Reduction", "Traits", "UserError", "reduce"]


def __getattr__(name: str) -> Any:
    # The command line and the screens begin fast because nothing numerical is imported for them.
    if name in ("Reduction", "Traits", "reduce"):
        from ddenv.reduction import reduce as module

        return getattr(module, name)
    raise AttributeError(f"module 'ddenv' has no attribute '{name}'")
