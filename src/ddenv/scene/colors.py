"""Colours of models without their own, and of the marks that the scene adds: red, green, blue,
alpha in 0..1.
"""

from __future__ import annotations

Color = tuple[float, float, float, float]

STILL: Color = (0.62, 0.62, 0.64, 1.0)
MOVABLE: Color = (0.76, 0.56, 0.34, 1.0)

GROUND: Color = (0.80, 0.81, 0.80, 1.0)
GRID: Color = (0.66, 0.68, 0.69, 1.0)
START: Color = (0.16, 0.47, 0.85, 1.0)
GOAL: Color = (0.10, 0.62, 0.28, 1.0)
FAILURE: Color = (0.86, 0.12, 0.12, 1.0)
EVIDENCE: Color = (0.86, 0.22, 0.18, 1.0)
TRAIL: Color = (0.98, 0.70, 0.05, 1.0)
REMOVED: Color = (0.45, 0.50, 0.56, 1.0)
GHOST: Color = (0.06, 0.48, 0.46, 0.45)
GHOST_TRAIL: Color = (0.06, 0.48, 0.46, 1.0)
LEFT_OUT: Color = (0.55, 0.25, 0.75, 1.0)
SKY = ((0.66, 0.77, 0.88), (0.93, 0.95, 0.97))  # top, bottom


def of_bytes(color: tuple[int, int, int]) -> Color:
    """An opaque colour from red, green and blue in 0..255."""
    red, green, blue = (part / 255 for part in color)
    return red, green, blue, 1.0


def hexadecimal(color: Color) -> int:
    """0xRRGGBB."""
    red, green, blue = (round(255 * part) for part in color[:3])
    return red << 16 | green << 8 | blue
