"""What the why view lists, and in which words: each model that is left, and at the end the nearest
world that passes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from shlex import quote

from rich.text import Text

from ddenv.evidence.claims import current, in_the_making
from ddenv.runfile.progress import Claim
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState, partition_letter
from ddenv.runfile.store import RunFile
from ddenv.runs.changes import changes
from ddenv.runs.experiment import read_parts
from ddenv.runs.folder import attach_name
from ddenv.runs.reasons import Divergence, nearest, no_reasons, parting_sentence, reasons, sentence
from ddenv.text import Names, Sentences, as_sentence, padded, percent, plain, shortened, told_apart
from ddenv.words.claims import made_of_usual, meaning, rate, shown
from ddenv.words.news import isolating
from ddenv.words.signs import CLAIM
from ddenv.workbench.map.place import Limits
from ddenv.workbench.playback.playback_screen import snapshot_with

# The maximum number of models in the list.
LISTED = 200
NEAREST = "nearest world that passes"
# The width of a row without the model's name.
FIGURES = 23


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Something that is left out of the environment of `snapshot`: the models `gone`, which have
    the sign `letter` on the map.

    `sentence` says what happens then, `more` the rates; `parting` compares two runs with one seed,
    whose ways are called `ways`; `claim` is that of a certificate. A number that is changed has
    `limits` to draw, and `figures` for its row.
    """

    name: str
    letter: str
    gone: Names
    sentence: str
    more: Sentences
    parting: Divergence | None
    ways: tuple[str, str]
    snapshot: Snapshot
    claim: Claim | None = None
    limits: Limits = ()
    figures: str = ""


def entries(file: RunFile, state: RunState) -> tuple[tuple[Entry, ...], int]:
    """The entries, and how many models there are beyond those that are listed. Raises UserError for
    a damaged file.
    """
    certificate = current(state)
    found = () if certificate is None else reasons(file, state)
    claims = {} if certificate is None else {each.without: each for each in certificate.claims}
    listed = found[:LISTED]
    snapshot = snapshot_with(state, state.environment, tuple(each.gone for each in listed))
    models = []
    last = []
    for number, each in enumerate(listed):
        claim = claims.get(each.without)
        sign = partition_letter(number)
        ways = ("with", "without")
        if claim is not None and certificate is not None:
            rates = f"{rate(claim)}; {meaning(claim, certificate)}."
        else:
            rates = ""
        more = rates, parting_sentence(each)
        models.append(
            Entry(
                name=each.without,
                letter=sign,
                gone=each.gone,
                sentence=sentence(each),
                more=more,
                parting=each.parting,
                ways=ways,
                snapshot=snapshot,
                claim=claim,
            )
        )
    if (one := nearest(file, state)) is not None:
        # The whole world fails, and without these it passes.
        whole = snapshot_with(state, state.elements, (one.gone,) if one.gone else ())
        ways = ("fails", "passes")
        last = [
            Entry(
                name=NEAREST,
                letter="A",
                gone=one.gone,
                sentence=one.sentences,
                more=(),
                parting=one.parting,
                ways=ways,
                snapshot=whole,
            )
        ]
    return (*models, *last, *_of_numbers(file, state)), len(found) - len(listed)


def _of_numbers(file: RunFile, state: RunState) -> Iterator[Entry]:
    """What happens where a number has another value."""
    if state.margins is None:
        return
    # What needs NumPy comes after the first paint.
    from ddenv.map.footprints import rings

    snapshot = snapshot_with(state, state.environment, ())
    run = attach_name(file.path)
    for one in changes(file, state, read_parts(file)[1]):
        value = f"{one.value:.4g}"
        given = "".join(f" --margin {quote(f'{name}={to:.9g}')}" for name, to in one.changes)
        more = (
            f"Again: ddenv test {run} --minimal{given} --repeat 10",
            f"As a world: ddenv export {run}{given} --output changed.sdf",
        )
        limits = tuple(
            (verdict, ring) for verdict, model, moved in one.limits for ring in rings(model, moved)
        )
        figures = f"{'goal' if one.verdict == 'goal' else 'no f'} at {value}"
        ways = ("now", f"at {value}")
        yield Entry(
            name=one.name,
            letter="",
            gone=(),
            sentence=one.sentence,
            more=more,
            parting=one.parting,
            ways=ways,
            snapshot=snapshot,
            claim=None,
            limits=limits,
            figures=figures,
        )


