"""How a run got there: the chart of its models, its rounds, and what the user did: decisions, tries, and the tree of reductions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from ddenv.page.blocks import Block, Cell, Picture, Section, Strong, Table, moment, say
from ddenv.page.step_chart import chart
from ddenv.report.run_data import Record
from ddenv.runfile import branches
from ddenv.runfile.progress import Node
from ddenv.runfile.state import REFUSED, Candidate, Round, RunState, Trial
from ddenv.text import count, plain
from ddenv.words.claims import seen
from ddenv.words.decisions import CAME_BY

# The maximum number of rounds in the table, rounds that reduced come first; the others are summed up.
MOST_ROUNDS = 60
# Longer tables of decisions, trials or nodes show only the first and the last rows.
MOST = 120
# The maximum number of steps in the line about a history without branches.
MOST_STEPS = 40


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
    rows = tuple(
        _summed([judged[each] for each in others]) if number is None else _row(judged[number])
        for number, others in groupby(range(len(judged)), lambda number: number if number in shown else None)
    )
    head = ("round", "parts n", "tried", "first similar", "models left", "tests")
    table = Table(head, rows, frozenset({0, 1, 2, 4, 5}))
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


def guiding(record: Record) -> Section | None:
    """The section on decisions and the tree; None without both."""
    state = record.state
    blocks: list[Block] = []
    if state.decisions:
        blocks += _decisions(state)
    elif state.baseline is not None:
        blocks.append(say("The user changed nothing: every reduction is the algorithm's own."))
    blocks += _trials(state)
    blocks += _tree(state)
    return Section("Decisions and branches", tuple(blocks)) if blocks else None


def _decisions(state: RunState) -> list[Block]:
    rows = [(moment(each.time), str(each.tests), str(each.node), plain(each.words)) for each in state.decisions]
    lead = say(
        f"{count(len(rows), 'decision')} by hand, each with the number of tests and the environment at that time."
    )
    head = ("time", "tests", "at", "what the user did")
    return [lead, Table(head, _cut(rows, 3), frozenset({1, 2}))]


def _trials(state: RunState) -> list[Block]:
    if not state.trials:
        return []
    rows = [_trial(state, each) for each in state.trials]
    head = ("tried by hand", "at", "models", "tests", "verdict")
    return [Table(head, _cut(rows, 4), frozenset({1, 2, 3}))]


def _trial(state: RunState, trial: Trial) -> tuple[Cell, ...]:
    verdict = trial.verdict or ("not ended" if state.ended else "under way")
    words = f"{verdict}, adopted" if trial.adopted else verdict
    return trial.label, str(trial.node), str(trial.size), str(len(trial.tests)), words


def _tree(state: RunState) -> list[Block]:
    nodes = state.nodes
    if len(nodes) < 2:
        return []
    straight = all(node.parent == node.number - 1 and node.how in ("reduced", "sliced") for node in nodes[1:])
    if straight and state.node == len(nodes) - 1 and not any(node.rejected or node.lost_rate for node in nodes):
        return [say(f"From environment to environment, without branches: {_steps(nodes)}.")]
    drawn = branches.rows(nodes, state.node)
    rows = [_node(state, each.node, each.lines.replace("─", " ")) for each in drawn]
    here = frozenset(place for place, each in enumerate(drawn) if each.node.number == state.node)
    head = ("environment", "models", "came by", "round", "tests", "f shown", "")
    if len(rows) > MOST:
        here = frozenset()
    return [
        say("The tree of reductions, each environment below the one it came from:"),
        Table(head, _cut(rows, 2), frozenset({1, 3, 4, 5}), here),
    ]


def _steps(nodes: Sequence[Node]) -> str:
    sizes = [str(len(node.environment)) for node in nodes]
    if len(sizes) > MOST_STEPS:
        sizes = [*sizes[: MOST_STEPS // 2], "…", *sizes[-MOST_STEPS // 2 :]]
    return f"{' → '.join(sizes)} models"


def _node(state: RunState, node: Node, indent: str) -> tuple[Cell, ...]:
    marks = ["taken back"] if node.rejected else []
    marks += ["f too rare"] if node.lost_rate else []
    marks += ["minimal"] if node.minimal else []
    marks += ["here"] if node.number == state.node else []
    how, _ = CAME_BY[node.how]
    came = f"{plain(node.what)}, {how}" if how else plain(node.what)
    round = "" if node.round is None else str(node.round)
    return (
        f"{indent}{node.number}",
        str(len(node.environment)),
        came,
        round,
        str(node.tests),
        seen(node),
        ", ".join(marks),
    )


def _cut(rows: Sequence[tuple[Cell, ...]], words: int) -> tuple[tuple[Cell, ...], ...]:
    """The first and the last rows, with a count of those in between in the column `words`."""
    if len(rows) <= MOST:
        return tuple(rows)
    half = MOST // 2
    left_out = f"… {len(rows) - 2 * half} more …"
    between = tuple(left_out if column == words else "" for column in range(len(rows[0])))
    return (*rows[:half], between, *rows[-half:])
