"""Each stylesheet is parsed once, not again with every screen that brings one of its own."""

from __future__ import annotations

from textual.css.stylesheet import Stylesheet


class ParsedOnce(Stylesheet):
    """Textual's stylesheet, which forgets what it has parsed only when the theme's variables change."""

    def reparse(self) -> None:
        """Parses what is new. Raises what `Stylesheet.parse` raises."""
        self.parse()
