"""How a run got there: the chart of its models, its rounds, and what the user decided."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from ddenv.page.blocks import Block, Cell, Picture, Section, Strong, Table, moment, say
from ddenv.page.step_chart import chart
from ddenv.report.run_data import Record
from ddenv.runfile.state import REFUSED, Round, RunState
from ddenv.text import count, plain

# Longer tables of rounds and of decisions show only the first and the last rows; of many rounds,
# only those that reduced.
MOST_ROUNDS = 60
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
    state = record.state
    rounds = record.rounds
    tests = Counter(
        test.round for test in state.tests if test.phase == "round" and test.is_finished
    )
    explained = (
        "A round tries one set of models after another; the first one that shows f becomes the "
        "environment."
    )
    if any(_tried(each) and not tests[each.number] for each in rounds):
        explained += " Sets judged before are not tested again."
    shown = rounds
    if len(rounds) > MOST_ROUNDS:
        shown = tuple(
            each for each in rounds if each.winner is not None or each in (rounds[0], rounds[-1])
        )
        explained += f" Not listed: {count(len(rounds) - len(shown), 'round')} without a reduction."
    undone = {node.round for node in state.nodes if node.rejected and node.how == "reduced"}
    rows = [_row(state, each, tests[each.number], each.number in undone) for each in shown]
    head = ("round", "parts n", "tried", "first similar", "models left", "tests")
    return [say(explained), Table(head, _cut(rows, MOST_ROUNDS, 3), {0, 1, 2, 4, 5})]


def _tried(round: Round) -> int:
    """The number of its candidates that were judged or have tests."""
    return sum(
        one.verdict in ("similar", "missed", "dissimilar") or bool(one.tests)
        for one in round.candidates
    )


def _row(state: RunState, round: Round, tests: int, undone: bool) -> tuple[Cell, ...]:
    won = None if round.winner is None else round.candidates[round.winner]
    verdicts = Counter(one.verdict for one in round.candidates)
    if won is not None:
        first = f"{won.label}{', taken back' if undone else ''}"
    elif (
        not state.ended
        and not round.done
        and state.round is not None
        and round.number == state.round.number
    ):
        first = "under way"
    else:
        first = "not finished" if verdicts[""] else "none"
    refused = [f"{verdicts[word]} {word}" for word in REFUSED if verdicts[word]]
    first += f" ({', '.join(refused)})" if refused else ""
    left: Cell = str(len(round.environment)) if won is None else Strong(str(won.size))
    tried = f"{_tried(round)} of {len(round.candidates)}"
    return str(round.number), str(round.n_partitions), tried, first, left, str(tests)


def guiding(record: Record) -> Section | None:
    """The section on decisions; None before the baseline is done."""
    state = record.state
    blocks: list[Block] = []
    if state.decisions:
        rows = [
            (moment(each.time), str(each.tests), str(each.node), plain(each.words))
            for each in state.decisions
        ]
        lead = "by hand, each with the number of tests and the environment at that time."
        done = Table(("time", "tests", "at", "what the user did"), _cut(rows, MOST, 3), {1, 2})
        blocks += [say(f"{count(len(rows), 'decision')} {lead}"), done]
    elif state.baseline is not None:
        blocks.append(say("The user changed nothing: every reduction is the algorithm's own."))
    if blocks:
        return Section("Decisions", tuple(blocks))
    return None


def _cut(rows: Sequence[tuple[Cell, ...]], most: int, words: int) -> tuple[tuple[Cell, ...], ...]:
    """The first and the last rows, with a count of those in between in the column `words`."""
    if len(rows) <= most:
        return tuple(rows)
    half = most // 2
    left_out = f"… {len(rows) - 2 * half} more …"
    between = tuple(left_out if column == words else "" for column in range(len(rows[0])))
    return (*rows[:half], between, *rows[-half:])
