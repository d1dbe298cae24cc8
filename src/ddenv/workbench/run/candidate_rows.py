"""The rows of the table beside the map, in words: tries and candidates, or the baseline's runs, or
those of a certificate.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

from rich.cells import cell_len

from ddenv.evidence.claims import FreshRuns, failing_instead, fresh_runs, in_the_making
from ddenv.runfile.run_settings import settings
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, RunState, Test, Trial
from ddenv.runfile.supports import drops
from ddenv.text import Names, count, percent, percent_at_least, plain, told_apart
from ddenv.words.claims import bound_sign, made_of_usual, short
from ddenv.words.early_stop import early_among
from ddenv.words.signs import (
    CLAIM,
    DROPS,
    VERDICT,
    brief,
    dropping,
    metres,
    outcome,
    signs,
    simulated,
)
from ddenv.words.slices import implied_words

# Maximum widths of a model's name as a verdict and as a row, in cells.
NAME = 8
MODEL_WIDTH = 18
# The latest judged tries that stay in the table.
TRIALS = 3

Item = Trial | Candidate | Test | FreshRuns
Words = Mapping[str, str]
# Columns that only candidates fill.
OF_CANDIDATES = ("distance", "evidence")


@dataclass(frozen=True, slots=True)
class Column:
    """`width` in cells, with the space before it. The greatest `spare` is left out first; 0 always
    stays.
    """

    name: str
    width: int
    right: bool = False
    spare: int = 0


# The verdict gets all the width that is left.
COLUMNS = (
    Column("#", 2),
    Column("candidate", 11),
    Column("models", 7, right=True),
    Column("distance", 9, right=True, spare=4),
    Column("tests", 6, right=True),
    Column("evidence", 10, spare=1),
    Column("to f", 7, right=True, spare=3),
    Column("real", 8, right=True, spare=2),
    Column("verdict", 14),
)
FRESH_COLUMNS = (
    Column("runs", 5, right=True),
    Column("ended", 10, right=True, spare=2),
    Column("f", 7, right=True, spare=1),
    Column("shown", 8, right=True),
    Column("verdict", 14),
)


@dataclass(frozen=True, slots=True)
class Listed:
    """What the table lists: `of` names it, `trials` stand above the `rest`."""

    of: tuple[object, ...] = ()
    trials: Sequence[Trial] = ()
    rest: Sequence[Candidate | Test | FreshRuns] = ()

    def __len__(self) -> int:
        return len(self.trials) + len(self.rest)

    def item(self, row: int) -> Item | None:
        if not 0 <= row < len(self):
            return None
        if row < len(self.trials):
            return self.trials[row]
        return self.rest[row - len(self.trials)]


def listed(snapshot: Snapshot) -> Listed:
    state = snapshot.state
    here = [trial for trial in state.trials if trial.node == state.node]
    judged = {trial.number for trial in [trial for trial in here if trial.verdict][-TRIALS:]}
    trials = tuple(trial for trial in here if not trial.verdict or trial.number in judged)
    if state.certificate is not None:
        return Listed(("certificate", state.certificate.number), trials, fresh_runs(state))
    if state.round is not None:
        return Listed(("round", state.node, state.round.number), trials, state.round.candidates)
    runs = tuple(takewhile(lambda test: test.phase == "baseline", state.tests))
    return Listed(("baseline",), trials, runs)


def round_title(state: RunState) -> tuple[str, str]:
    if (certificate := state.certificate) is not None:
        number = f" {certificate.number}" if certificate.number > 1 else ""
        rows = fresh_runs(state)
        aim = percent_at_least(certificate.certify_rate)
        if bound := bound_sign(rows[0].claim):
            keeps = f"keeps {bound}, aim {aim}"
        else:
            keeps = f"has to show {aim}"
        keeps = "chosen seeds" if certificate.seeds else keeps
        made = sum(one.claim.runs for one in rows)
        far = made_of_usual(state, certificate) if in_the_making(state) else count(made, "run")
        return f"Certificate{number}: {keeps}", far
    if state.round is None:
        return "Baseline: the whole world", ""
    candidates = state.round.candidates
    vetoed = sum(each.verdict == "vetoed" for each in candidates)
    judged = sum(bool(each.verdict) for each in candidates) - vetoed
    over = ", over" if state.round.done and not state.ended else ""
    return (
        f"Round {state.round.number}{over}",
        f"{judged} of {len(candidates)} judged{f', {vetoed} vetoed' if vetoed else ''}",
    )


def fitting(listing: Listed, width: int) -> tuple[Column, ...]:
    first = listing.rest[0] if listing.rest else None
    if isinstance(first, FreshRuns):
        rows = (_environment(each, listing) for each in listing.rest if isinstance(each, FreshRuns))
        longest = Column("environment", max(13, *(cell_len(text) + 1 for text in rows)))
        return _fitted((longest, *FRESH_COLUMNS), width)
    unused: tuple[str, ...] = () if isinstance(first, Candidate) else OF_CANDIDATES
    if isinstance(first, Candidate) and first.distance is None:
        unused = ("distance",)
    number = Column("#", max(2, len(str(len(listing.rest)))))
    return _fitted((number, *(each for each in COLUMNS[1:] if each.name not in unused)), width)


def _fitted(wanted: Sequence[Column], width: int) -> tuple[Column, ...]:
    columns = list(wanted)
    while (over := sum(each.width for each in columns) - width) > 0:
        most = max(columns, key=lambda each: each.spare)
        if not most.spare:
            break
        columns.remove(most)
    *others, last = columns
    return (*others, Column(last.name, last.width + max(0, -over)))


def words(snapshot: Snapshot, listing: Listed, row: int) -> Words:
    item = listing.item(row)
    if item is None:
        return {}
    if isinstance(item, Test):
        return {
            "#": str(row + 1 - len(listing.trials)),
            "candidate": f"run {item.run + 1}",
            "models": str(len(snapshot.state.environment)),
            "to f": metres(item.distance),
            "real": brief(item.wall_seconds) if item.is_finished else "",
            "verdict": _running(snapshot, [item]) or outcome(item),
        }
    if isinstance(item, FreshRuns):
        return _certificate_words(snapshot, item, listing)
    tests = snapshot.state.tests_of(item.tests)
    done = [test for test in tests if test.is_finished]
    running = len(done) < len(tests) and any(test.outcome == "running" for test in tests)
    distances = [test.distance for test in done if test.distance is not None]
    ended = signs(Counter(test.outcome for test in done))
    cells = {
        "environment": item.label,
        "candidate": item.label,
        "models": str(item.size),
        "ended": ended,
        "evidence": ended,
        "verdict": _verdict(snapshot, item, tests),
    }
    if isinstance(item, Candidate):
        cells["#"] = str(item.index + 1)
        cells["distance"] = metres(item.distance)
    if done or running:
        cells["tests"] = f"{len(done)}{_most_runs(snapshot, item, len(done))}"
    if done:
        cells["runs"] = str(len(done))
        cells["real"] = brief(sum(test.wall_seconds for test in done))
    if distances:
        cells["to f"] = metres(min(distances))
    fallen = drops(snapshot.state, item)
    if fallen:
        cells["candidate"] += DROPS
        cells["verdict"] = cells["verdict"] or _dropped(fallen)
    return cells


def _most_runs(snapshot: Snapshot, item: Trial | Candidate, done: int) -> str:
    """How many runs are made at most, where that is known: what shows f is run until it is clear
    that it keeps the rate, and what has a verdict is run no more.
    """
    options = settings(snapshot.state)
    is_decided = item.verdict and done < options.most_runs
    if options.accept_rate == "kept" or is_decided:
        return ""
    return f"/{options.most_runs}"


def _dropped(fallen: Names) -> str:
    if len(fallen) > 1:
        return f"drops {len(fallen)} models"
    return dropping(fallen, NAME)


def _verdict(snapshot: Snapshot, item: Trial | Candidate, tests: Sequence[Test]) -> str:
    state = snapshot.state
    if isinstance(item, Trial) and item.verdict == "similar" and not state.ended:
        if item.adopted:
            return "● adopted"
        return "● a adopts it"
    if isinstance(item, Candidate) and state.waiting_candidate == item.index:
        return "? a or x"
    if item.verdict:
        marks = (early_among(tests), implied_words(state, item.tests))
        return ", ".join([VERDICT.get(item.verdict, plain(item.verdict)), *filter(None, marks)])
    return _running(snapshot, tests)


def _running(snapshot: Snapshot, tests: Sequence[Test]) -> str:
    running = [test for test in tests if test.outcome == "running"]
    if not running or snapshot.engine != "alive":
        return ""
    seconds = snapshot.seconds(running[0].id)
    return "▶" * min(3, len(running)) + simulated(seconds, settings(snapshot.state).timeout)


def _environment(one: FreshRuns, listing: Listed) -> str:
    if one.without is not None:
        models = (each.without for each in listing.rest if isinstance(each, FreshRuns))
        return f"- {told_apart(tuple(filter(None, models)), MODEL_WIDTH)[one.without]}"
    if one.is_left:
        return "what is left"
    if one.is_chosen:
        return "whole, missed"
    if one.node == 0:
        return "whole world"
    return f"step {one.node}"


def _certificate_words(snapshot: Snapshot, one: FreshRuns, listing: Listed) -> Words:
    cells = {
        "environment": _environment(one, listing),
        "ended": signs(dict(one.claim.outcomes)),
        "shown": bound_sign(one.claim),
        "verdict": _claim(snapshot, one),
    }
    if one.claim.runs:
        cells["runs"] = str(one.claim.runs)
    if one.has_rate:
        cells["f"] = percent(one.claim.shown / one.claim.runs)
    return cells


def _claim(snapshot: Snapshot, one: FreshRuns) -> str:
    """The verdict of a claim, and how the robot fails without a needed model."""
    if not one.claim.verdict:
        return _running(snapshot, one.running)
    words = f"{CLAIM.get(one.claim.verdict, '?')} {short(one.claim)}"
    certificate = snapshot.state.certificate
    end = None if certificate is None else failing_instead(snapshot.state, certificate, one.claim)
    if end is None:
        return words
    away = f" {metres(end.away)} away" if metres(end.away) else ""
    return f"{words}; {end.failure}{away}"
