"""The tree of a run's reductions as lines: the path to the current node goes straight down, other branches go to the right."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.runfile.progress import Node, path

HERE, MINIMAL, REJECTED, OTHER = "●", "◆", "✗", "○"


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
        straight = _straight(children[number], straight_path)
        if straight is not None:
            todo.append((straight, after, ""))
        sides = [child for child in children[number] if child != straight]
        # The first one goes on top of the stack: it is drawn above those made later.
        todo += [(child, after, "├─") for child in reversed(sides)]
    return found


def sign(node: Node, here: int) -> str:
    """The sign of a node: current, taken back (or too rare in f), minimal or none of these."""
    if node.number == here:
        return HERE
    if node.rejected or node.lost_rate:
        return REJECTED
    return MINIMAL if node.minimal else OTHER


def words(node: Node, here: int) -> str:
    """What a node is, in words."""
    found = ["here"] if node.number == here else []
    if node.rejected:
        # The column has no room for both, and "minimal" alone would hide that it is refused.
        found.append("was minimal" if node.minimal else "taken back")
    elif node.minimal:
        found.append("minimal")
    if node.lost_rate:
        found.append("f too rare")
    return ", ".join(found)


def _straight(children: Sequence[int], straight_path: set[int]) -> int | None:
    """The child that goes straight down: the one on the path to the current node, or else the latest."""
    return next((child for child in children if child in straight_path), children[-1] if children else None)
