"""`ddenv config`: the file with a user's own keys and theme, and what can stand in it."""

from __future__ import annotations

import click


@click.command("config")
@click.option("--example", is_flag=True, help="Print a file with every action, to begin with.")
def config_command(example: bool) -> int:
    """Shows where the file with your keys and your theme is, and lists all actions with their keys."""
    from ddenv.workbench.help.config import example_lines, lines

    print("\n".join(example_lines() if example else lines()))
    return 0
