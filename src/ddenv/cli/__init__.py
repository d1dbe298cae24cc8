"""The command line: parses, calls, prints."""

from ddenv.cli.app import main

__all__ = ["main"]
