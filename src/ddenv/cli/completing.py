"""What the shell completes after a tab: runs and bundled scenarios by their names, and files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import click
from click.shell_completion import CompletionItem

# Files that a command can open.
KINDS = (".ddenv", ".yaml", ".yml", ".sdf", ".world", ".urdf")
Complete = Callable[[click.Context, click.Parameter | None, str], list[CompletionItem]]


def _files() -> list[str]:
    with suppress(OSError):
        return [path.name for path in Path().iterdir() if path.suffix.lower() in KINDS]
    return []


def _runs() -> list[str]:
    from ddenv.runs.folder import SUFFIX, runs_folder

    return [path.stem for path in runs_folder().glob(f"*{SUFFIX}")]


def _scenarios() -> list[str]:
    from ddenv.world.load import bundled_names

    return bundled_names()


def _offering(*sources: Callable[[], list[str]]) -> Complete:
    """Offers names beside files of this folder; if none of them fits, the shell looks for a path by itself."""

    def complete(context: click.Context, parameter: click.Parameter | None, begun: str) -> list[CompletionItem]:
        known = {name for source in sources for name in source()}.union(_files() if begun else ())
        found = sorted(name for name in known if name.startswith(begun))
        return [CompletionItem(name) for name in found] or [CompletionItem(begun, type="file")]

    return complete


runs, scenarios, runs_and_scenarios = _offering(_runs), _offering(_scenarios), _offering(_scenarios, _runs)
