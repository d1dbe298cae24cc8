"""Reads the image of a `<heightmap>`, and packs its heights into bytes for the run file.

As in Gazebo the brightest pixel is as high as the heightmap, black is 0, and the first row of the
image has the greatest y.
"""

from __future__ import annotations

import struct
import warnings
from io import BytesIO
from pathlib import Path

import numpy as np

from ddenv.arrays import Floats
from ddenv.world.access import Unusable, read

IMAGE_LIMIT = 200_000_000  # bytes of a file
MOST_PIXELS = 4097  # along each side


def read_heights(path: Path) -> bytes:
    """The heights in an image of 8 or 16 bits, packed. Raises Unusable."""
    from PIL import Image, UnidentifiedImageError

    data = read(path, IMAGE_LIMIT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # This reads no pixel yet.
            image = Image.open(BytesIO(data))
            _check_size(*image.size)
            if image.mode == "F":
                raise Unusable(
                    "holds elevations in m; write it as a PNG of 16 bits, with the difference of "
                    "heights as <size>"
                )
            wide = image.mode.startswith("I")
            samples = np.asarray(image) if wide else np.asarray(image.convert("RGB"))[:, :, 0]
    except Image.DecompressionBombError:
        raise Unusable(f"is wider or higher than {MOST_PIXELS} pixels") from None
    except UnidentifiedImageError:
        raise Unusable("is no image that can be read; use a PNG of 8 or 16 bits") from None
    except (OSError, SyntaxError, ValueError, EOFError, struct.error) as error:
        raise Unusable(f"is no valid image: {' '.join(str(error).split())[:200]}") from None
    return pack_heights(samples[::-1] / max(1, int(samples.max())))


def pack_heights(shares: Floats) -> bytes:
    """Heights (R, C), as a share of the greatest."""
    file = BytesIO()
    np.save(file, shares.astype("<f4"))
    return file.getvalue()


def _check_size(columns: int, rows: int) -> None:
    """Raises Unusable."""
    if not 2 <= min(rows, columns) <= max(rows, columns) <= MOST_PIXELS:
        raise Unusable(
            f"has {columns} x {rows} pixels; a heightmap has 2 to {MOST_PIXELS} along each side"
        )


def unpack_heights(packed: bytes) -> Floats:
    """The packed heights (R, C), as a share of the greatest. Raises Unusable for damaged bytes."""
    try:
        shares: Floats = np.load(BytesIO(packed), allow_pickle=False).astype(np.float64)
        # A share that is not a number is not in this range either.
        valid = shares.ndim == 2 and min(shares.shape) > 1 and np.abs(shares - 0.5).max() <= 0.5
    except (ValueError, TypeError, EOFError, OSError, MemoryError):
        valid = False
    if not valid:
        raise Unusable("its stored heights are damaged")
    shares.flags.writeable = False
    return shares
