"""The one kind of error a user can cause."""


class UserError(Exception):
    """Wrong input, told in one line: what is wrong, where, and what to do.

    The command line prints the line and exits with code 2; the workbench shows it beside the field.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(" ".join(message.split())))


def printable(text: str) -> str:
    """`text` without what would steer a terminal or cannot be written: names and reasons may come from anyone's file."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)
