"""The one kind of error a user can cause."""


class UserError(Exception):
    """Wrong input, told in one line: what is wrong, where, and what to do.

    The command line prints the line and exits with code 2; the workbench shows it beside the field.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))
