"""What the shell completes after a tab: runs and bundled scenarios by their names, and files."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import click
from click.shell_completion import CompletionItem

# Files that a command can open.
KINDS = (".ddenv", ".yaml", ".yml", ".sdf", ".world", ".urdf")


def runs(context: click.Context, parameter: click.Parameter | None, begun: str) -> list[CompletionItem]:
    """The names of runs, and files."""
    return _offered(_runs(), begun)


def scenarios(context: click.Context, parameter: click.Parameter | None, begun: str) -> list[CompletionItem]:
    """The names of bundled scenarios, and files."""
    return _offered(_scenarios(), begun)


def runs_and_scenarios(context: click.Context, parameter: click.Parameter | None, begun: str) -> list[CompletionItem]:
    """The names of runs and of bundled scenarios, and files."""
    return _offered([*_scenarios(), *_runs()], begun)


def _offered(names: Iterable[str], begun: str) -> list[CompletionItem]:
    """Names beside files of this folder; if none of them fits, the shell looks for a path by itself."""
    known = {*names, *(_files() if begun else ())}
    found = sorted(name for name in known if name.startswith(begun))
    return [CompletionItem(name) for name in found] or [CompletionItem(begun, type="file")]


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
