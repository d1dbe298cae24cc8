"""The command line: parses, calls, prints."""

from ddenv.cli.command_line import main

__all__ = ["main"]
