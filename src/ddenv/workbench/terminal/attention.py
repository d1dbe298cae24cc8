"""What a terminal is sent to get the user's attention: a bell, and a notification if the terminal shows them."""

from __future__ import annotations

from collections.abc import Mapping

from ddenv.text import plain

BELL = "\x07"


def attention(title: str, words: str, environment: Mapping[str, str]) -> str:
    """The characters to send. Terminals ignore what they do not know, and some know both kinds: only one is sent.

    OSC 777 is for VTE (GNOME Terminal and others) and rxvt, OSC 9 for the others: iTerm2, WezTerm, kitty, Ghostty, foot, Windows.
    """
    title, words = plain(title).replace(";", ","), plain(words).replace(";", ",")
    if "VTE_VERSION" in environment or environment.get("TERM", "").startswith("rxvt"):
        return f"{BELL}\x1b]777;notify;{title};{words}\x1b\\"
    return f"{BELL}\x1b]9;{title}: {words}\x1b\\"
