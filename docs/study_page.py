"""Writes the results of studies into the pages: tables between marks in docs/study.md and
README.md, and the first study's figures.

    python -m docs.study_page STUDY[,STUDY...] [AS_PRINTED]

These are folders of `ddenv study`: with today's defaults, several for several scenarios; and as
printed in the paper. The table of a folder that is not given stays as it is. A mark is <!-- NAME
--> ... <!-- end -->. `headline` and `printed` have a row for each scenario, with the ranges of its
methods.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
STUDY, README = DOCS / "study.md", DOCS.parent / "README.md"
FIGURES = DOCS / "study"
# The first table of a scenario: tests, reduction and time.
NUMBERS = 0
CERTIFIED = "certified"
NUMBER = re.compile(r"\d+(?:\.\d+)?")
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def main() -> None:
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    nine = [Path(name) for name in sys.argv[1].split(",")]
    others = [Path(name) for name in sys.argv[2:]]
    tables = {
        "nine": _scenarios(nine, NUMBERS),
        "made": _table(nine[-1], "How it was made", 1),
    }
    tables["headline"] = headline(tables["nine"])
    if others:
        tables["printed"] = headline(_scenarios(others, NUMBERS))
    for page in (STUDY, README):
        page.write_text(filled(page.read_text(), tables))
    FIGURES.mkdir(exist_ok=True)
    for picture in sorted(path for study in nine for path in study.glob("study.figure-*.svg")):
        (FIGURES / picture.name.removeprefix("study.")).write_text(picture.read_text())


def filled(page: str, tables: dict[str, str]) -> str:
    """The page with these tables between the marks of their names."""
    for name, table in tables.items():
        begin, end = f"<!-- {name} -->\n", "<!-- end -->"
        before, found, rest = page.partition(begin)
        if found:
            page = f"{before}{begin}\n{table}\n{end}{rest.partition(end)[2]}"
    return page


def marked(page: str, name: str) -> str:
    """The lines of the table between the marks of this name."""
    return _tables(page.partition(f"<!-- {name} -->")[2].partition("<!-- end -->")[0])[0]


def headline(nine: str) -> str:
    """One row for each scenario of the table `nine`: how many methods are certified, and each
    column's range over these.
    """
    head, sides, *rows = (
        [cell.strip() for cell in line.strip("| \n").split("|")] for line in nine.splitlines()
    )
    begin = 3 if CERTIFIED in head else 2
    lines = [[head[0], *head[2:]], [sides[0], *sides[2:]]]
    for scenario in dict.fromkeys(row[0] for row in rows):
        every = [row for row in rows if row[0] == scenario]
        certified = [row for row in every if begin == 2 or _is_certified(row[2])]
        ranges = [
            _range(column) for column in zip(*(row[begin:] for row in certified), strict=True)
        ]
        number = [f"{len(certified)} of {len(every)}"][: begin - 2]
        lines.append([scenario, *number, *(ranges or ["–"] * len(head[begin:]))])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _is_certified(cell: str) -> bool:
    """Whether all cells of a row are certified: "yes", or such as "3 of 3"."""
    certified, _, cells = cell.partition(" of ")
    return cell == "yes" or certified == cells


def _range(column: tuple[str, ...]) -> str:
    """Such as "40 to 78" of "45 (40 to 54)" and "64 (60 to 78)", or "95 %" where all are the
    same.
    """
    numbers = sorted((number for cell in column for number in NUMBER.findall(cell)), key=float)
    low, high = numbers[0], numbers[-1]
    return (low if low == high else f"{low} to {high}") + (" %" if "%" in column[0] else "")


def _tables(text: str) -> list[str]:
    return [found[0] for found in TABLE.finditer(text)]


def _sections(study: Path) -> dict[str, str]:
    """The parts of a study's Markdown by their titles; of a scenario's title only its name."""
    _, *parts = re.split(r"^## ", (study / "study.md").read_text(), flags=re.MULTILINE)
    return {re.split(r",|\n", part)[0]: part for part in parts}


def _table(study: Path, title: str, number: int) -> str:
    return _tables(_sections(study)[title])[number]


def _scenarios(studies: list[Path], number: int) -> str:
    """The tables of all scenarios as one, with a column that names them."""
    lines: list[str] = []
    for name, part in (section for study in studies for section in _sections(study).items()):
        if " models" not in part.partition("\n")[0]:
            continue
        head, sides, *rows = _tables(part)[number].splitlines()
        lines += [] if lines else [f"| scenario {head}", f"| --- {sides}"]
        lines += [f"| {name} {row}" for row in rows]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main()
