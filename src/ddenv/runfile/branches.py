"""The tree of a run's reductions as lines: the path to the current node goes straight down, other
branches go to the right.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.runfile.progress import Node, path

HERE = "●"
MINIMAL = "◆"
REJECTED = "✗"
OTHER = "○"


@dataclass(frozen=True, slots=True)
class Row:
    """A node with the lines before it."""

    lines: str
    node: Node


def rows(nodes: Sequence[Node], here: int) -> list[Row]:
    """All nodes, parents before children."""
    children: dict[int, list[int]] = defaultdict(list)
    for node in nodes:
        if node.parent is not None:
            children[node.parent].append(node.number)
    straight_path = {node.number for node in path(nodes, here)}
    found: list[Row] = []
    # What is still to be drawn: a branch's first node, what comes before its lines, and its fork.
    todo = [(0, "", "")] if nodes else []
    while todo:
        number, before, fork = todo.pop()
        found.append(Row(f"{before}{fork}", nodes[number]))
        after = before + ("│ " if fork else "")
        # What goes straight down: the child on the path to the current node, or else the latest.
        straight = next(
            (child for child in children[number] if child in straight_path),
            (children[number] or [0])[-1],
        )
        # The first side branch goes on top of the stack: it is drawn above those made later.
        ordered = [straight, *(child for child in reversed(children[number]) if child != straight)]
        todo += [(child, after, "├─" if child != straight else "") for child in ordered if child]
    return found


def sign(node: Node, here: int) -> str:
    """The sign of a node: current, taken back (or too rare in f), minimal or none of these."""
    if node.number == here:
        return HERE
    if node.rejected or node.lost_rate:
        return REJECTED
    if node.minimal:
        return MINIMAL
    return OTHER


def words(node: Node, here: int) -> str:
    """What a node is, in words."""
    said = {
        "here": node.number == here,
        # The column has no room for both, and "minimal" alone would hide that it is refused.
        "was minimal": node.rejected and node.minimal,
        "taken back": node.rejected and not node.minimal,
        "minimal": node.minimal and not node.rejected,
        "f too rare": node.lost_rate,
    }
    return ", ".join(words for words, holds in said.items() if holds)
