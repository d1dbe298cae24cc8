"""Prints how dense the code of each folder of `src/ddenv` is, as a table in Markdown.

    python docs/house_numbers.py [FOLDER]

Columns: lines; nodes of the syntax tree, in all and for each line; the share of lines over 100
columns; and for each 1,000 lines the conditional expressions (`x if c else y`) and the assignments
of several values at once (`a, b = x, y`). The last column counts calls that give a dataclass more
than four values without their names.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).parent.parent / "src" / "ddenv"
WIDTH = 100
MOST_POSITIONAL = 4
HEAD = "| folder | lines | nodes | a line | over 100 | `if else` | `a, b =` | positional |"


@dataclass(kw_only=True)
class Density:
    """What is counted in some files."""

    lines: int = 0
    wide_lines: int = 0
    nodes: int = 0
    conditional_expressions: int = 0
    tuple_assignments: int = 0
    positional_calls: int = 0

    def add(self, source: str, dataclasses: frozenset[str]) -> None:
        """Counts one file; `dataclasses` has the names of all dataclasses."""
        lines = source.splitlines()
        self.lines += len(lines)
        self.wide_lines += sum(len(line) > WIDTH for line in lines)
        for node in ast.walk(ast.parse(source)):
            self.nodes += 1
            self.conditional_expressions += isinstance(node, ast.IfExp)
            self.tuple_assignments += _is_tuple_assignment(node)
            self.positional_calls += _is_positional_call(node, dataclasses)

    def row(self, name: str) -> str:
        """A line of the table."""
        thousands = self.lines / 1000
        cells = [
            name,
            f"{self.lines:,}",
            f"{self.nodes:,}",
            f"{self.nodes / self.lines:.1f}",
            f"{self.wide_lines / self.lines:.1%}",
            f"{self.conditional_expressions / thousands:.0f}",
            f"{self.tuple_assignments / thousands:.0f}",
            f"{self.positional_calls}",
        ]
        return f"| {' | '.join(cells)} |"


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else SOURCE
    sources = {path: path.read_text() for path in sorted(folder.rglob("*.py"))}
    dataclasses = frozenset(name for source in sources.values() for name in _dataclasses(source))
    rooms: dict[str, Density] = {}
    total = Density()
    for path, source in sources.items():
        inside = path.relative_to(folder).parts
        room = inside[0] if len(inside) > 1 else "files at the top"
        rooms.setdefault(room, Density()).add(source, dataclasses)
        total.add(source, dataclasses)
    print(HEAD)
    print("|---" + "|--:" * (HEAD.count("|") - 2) + "|")
    for room, density in sorted(rooms.items(), key=lambda entry: -entry[1].nodes):
        print(density.row(room))
    print(total.row("all"))


def _dataclasses(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ClassDef):
            decorators = " ".join(ast.unparse(decorator) for decorator in node.decorator_list)
            if "dataclass" in decorators:
                yield node.name


def _is_tuple_assignment(node: ast.AST) -> bool:
    """Whether this is `a, b = x, y`, but not a swap."""
    if not isinstance(node, ast.Assign) or not isinstance(node.value, ast.Tuple):
        return False
    targets = [target for target in node.targets if isinstance(target, ast.Tuple)]
    values = {ast.unparse(value) for value in node.value.elts}
    return any({ast.unparse(name) for name in target.elts} != values for target in targets)


def _is_positional_call(node: ast.AST, dataclasses: frozenset[str]) -> bool:
    if not isinstance(node, ast.Call):
        return False
    name = ast.unparse(node.func).split(".")[-1]
    return name in dataclasses and len(node.args) > MOST_POSITIONAL


if __name__ == "__main__":
    main()
