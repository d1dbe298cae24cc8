"""The one kind of error a user can cause."""

LONGEST = 1500  # characters of a message


class UserError(Exception):
    """Wrong input, described in one line: what is wrong, where, and what to do.

    The command line prints the line and exits with code 2; the workbench shows it beside the field.
    """

    def __init__(self, message: str) -> None:
        super().__init__(shortened(printable(" ".join(message.split()))))


def shortened(text: str) -> str:
    """`text` without its middle if it is longer than `LONGEST`."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 300]} ... {text[-290:]}"


def printable(text: str) -> str:
    """`text` with control characters replaced, since parts of it may come from untrusted files."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)
