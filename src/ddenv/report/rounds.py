"""How a run got there: the chart of its models, its rounds, and what the user decided."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby

from ddenv.page.blocks import Block, Cell, Picture, Section, Strong, Table, moment, say
from ddenv.page.step_chart import chart
from ddenv.report.run_data import Record
from ddenv.runfile.state import REFUSED, Candidate, Round, RunState
from ddenv.text import count, plain

# The maximum number of rounds in the table, rounds that reduced come first; the others are summed up.
MOST_ROUNDS = 60
# Longer tables of decisions show only the first and the last rows.
MOST = 120


def way(record: Record) -> Section | None:
    """The section on the rounds; None before the baseline is done."""
    state = record.state
    if state.baseline is None:
        return None
    bound = f" At least {state.lower_bound} of them seem to be needed." if state.lower_bound else ""
    down = f"down to {len(state.environment)} after {count(state.tests_done, 'test')}"
    drawn = Picture("chart", chart(state), f"Models left after each test, {down}.{bound}")
    rounds = _rounds(record) if record.rounds else [say("No round has begun yet.")]
    return Section("How it got there", (drawn, *rounds))


def _rounds(record: Record) -> list[Block]:
    state, rounds = record.state, record.rounds
    tests = Counter(test.round for test in state.tests if test.phase == "round" and test.is_finished)
    undone = {node.round for node in state.nodes if node.rejected and node.how == "reduced"}
    # If there are too many, those that reduced have a row of their own, the first and the last of these.
    shown: set[int] = {each.number for each in rounds}
    if len(rounds) > MOST_ROUNDS:
        wins = [each.number for each in rounds if each.winner is not None]
        half = MOST_ROUNDS // 2
        shown = {rounds[0].number, rounds[-1].number}
        shown |= set(wins if len(wins) <= MOST_ROUNDS else wins[:half] + wins[-half:])
    rows: list[tuple[Cell, ...]] = []
    for number, group in groupby(rounds, lambda each: each.number if each.number in shown else None):
        some = list(group)
        own = sum(tests[each.number] for each in some)
        rows.append(_summed(some, own) if number is None else _row(state, some[0], own, number in undone))
    head = ("round", "parts n", "tried", "first similar", "models left", "tests")
    explained = "A round tries one set of models after the other; the first one that shows f becomes the environment."
    if any(_tried(each) and not tests[each.number] for each in rounds):
        explained += " Sets judged before are not tested again."
    return [say(explained), Table(head, tuple(rows), {0, 1, 2, 4, 5})]


def _tried(round: Round) -> int:
    """The number of its candidates that were judged or have tests."""
    return sum(one.verdict in ("similar", "missed", "dissimilar") or bool(one.tests) for one in round.candidates)


def _won(round: Round) -> Candidate | None:
    return None if round.winner is None else round.candidates[round.winner]


def _left(round: Round) -> int:
    won = _won(round)
    return len(round.environment) if won is None else won.size


def _row(state: RunState, round: Round, tests: int, undone: bool) -> tuple[Cell, ...]:
    won, verdicts = _won(round), Counter(one.verdict for one in round.candidates)
    if won is not None:
        first = f"{won.label}{', taken back' if undone else ''}"
    elif not state.ended and not round.done and state.round is not None and round.number == state.round.number:
        first = "under way"
    else:
        first = "not finished" if verdicts[""] else "none"
    refused = [f"{verdicts[word]} {word}" for word in REFUSED if verdicts[word]]
    first += f" ({', '.join(refused)})" if refused else ""
    left = str(_left(round))
    tried = f"{_tried(round)} of {len(round.candidates)}"
    return str(round.number), str(round.n_partitions), tried, first, left if won is None else Strong(left), str(tests)


def _summed(rounds: Sequence[Round], tests: int) -> tuple[Cell, ...]:
    wins = sum(each.winner is not None for each in rounds)
    numbers = " to ".join(str(number) for number in dict.fromkeys((rounds[0].number, rounds[-1].number)))
    words = f"{wins} of {len(rounds)} reduced" if wins else "none"
    return numbers, "", str(sum(map(_tried, rounds))), words, str(_left(rounds[-1])), str(tests)


def guiding(record: Record) -> Section | None:
    """The section on decisions; None before the baseline is done."""
    state = record.state
    blocks: list[Block] = []
    if state.decisions:
        rows = [(moment(each.time), str(each.tests), str(each.node), plain(each.words)) for each in state.decisions]
        lead = "by hand, each with the number of tests and the environment at that time."
        done = Table(("time", "tests", "at", "what the user did"), _cut(rows, 3), {1, 2})
        blocks += [say(f"{count(len(rows), 'decision')} {lead}"), done]
    elif state.baseline is not None:
        blocks.append(say("The user changed nothing: every reduction is the algorithm's own."))
    return Section("Decisions", tuple(blocks)) if blocks else None


def _cut(rows: Sequence[tuple[Cell, ...]], words: int) -> tuple[tuple[Cell, ...], ...]:
    """The first and the last rows, with a count of those in between in the column `words`."""
    if len(rows) <= MOST:
        return tuple(rows)
    half = MOST // 2
    left_out = f"… {len(rows) - 2 * half} more …"
    between = tuple(left_out if column == words else "" for column in range(len(rows[0])))
    return (*rows[:half], between, *rows[-half:])
