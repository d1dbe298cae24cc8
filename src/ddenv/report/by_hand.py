"""What the user did in a run: decisions, tries, and the tree of reductions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ddenv.evidence.claims import seen
from ddenv.page.blocks import Block, Cell, Section, Table, moment, say
from ddenv.report.run_data import Record
from ddenv.runfile.progress import Node
from ddenv.runfile.state import RunState, Trial
from ddenv.text import count, plain

# Longer tables of decisions, trials or nodes show only the first and the last rows.
MOST = 120
# The maximum number of steps in the line about a history without branches.
MOST_STEPS = 40
HOW = {
    "start": "",
    "reduced": "",
    "adopted": "adopted by hand",
    "accepted": "another failure, accepted by hand",
    "instead": "a branch to its failure",
    "certified": "by a certificate",
    "sliced": "without a test",
}


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
    order = list(_drawn(state))
    rows = [_node(state, nodes[number], indent) for number, indent in order]
    here = frozenset(index for index, (number, _) in enumerate(order) if number == state.node)
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


def _drawn(state: RunState) -> Iterator[tuple[int, str]]:
    """Each node's number with the lines before it. The branch where the run is now goes on without an indent."""
    children: dict[int, list[int]] = {}
    for node in state.nodes[1:]:
        if node.parent is not None:
            children.setdefault(node.parent, []).append(node.number)
    path = _path(state)
    waiting = [(0, "", "")]
    while waiting:
        number, line, below = waiting.pop()
        yield number, line
        mine = sorted(children.get(number, ()), key=lambda child: (child in path, child))
        *branches, last = mine or (None,)
        if last is not None:
            waiting.append((last, f"{below}", below))
        waiting += [(child, f"{below}├ ", f"{below}│ ") for child in reversed(branches)]


def _path(state: RunState) -> frozenset[int]:
    """The current node and all above it; a parent has a smaller number than its child."""
    found: set[int] = set()
    number: int | None = state.node
    while number is not None and number not in found:
        found.add(number)
        number = state.nodes[number].parent
    return frozenset(found)


def _node(state: RunState, node: Node, indent: str) -> tuple[Cell, ...]:
    marks = ["taken back"] if node.rejected else []
    marks += ["f too rare"] if node.lost_rate else []
    marks += ["minimal"] if node.minimal else []
    marks += ["here"] if node.number == state.node else []
    how = HOW.get(node.how, "")
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
