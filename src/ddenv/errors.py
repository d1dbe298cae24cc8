"""The one kind of error a user can cause."""

from ddenv.text import plain

LONGEST = 1500  # characters of a message


class UserError(Exception):
    """Wrong input, described in one line: what is wrong, where, and what to do.

    The command line prints the line and exits with code 2; the workbench shows it beside the field.
    """

    def __init__(self, message: str) -> None:
        line = plain(message)
        super().__init__(
            line if len(line) <= LONGEST else f"{line[: LONGEST - 300]} ... {line[-290:]}"
        )
