"""The colours of a map as numbers, how they mix, and how bright they are."""

from __future__ import annotations

from typing import Any

RGB = tuple[int, int, int]
# Eight hues, as distinct as possible for colour-blind readers; parts beyond H repeat the hues, but
# not the letters.
HUES: tuple[RGB, ...] = (
    (86, 180, 233),
    (240, 160, 40),
    (60, 190, 140),
    (222, 130, 190),
    (232, 220, 90),
    (235, 105, 65),
    (140, 140, 250),
    (150, 200, 90),
)
# The packed colour of the terminal's default.
PLAIN = -1
BLACK = 0x000000
WHITE = 0xFFFFFF


def blend(back: RGB, front: RGB, amount: float) -> RGB:
    """The colour between `back` (`amount` 0) and `front` (1)."""
    red, green, blue = (round(b + (f - b) * amount) for b, f in zip(back, front, strict=True))
    return red, green, blue


def packed(color: RGB) -> int:
    """The colour as one number, 0xRRGGBB."""
    return color[0] << 16 | color[1] << 8 | color[2]


def readable(back: int) -> int:
    """Black or white, whichever is more readable on a packed colour; the terminal's default on its
    own default.
    """
    if back < 0:
        return PLAIN
    if luminance(back) > 110:
        return BLACK
    return WHITE


def luminance(color: Any) -> Any:
    """The brightness of a packed colour, or of an array of them, 0..255."""
    return 0.3 * (color >> 16) + 0.59 * (color >> 8 & 255) + 0.11 * (color & 255)
