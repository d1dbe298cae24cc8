"""What the signs of a report's map mean."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

# Pixels: of a letter, between entries, and from line to line.
LETTER, GAP, LINE, LEFT = 6.9, 12.0, 24.0, 52.0


def _badge(name: str, letter: str) -> str:
    return f'<circle class="badge {name}" r="10"/><text class="sign" y="4.5">{letter}</text>'


# Around (0, 0): where the robot starts, where it should go, and where it ended in f.
MARKS = {
    "start": _badge("start", "S"),
    "goal": _badge("goal", "G"),
    "end": '<path class="ring" d="M-7 -7L7 7M-7 7L7 -7"/><path class="end" d="M-7 -7L7 7M-7 7L7 -7"/>',
}
WORDS = {
    "kept": "left",
    "gone": "removed",
    "still": "always there",
    "whole": "can be removed",
    "way": "way in f",
    "last": "way, last similar run",
    "start": "start",
    "goal": "goal",
    "end": "end of f",
}


def legend_height(shown: Sequence[str], width: float) -> float:
    """Of the legend of these signs below a map that is so wide, pixels."""
    return LINE * len(_lines(shown, width)) + 6


def legend(shown: Sequence[str], top: float, width: float) -> Iterator[str]:
    """The signs with their words, in lines from `top` on."""
    for number, line in enumerate(_lines(shown, width)):
        x, y = LEFT, top + LINE * number + 10
        for name in line:
            yield f'<g transform="translate({x:.1f} {y:.1f})">{_sign(name)}'
            yield f'<text class="tick" x="{_room(name):g}" y="4.5">{WORDS[name]}</text></g>'
            x += _wide(name)


def _lines(shown: Sequence[str], width: float) -> list[list[str]]:
    lines: list[list[str]] = [[]]
    x = LEFT
    for name in (name for name in WORDS if name in shown):
        if lines[-1] and x + _wide(name) > width:
            lines.append([])
            x = LEFT
        lines[-1].append(name)
        x += _wide(name)
    return lines


def _wide(name: str) -> float:
    return _room(name) + LETTER * len(WORDS[name]) + GAP


def _room(name: str) -> float:
    """For a sign, up to its word."""
    return 25.0 if name in MARKS else 33.0


def _sign(name: str) -> str:
    if name in MARKS:
        return f'<g transform="translate(10 0)">{MARKS[name]}</g>'
    if name in ("way", "last"):
        return f'<path class="{name}" d="M0 0H26"/>'
    return f'<rect class="{name}" x="1" y="-7" width="24" height="14"/>'
