"""Writes the tables of docs/keys.md from the actions of the screens.

python docs/workbench_keys.py
"""

from __future__ import annotations

import re
from pathlib import Path

from ddenv.workbench.config import Action, actions
from ddenv.workbench.help.key_names import shown_key

PAGE = Path(__file__).resolve().with_name("keys.md")
# A table is between these: with a row for each key of the sections, or with a row for each section.
# Sections are the first parts of the actions' names.
TABLE = re.compile(r"(<!-- (keys|screens): ([\w ]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def filled(page: str) -> str:
    """The page with all tables up to date."""
    return TABLE.sub(
        lambda found: f"{found[1]}{_TABLES[found[2]](found[3].split())}{found[4]}", page
    )


def sections(page: str) -> list[str]:
    """The sections that have tables in the page."""
    return [section for found in TABLE.finditer(page) for section in found[3].split()]


def keys_table(sections: list[str]) -> str:
    """A row for each action, each line with its end."""
    rows = [
        f"| {keys(action)} | {action.words} | `{action.id}` |"
        for section in sections
        for action in actions().values()
        if _section(action) == section
    ]
    return "\n".join(["| key | | name |", "|---|---|---|", *rows, ""])


def screens_table(sections: list[str]) -> str:
    """A row for each section with all of its keys, each line with its end."""
    found = list(actions().values())
    rows = [
        (
            f"| `{section}` | "
            f"{' · '.join(_in_brief(action) for action in found if _section(action) == section)} |"
        )
        for section in sections
    ]
    return "\n".join(["| screen | keys |", "|---|---|", *rows, ""])


_TABLES = {"keys": keys_table, "screens": screens_table}


def keys(action: Action) -> str:
    return " ".join(f"`{_typed(key)}`" for key in action.keys)


def _in_brief(action: Action) -> str:
    return f"{keys(action)} {action.words} (`{action.id.partition('.')[2]}`)"


def _typed(key: str) -> str:
    """As one types it: a capital letter stays one."""
    return key if len(key) == 1 else shown_key(key)


def _section(action: Action) -> str:
    return action.id.partition(".")[0]


if __name__ == "__main__":
    main()
