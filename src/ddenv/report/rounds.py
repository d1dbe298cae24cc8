"""The progress of a run: the chart of its models, and a table of its rounds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from ddenv.page.blocks import Block, Cell, Picture, Section, Strong, Table, say
from ddenv.page.step_chart import chart
from ddenv.report.run_data import Record
from ddenv.runfile.state import REFUSED, Candidate, Round, RunState
from ddenv.text import count

# The maximum number of rounds in the table, rounds that reduced come first; the others are summed up.
MOST_ROUNDS = 60


@dataclass(frozen=True, slots=True)
class _Row:
    """A round, its finished tests, whether it is still on, and whether its reduction was taken back."""

    round: Round
    tests: int
    on: bool
    undone: bool

    @property
    def tried(self) -> int:
        """The number of its candidates that were judged or have tests."""
        return sum(
            one.verdict in ("similar", "missed", "dissimilar") or bool(one.tests) for one in self.round.candidates
        )

    @property
    def won(self) -> Candidate | None:
        return None if self.round.winner is None else self.round.candidates[self.round.winner]


def way(record: Record) -> Section | None:
    """The section on the rounds; None before the baseline is done."""
    state = record.state
    if state.baseline is None:
        return None
    blocks: list[Block] = [Picture("chart", chart(state), _alternative(state))]
    if record.rounds:
        undone = frozenset(node.round for node in state.nodes if node.rejected and node.how == "reduced")
        tests = Counter(test.round for test in state.tests if test.phase == "round" and test.is_finished)
        judged = [_Row(each, tests[each.number], _is_on(state, each), each.number in undone) for each in record.rounds]
        blocks += _table(judged)
    else:
        blocks.append(say("No round has begun yet."))
    return Section("How it got there", tuple(blocks))


def _alternative(state: RunState) -> str:
    bound = f" At least {state.lower_bound} of them seem to be needed." if state.lower_bound else ""
    return (
        f"Models left after each test, down to {len(state.environment)} after {count(state.tests_done, 'test')}.{bound}"
    )


def _is_on(state: RunState, round: Round) -> bool:
    return not state.ended and not round.done and state.round is not None and round.number == state.round.number


def _table(judged: list[_Row]) -> list[Block]:
    shown = _shown(judged)
    rows: list[tuple[Cell, ...]] = []
    for first, last in _spans(len(judged), shown):
        if first in shown:
            rows.append(_row(judged[first]))
        else:
            rows.append(_summed(judged[first:last]))
    head = ("round", "parts n", "tried", "first similar", "models left", "tests")
    table = Table(head, tuple(rows), frozenset({0, 1, 2, 4, 5}))
    explained = "A round tries one set of models after the other; the first one that shows f becomes the environment."
    if any(each.tried and not each.tests for each in judged):
        explained += " Sets judged before are not tested again."
    return [say(explained), table]


def _shown(judged: list[_Row]) -> frozenset[int]:
    """Which rounds have a row of their own: if there are too many, those that reduced, the first and the last of these."""
    numbers = range(len(judged))
    if len(judged) <= MOST_ROUNDS:
        return frozenset(numbers)
    wins = [number for number in numbers if judged[number].won is not None]
    half = MOST_ROUNDS // 2
    kept = wins if len(wins) <= MOST_ROUNDS else wins[:half] + wins[-half:]
    return frozenset([*kept, 0, len(judged) - 1])


def _spans(length: int, shown: frozenset[int]) -> Iterator[tuple[int, int]]:
    """(first, behind the last) of each row: one round that is shown, or all between two of them."""
    first = 0
    while first < length:
        last = first + 1
        while first not in shown and last < length and last not in shown:
            last += 1
        yield first, last
        first = last


def _row(row: _Row) -> tuple[Cell, ...]:
    round, won = row.round, row.won
    left = len(round.environment) if won is None else won.size
    tried = f"{row.tried} of {len(round.candidates)}"
    size = str(left) if won is None else Strong(str(left))
    return str(round.number), str(round.n_partitions), tried, _first_similar(row), size, str(row.tests)


def _first_similar(row: _Row) -> str:
    verdicts = Counter(one.verdict for one in row.round.candidates)
    refused = [f"{verdicts[word]} {word}" for word in REFUSED if verdicts[word]]
    words = f" ({', '.join(refused)})" if refused else ""
    if row.won is not None:
        return f"{row.won.label}{', taken back' if row.undone else ''}{words}"
    if row.on:
        return f"under way{words}"
    return f"not finished{words}" if verdicts[""] else f"none{words}"


def _summed(judged: list[_Row]) -> tuple[Cell, ...]:
    """Several rounds in one row."""
    wins = sum(each.won is not None for each in judged)
    first, last = judged[0].round, judged[-1].round
    numbers = f"{first.number} to {last.number}" if len(judged) > 1 else str(first.number)
    tried = str(sum(each.tried for each in judged))
    words = f"{wins} of {len(judged)} reduced" if wins else "none"
    won = judged[-1].won
    left = len(last.environment) if won is None else won.size
    return numbers, "", tried, words, str(left), str(sum(each.tests for each in judged))
