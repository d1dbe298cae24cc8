"""numpy, loaded on first use: the first paint of the workbench does not need it, and it is the slowest import."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

# What the maps use of numpy, for the type checker.
if TYPE_CHECKING:
    from numpy import abs as abs
    from numpy import add as add
    from numpy import append as append
    from numpy import arange as arange
    from numpy import argsort as argsort
    from numpy import array as array
    from numpy import bincount as bincount
    from numpy import bitwise_or as bitwise_or
    from numpy import ceil as ceil
    from numpy import clip as clip
    from numpy import column_stack as column_stack
    from numpy import concatenate as concatenate
    from numpy import cumsum as cumsum
    from numpy import diff as diff
    from numpy import empty as empty
    from numpy import errstate as errstate
    from numpy import flatnonzero as flatnonzero
    from numpy import floor as floor
    from numpy import fromiter as fromiter
    from numpy import full as full
    from numpy import hypot as hypot
    from numpy import inf as inf
    from numpy import int32 as int32
    from numpy import intp as intp
    from numpy import isfinite as isfinite
    from numpy import isin as isin
    from numpy import lexsort as lexsort
    from numpy import maximum as maximum
    from numpy import median as median
    from numpy import minimum as minimum
    from numpy import ndarray as ndarray
    from numpy import nonzero as nonzero
    from numpy import ones as ones
    from numpy import repeat as repeat
    from numpy import searchsorted as searchsorted
    from numpy import stack as stack
    from numpy import uint8 as uint8
    from numpy import uint32 as uint32
    from numpy import unique as unique
    from numpy import vstack as vstack
    from numpy import where as where
    from numpy import zeros as zeros
    from numpy import zeros_like as zeros_like

else:

    def __getattr__(name: str) -> Any:
        import numpy

        value = globals()[name] = getattr(numpy, name)
        return value
