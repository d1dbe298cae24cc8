"""The command line: all commands, and their exit codes.

Exit codes: 0 done (for a reduction: shown to be minimal), 1 stopped before that, 2 wrong input, 130
interrupted. Those of `ddenv reproduce` are for `git bisect run`, which takes 1 to 124 for "it
fails": it says 125 whenever it has no answer.
"""

from __future__ import annotations

import os
import sys
import traceback
from difflib import get_close_matches
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from ddenv import __version__
from ddenv.cli.options import fetch_option, given_reading, reading_options, runs_and_scenarios
from ddenv.cli.terminal import CANNOT_SAY, announce, show_progress
from ddenv.errors import UserError
from ddenv.runs.folder import named
from ddenv.schemas import nearest
from ddenv.world.files.watch import WATCH

# The commands, and the file of each. Only that of the command that is used is loaded: the workbench
# is on the screen sooner.
COMMANDS = {
    **dict.fromkeys(("run", "resume", "certify"), "run"),
    **dict.fromkeys(("open", "serve"), "workbench"),
    **dict.fromkeys(("runs", "diff", "schemas", "config", "doctor"), "lists"),
    **dict.fromkeys(("export", "reproduce", "report"), "share"),
    **dict.fromkeys(("why", "isolate", "margins"), "explain"),
    **{name: name for name in ("test", "learn", "study", "world")},
}


class Commands(click.Group):
    """The commands by name; any other first word is what `ddenv open` opens."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(
            import_module(f"ddenv.cli.{COMMANDS[cmd_name]}"), f"{cmd_name}_command"
        )
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        word = args[0]
        if word in COMMANDS or word.startswith("-"):
            return super().resolve_command(ctx, args)
        # While a line is typed, the shell only asks what can follow.
        path = Path(word)
        if not (
            ctx.resilient_parsing
            or path.suffix
            or len(path.parts) > 1
            or path.exists()
            or named(word)
        ):
            from ddenv.world.load import bundled_names

            known = [*self.list_commands(ctx), *bundled_names()]
            raise UserError(
                f"no command, run, scenario or world '{word}'{nearest(word, known)}; see 'ddenv "
                "--help'"
            )
        return "open", self.get_command(ctx, "open"), args

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands and options, and what can be opened."""
        commands = super().shell_complete(ctx, incomplete)
        others = [] if incomplete.startswith("-") else runs_and_scenarios(ctx, None, incomplete)
        # The shell lists files only where nothing else fits.
        return [*commands, *(each for each in others if each.type == "plain" or not commands)]


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__)
@reading_options
@fetch_option
@click.pass_context
def app(context: click.Context, /, **reading: Any) -> None:
    """Finds the few models of a world that make a robot fail. Without a command, or with a file or
    a run: the workbench.

    These options set how the workbench reads worlds; commands that read worlds have them, too.
    """
    if context.invoked_subcommand is None:
        from ddenv.workbench.launch import run_workbench

        if reading.pop("fetch"):
            raise UserError(
                "--fetch: name the world that lacks models; in the workbench, f beside them does "
                "the same"
            )
        context.exit(run_workbench(reading=given_reading(reading)))
    context.obj = reading
    if any(reading.values()) and context.invoked_subcommand != "open":
        raise UserError(
            "options for reading worlds go after the command: ddenv "
            f"{context.invoked_subcommand} ..."
        )


def main() -> None:
    # A terminal without a letter of a model's name shows its code instead.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    WATCH.set(show_progress)
    answers = sys.argv[1:2] == ["reproduce"]
    try:
        code = app(standalone_mode=False, prog_name="ddenv")
        sys.stdout.flush()
    except (KeyboardInterrupt, click.exceptions.Abort):
        code = 130
    except Exception as error:
        code = _told(error, answers)
        code = CANNOT_SAY if answers else code
    sys.exit(code)


def _told(error: Exception, all_of_it: bool) -> int:
    """Says what is wrong in one line; returns the exit code.

    What is no error of the user is raised again, or shown if `all_of_it`.
    """
    if isinstance(error, UserError):
        announce(f"ddenv: {error}")
    elif isinstance(error, click.exceptions.NoArgsIsHelpError):
        print(error.format_message(), file=sys.stderr)
    elif isinstance(error, click.ClickException):
        context = error.ctx if isinstance(error, click.UsageError) else None
        if isinstance(error, click.NoSuchOption) and error.possibilities:
            # Only those that are really like a mistyped one: their dashes alone make short ones
            # alike.
            word = error.option_name.lstrip("-")
            like = [
                each for each in error.possibilities if get_close_matches(word, [each.lstrip("-")])
            ]
            error = click.NoSuchOption(error.option_name, possibilities=like)
        command = "ddenv" if context is None else context.command_path
        announce(f"ddenv: {error.format_message().rstrip('.')}; see '{command} --help'")
    elif isinstance(error, OSError) and (
        isinstance(error, BrokenPipeError) or error.filename is None
    ):
        # Nobody reads the output any more (as with `| head`), or a disk is full. Else Python tries
        # to write the rest at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 1
        print(f"ddenv: cannot print: {error.strerror}", file=sys.stderr)
    elif isinstance(error, MemoryError) or (
        isinstance(error, ImportError) and "failed to map" in str(error)
    ):
        # A library that does not fit cannot be imported.
        announce("ddenv: out of memory; 'ulimit -v' says how much a process may use")
    elif all_of_it:
        traceback.print_exception(error)
    else:
        raise error
    return 2
