"""Writes the tables of docs/keys.md from the actions of the screens.

python docs/workbench_keys.py
"""

from __future__ import annotations

import re
from pathlib import Path

from ddenv.workbench.config import Action, actions
from ddenv.workbench.help.key_names import shown_key

PAGE = Path(__file__).resolve().with_name("keys.md")
# A table is between these; the sections are the first parts of the actions' names.
TABLE = re.compile(r"(<!-- keys: ([\w ]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def filled(page: str) -> str:
    """The page with all tables up to date."""
    return TABLE.sub(lambda found: f"{found[1]}{table(found[2].split())}{found[3]}", page)


def sections(page: str) -> list[str]:
    """The sections that have tables in the page."""
    return [section for found in TABLE.finditer(page) for section in found[2].split()]


def table(sections: list[str]) -> str:
    """The lines of a table, each with its end."""
    rows = [row(action) for section in sections for action in actions().values() if _section(action.id) == section]
    return "\n".join(["| key | | name |", "|---|---|---|", *rows, ""])


def row(action: Action) -> str:
    keys = " ".join(f"`{_typed(key)}`" for key in action.keys)
    return f"| {keys} | {action.words} | `{action.id}` |"


def _typed(key: str) -> str:
    """As one types it: a capital letter stays one."""
    return key if len(key) == 1 else shown_key(key)


def _section(id: str) -> str:
    return id.partition(".")[0]


if __name__ == "__main__":
    main()
