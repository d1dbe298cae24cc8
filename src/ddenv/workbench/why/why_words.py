"""The words of the why view: a row for each model that is left, what happens without it, and why there is nothing to show yet."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from ddenv.evidence.claims import current, in_the_making, made_of_usual, rate
from ddenv.map.names import padded, shortened
from ddenv.runfile.state import RunState
from ddenv.runs.reasons import no_reasons
from ddenv.words.news import isolating
from ddenv.workbench.why.entries import NEAREST, Entry
from ddenv.workbench.wording import CLAIM, percent, plain

# The width of a row without the model's name.
FIGURES = 23


def head(width: int) -> Text:
    """What the columns of `row` are."""
    return Text(f"   {padded('without', _name(width))}  {'f':>7} {'95 %':>10}", no_wrap=True)


def row(one: Entry, width: int) -> Text:
    """The letter of a model on the map, its name, how often f shows without it, and the interval of that in %."""
    if one.claim is None:
        return Text(f"{'○' if one.name == NEAREST else ' '}  {shortened(one.name, max(4, width - 3))}", no_wrap=True)
    name, claim = padded(shortened(one.name, _name(width)), _name(width)), one.claim
    interval = f"{percent(claim.low)[:-2]} to {percent(claim.high)[:-2]}" if claim.runs else ""
    figures = f" {CLAIM.get(claim.verdict, '?')}{f'{claim.shown}/{claim.runs}':>7} {interval:>10}"
    return Text(f"{one.letter:<3}", "bold", no_wrap=True).append(f"{name}{figures}", "not bold")


def _name(width: int) -> int:
    return max(4, width - FIGURES)


def said(one: Entry, lacks: Sequence[str]) -> Text:
    """What happens without the models, with the rates, where the ways part, and what the run file `lacks` of them."""
    text = Text(plain(one.sentence), "bold")
    for words in filter(None, one.more):
        text.append(f"\n\n{plain(words)}", "not bold")
    for words in lacks:
        text.append(f"\n\n▲ {plain(words)}", "bold")
    if one.rows:
        text.append(f"\n\n{'time':>8}   {'fails: x, y':>13}   {'passes: x, y':>13}   apart", "dim not bold")
        text.append("".join(f"\n{line}" for line in one.rows), "not bold")
    return text


def head_of(state: RunState, works: bool) -> str:
    """How far the search for the nearest world that passes is, if one has begun, and how often f shows in what is left.

    The first comes first: a narrow screen has no room for both.
    """
    certificate = current(state)
    title = "Why it fails" if state.isolating is None else isolating(state) + ("" if works else " (stopped)")
    return title if certificate is None else f"{title} · what is left: {rate(certificate.claims[0])}"


def nothing_yet(state: RunState, works: bool, run: str) -> str:
    """Why there is nothing to show, and what to do; `works`: an engine does. `run` is what a shell calls the run."""
    shows = "Full runs of what is left, and of that without each of its models, show why it fails: the certificate makes them."
    making, command = in_the_making(state), remedy(state, works, run)
    if (certificate := current(state)) is not None:
        return no_reasons(certificate)
    if command:
        return f"{shows}\n\nWhat is left has none. Make one, and come back: {command}   (c copies that)"
    if making is not None:
        return f"{shows}\n\nIt is being made: {made_of_usual(state, making)}. This page fills by itself."
    return f"{shows}\n\nIt is made once the search has ended, and this page fills by itself. The search still goes on."


def remedy(state: RunState, works: bool, run: str) -> str:
    """The command by which the run gets a certificate; "" if it needs none, or comes to one by itself."""
    if current(state) is not None or works:
        return ""
    return f"ddenv {'certify' if state.status == 'finished' else 'resume'} {run}"
