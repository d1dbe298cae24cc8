"""Which panes of the setup screen are shown: all of them where there is room, otherwise one at a time."""

from __future__ import annotations

from textual.screen import Screen

from ddenv.workbench.setup.fields import OptionsForm
from ddenv.workbench.setup.preview import Preview
from ddenv.workbench.widgets.panes import Panes

SMALLEST = (64, 18)
# From this size on all panes are shown at once.
ROOMY = (110, 32)
# From this size on the rarely used settings are shown, too.
VAST = (160, 48)
PANES = {"choose": "f2 choose", "map": "f3 map", "settings": "f4 settings"}
# Where the focus goes in each pane.
HEADS = {"choose": "#scenario-list", "map": "#map", "settings": "#algorithm"}


def arrange(screen: Screen[None], pane: str) -> None:
    """Shows all panes of the setup screen, or only `pane`."""
    form, preview = screen.query_one(OptionsForm), screen.query_one(Preview)
    # Not by classes of the screen: these would compute all styles again.
    width, height = screen.size
    all = width >= ROOMY[0] and height >= ROOMY[1]
    fits = width >= SMALLEST[0] and height >= SMALLEST[1]
    form.display = fits
    screen.query_one("#body").display = fits and (all or pane != "settings")
    screen.query_one("#choice").display = all or pane == "choose"
    form.show_fields(all or pane == "settings")
    form.set_class(not all and pane == "settings", "-alone")
    preview.set_class(not all and pane == "map", "-alone")
    form.set_class(not all, "-frameless")
    panes = screen.query_one(Panes)
    panes.display = not all
    panes.mark(pane)
