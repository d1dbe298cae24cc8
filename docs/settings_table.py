"""Writes the table of settings in docs/reference.md again, from `ddenv.settings`.

python docs/settings_table.py
"""

from __future__ import annotations

import re
from pathlib import Path

from ddenv.settings import SETTINGS, Setting

PAGE = Path(__file__).resolve().with_name("reference.md")
TABLE = re.compile(r"(<!-- settings -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def filled(page: str) -> str:
    """The page with the table as it has to be."""
    return TABLE.sub(lambda found: f"{found[1]}{table()}{found[2]}", page)


def table() -> str:
    """The lines of the table, each with its end."""
    head = ["| key | option | meaning | allowed | default |", "|---|---|---|---|---|"]
    return "\n".join([*head, *map(row, SETTINGS.values()), ""])


def row(one: Setting) -> str:
    option = f"`{one.option}`" if one.option else ""
    if option and one.kind is bool:
        option += f" `--no-{one.option[2:]}`"
    return f"| `{one.key}` | {option} | {one.summary} | {_allowed(one)} | {_default(one)} |"


def _allowed(one: Setting) -> str:
    if one.kind is bool:
        return "`true`, `false`"
    if one.kind is str:
        return ", ".join(f"`{choice}`" for choice in one.choices) or one.more.rstrip(".").replace(
            "'", "`"
        )
    return one.range


def _default(one: Setting) -> str:
    if one.default is None:
        return one.none
    return (
        f"`{str(one.default).lower()}`"
        if isinstance(one.default, str | bool)
        else f"{one.default:g}"
    )


if __name__ == "__main__":
    main()
