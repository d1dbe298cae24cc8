"""A bare Textual table: how long any such program takes from a key to its answer. `workbench.py` runs it beside ours."""

from textual.app import App, ComposeResult
from textual.widgets import DataTable


class Bare(App[None]):
    def compose(self) -> ComposeResult:
        yield DataTable(cursor_type="row")

    def on_mount(self) -> None:
        table = self.query_one(DataTable)
        table.add_columns("#", "candidate", "models", "distance", "tests", "verdict")
        for number in range(30):
            table.add_row(str(number), f"part {number}", "12", "3.4 m", "4/4", "dissimilar")


if __name__ == "__main__":
    Bare().run()