def head(width: int) -> Text:
    return Text(f"   {padded('without', _name(width))}  {'f':>7} {'95 %':>10}", no_wrap=True)


def listed(entries: Sequence[Entry], width: int) -> Iterator[Text]:
    """The letter of each model on the map, its name, how often f shows without it, and the interval
    of that in %.
    """
    names = told_apart(tuple(one.name for one in entries if one.claim is not None), _name(width))
    for one in entries:
        claim = one.claim
        if one.figures:
            room = max(4, width - len(one.figures) - 4)
            text = Text(f"   {padded(shortened(one.name, room), room)} {one.figures}", no_wrap=True)
        elif claim is None:
            sign = "○" if one.name == NEAREST else " "
            text = Text(f"{sign}  {shortened(one.name, max(4, width - 3))}", no_wrap=True)
        else:
            exact = claim.is_exact or not claim.runs
            interval = "" if exact else f"{percent(claim.low)[:-2]} to {percent(claim.high)[:-2]}"
            figures = (
                f" {CLAIM.get(claim.verdict, '?')}{f'{claim.shown}/{claim.runs}':>7} {interval:>10}"
            )
            text = Text(f"{one.letter:<3}", "bold", no_wrap=True)
            text.append(f"{padded(names[one.name], _name(width))}{figures}", "not bold")
        yield text


def _name(width: int) -> int:
    return max(4, width - FIGURES)


def said(one: Entry, lacks: Sequence[str]) -> Text:
    """What happens without the models, with the rates, where the ways part, and what the run file
    `lacks` of them.
    """
    text = Text(plain(one.sentence), "bold")
    for words in filter(None, one.more):
        text.append(f"\n\n{plain(words)}", "not bold")
    for words in lacks:
        text.append(f"\n\n▲ {plain(words)}", "bold")
    return text


def head_of(state: RunState, works: bool) -> str:
    """How far the search for the nearest world that passes is, if one has begun, and how often f
    shows in what is left.
    """
    certificate = current(state)
    if state.isolating is None:
        title = "Why it fails"
    else:
        title = isolating(state) + ("" if works else " (stopped)")
    if certificate is None:
        return title
    return f"{title} · what is left: {rate(certificate.claims[0])}"


def nothing_yet(state: RunState, works: bool, run: str) -> str:
    """Why there is nothing to show, and what to do; `works`: an engine does. `run` is what a shell
    calls the run.
    """
    shows = (
        "Full runs of what is left, with and without each of its models, show why: the "
        "certificate makes them."
    )
    making = in_the_making(state)
    command = remedy(state, works, run)
    if (certificate := current(state)) is not None:
        return no_reasons(certificate)
    if command:
        return (
            f"{shows}\n\n{as_sentence(shown(state))} Make one, and come back: {command}   (c "
            "copies that)"
        )
    if making is not None:
        made = made_of_usual(state, making)
        return (
            f"{shows}\n\nIt is being made: {made}. This page fills in by "
            f"itself.\n\n{as_sentence(shown(state))}"
        )
    return (
        f"{shows}\n\nIt is made once the search ends, and this page then fills in by itself. The "
        "search is still running."
    )


def remedy(state: RunState, works: bool, run: str) -> str:
    """The command by which the run gets a certificate; "" if it needs none, or comes to one by
    itself.
    """
    if current(state) is not None or works:
        return ""
    return f"ddenv {'certify' if state.status == 'finished' else 'resume'} {run}"
