"""numpy, loaded on first use: the first paint of the workbench does not need it, and it is the slowest import."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy import *  # noqa: F403

else:

    def __getattr__(name: str) -> Any:
        import numpy

        value = globals()[name] = getattr(numpy, name)
        return value
