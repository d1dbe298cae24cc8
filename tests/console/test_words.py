"""The lines that are printed while a run is followed."""

from ddenv.console.words import headline, news
from ddenv.runfile.fold import apply
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Event


def states(*happened: tuple[str, dict]) -> list[RunState]:
    """The states of a run of four boxes after its round of two partitions started, and after each of these events."""
    elements = {"scenario": {}, "elements": ["a", "b", "c", "d"]}
    candidates = [[kind, part, None] for part in (0, 1) for kind in ("partition", "complement")]
    parts = {"environment": [0, 1, 2, 3], "partitions": [[0], [1, 2]], "candidates": candidates}
    found, state = [], RunState()
    before = (("created", elements), ("round_started", {"round": 1, "n_partitions": 2, **parts}))
    for number, (kind, data) in enumerate((*before, *happened)):
        state = apply(state, Event(number + 1, 0.0, kind, data))
        found.append(state)
    return found[1:]


def started(test: int) -> tuple[str, dict]:
    return "test_started", {"test": test, "phase": "round", "round": 1, "candidate": 1, "run": 0, "seed": 0}


def test_of_many_candidates_the_judged_one_is_told():
    judged = ("candidate_judged", {"candidate": 1, "verdict": "similar", "tests": [1], "known": 0})
    _, before, after = states(started(1), judged)
    assert news("candidate_judged", before, after) == "  without A (3 models): similar after 1 test"


def test_the_headline_counts_tests_that_ended_and_that_run():
    ended = {"outcome": "pass", "failure": "", "distance": None, "end_pose": None, "simulated_seconds": 1}
    finished = ("test_finished", {"test": 2, "wall_seconds": 1, **ended})
    state = states(*map(started, (1, 2, 3, 4)), finished, ("test_lost", {"test": 3}))[-1]
    assert headline(state).endswith("4 of 4 models · 1 tests, 2 running")
