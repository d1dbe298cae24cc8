"""The one kind of error a user can cause."""

LONGEST = 1500


class UserError(Exception):
    """Wrong input, told in one line: what is wrong, where, and what to do.

    The command line prints the line and exits with code 2; the workbench shows it beside the field.
    """

    def __init__(self, message: str) -> None:
        super().__init__(shortened(printable(" ".join(message.split()))))


def shortened(text: str) -> str:
    """`text` with its middle left out where a name or a path in it is endless."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 300]} ... {text[-290:]}"


def printable(text: str) -> str:
    """`text` without what would steer a terminal or cannot be written: names and reasons may come from anyone's file."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)
