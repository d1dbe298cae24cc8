"""`ddenv config`: the file with a user's own keys and theme, and what it may contain."""

from __future__ import annotations

import click


@click.command("config")
@click.option("--example", is_flag=True, help="Print an example file with every action.")
def config_command(example: bool) -> int:
    """Shows the path of the file with your keys and theme, and lists all actions with their keys."""
    from ddenv.workbench.config import example_lines, lines

    print("\n".join(example_lines() if example else lines()))
    return 0
