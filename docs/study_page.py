"""Puts what studies came to into the pages: tables between marks in docs/study.md and README.md, and the figures of the first one.

    python -m docs.study_page STUDY AS_PRINTED ALL SEEDS

These are folders of `ddenv study`: of the nine cells; of the same with --growth paper --skip known; with --pairs all --algorithms
all; and with --seeds. A mark is <!-- NAME --> ... <!-- end -->.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PAGES = (DOCS / "study.md", DOCS.parent / "README.md")
FIGURES = DOCS / "study"
# The tables of a scenario: tests, reduction and time; what is behind them.
NUMBERS, BEHIND = 0, 1
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def main() -> None:
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    nine, printed, every, seeds = (Path(name) for name in sys.argv[1:])
    tables = {
        "nine": _scenarios(nine, NUMBERS),
        "behind": _scenarios(nine, BEHIND),
        "made": _table(nine, "How it was made", 1),
        "printed": _scenarios(printed, NUMBERS),
        "seeds": _scenarios(seeds, NUMBERS),
        "seeds behind": _scenarios(seeds, BEHIND),
        "best": _table(every, "Which is best where", 0),
    }
    for page in PAGES:
        text = page.read_text()
        for name, table in tables.items():
            text = re.sub(rf"(<!-- {name} -->\n).*?(<!-- end -->)", _between(table), text, flags=re.DOTALL)
        page.write_text(text)
    FIGURES.mkdir(exist_ok=True)
    for picture in sorted(nine.glob("study.figure-*.svg")):
        (FIGURES / picture.name.removeprefix("study.")).write_text(picture.read_text())


def _between(table: str):
    return lambda match: f"{match[1]}\n{table}\n{match[2]}"


def _sections(study: Path) -> dict[str, str]:
    """The parts of a study's Markdown by their titles; of a scenario's title its name alone."""
    _, *parts = re.split(r"^## ", (study / "study.md").read_text(), flags=re.MULTILINE)
    return {re.split(r",|\n", part)[0]: part for part in parts}


def _table(study: Path, title: str, number: int) -> str:
    return TABLE.findall(_sections(study)[title])[number]


def _scenarios(study: Path, number: int) -> str:
    """The tables of all scenarios as one, with a column that names them."""
    lines: list[str] = []
    for name, part in _sections(study).items():
        if " models" not in part.partition("\n")[0]:
            continue
        head, sides, *rows = TABLE.findall(part)[number].splitlines()
        lines += [] if lines else [f"| scenario {head}", f"| --- {sides}"]
        lines += [f"| {name} {row}" for row in rows]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main()
