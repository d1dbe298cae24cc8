"""The lines that are printed while a run is followed."""

from ddenv.runfile.fold import apply
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Recorded
from ddenv.words.baseline import baseline
from ddenv.words.news import headline, news
from tests.shorthand import typed


def states(*happened: tuple[str, dict], scenario: dict | None = None) -> list[RunState]:
    """The states of a run of four boxes after its round of two partitions started, and after each
    of these events.
    """
    elements = {"scenario": scenario or {}, "elements": ["a", "b", "c", "d"]}
    candidates = [[kind, part, None] for part in (0, 1) for kind in ("partition", "complement")]
    parts = {"environment": [0, 1, 2, 3], "partitions": [[0], [1, 2]], "candidates": candidates}
    found, state = [], RunState()
    before = (("created", elements), ("round_started", {"round": 1, "n_partitions": 2, **parts}))
    for kind, data in (*before, *happened):
        command = data.get("command")
        for event in typed(
            state, kind, {key: value for key, value in data.items() if key != "command"}
        ):
            state = apply(state, Recorded(state.revision + 1, 0.0, event, command))
        found.append(state)
    return found[1:]


def started(test: int) -> tuple[str, dict]:
    return "test_started", {
        "test": test,
        "phase": "round",
        "round": 1,
        "candidate": 1,
        "run": 0,
        "seed": 0,
    }


def test_of_many_candidates_the_judged_one_is_told():
    judged = ("candidate_judged", {"candidate": 1, "verdict": "similar", "tests": [1], "known": 0})
    _, before, after = states(started(1), judged)
    assert news("candidate_judged", before, after) == "  without A (3 models): similar after 1 test"


def ended(test: int, outcome: str, failure: str = "", **more) -> tuple[str, dict]:
    end = {"distance": None, "end_pose": None, "simulated_seconds": 1, "wall_seconds": 1}
    end |= {"first_sensed": [], "first_touched": [], "cut": False}
    return "test_finished", {"test": test, "outcome": outcome, "failure": failure, **end, **more}


def test_how_the_robot_failed_is_told_with_a_verdict():
    ways = [
        ("pass", ""),
        ("other", "tipped over"),
        ("other", "lost"),
        ("other", "tipped over"),
        ("error", "not-finite"),
    ]
    happened = [
        event for test, way in enumerate(ways, 1) for event in (started(test), ended(test, *way))
    ]
    judged = {"candidate": 1, "verdict": "dissimilar", "tests": [1, 2, 3, 4, 5], "known": 0}
    *_, before, after = states(*happened, ("candidate_judged", judged))
    words = (
        "  without A (3 models): dissimilar after 5 tests (1 pass, 2 tipped over, 1 lost, 1 error)"
    )
    assert news("candidate_judged", before, after) == words


def test_the_baseline_says_how_the_robot_failed_in_f():
    runs = {1: ("similar", "stuck"), 2: ("other", "fell"), 3: ("pass", "")}
    happened = [event for test, way in runs.items() for event in (base(test), ended(test, *way))]
    found = {
        "runs": 3,
        "failures": 1,
        "rate": 1 / 3,
        "low": 0.1,
        "high": 0.7,
        "failure_test": 1,
        "miss_chance": 0.2,
    }
    more = {
        "position": [1, 2, 0.5],
        "iterations_95": 7,
        "outcomes": {},
        "distances": {},
        "broken": 2,
    }
    f = {"test": 1, "runs": 1, "kinds": ["stuck"], "position": [1, 2, 0.5]}
    others = [{"test": 2, "runs": 1, "kinds": ["fell", "lost"], "position": [3, -0.001, 0]}]
    more["seen"] = [f, *others]
    state = states(
        *happened, ("baseline_finished", found | more), scenario={"reduction": {"iterations": 3}}
    )[-1]
    assert baseline(state) == (
        "Baseline: the robot got stuck in 1 of 3 runs (33 %, 95 % interval 10 % to 70 %); 2 more "
        "runs broke. "
        "Other failures: 2. fell or lost at (3.00, 0.00) in 1 run (--failure selects another one). "
        "The chance that 4 runs of a candidate miss f is 20 % (at most 66 %); for a 95 % chance "
        "of seeing f, use --iterations 7."
    )


def test_another_failure_of_the_same_kind_as_f_is_told_apart():
    found = {
        "runs": 1,
        "failures": 1,
        "rate": 1.0,
        "low": 0.2,
        "high": 1.0,
        "failure_test": 1,
        "miss_chance": 0.0,
    }
    more = {
        "position": [1, 2, 0.5],
        "iterations_95": 0,
        "outcomes": {},
        "distances": {},
        "broken": 0,
    }
    more["seen"] = [{"test": 1, "runs": 1, "kinds": ["stuck"], "position": [1, 2, 0.5]}]
    ways = {2: ("similar", "stuck"), 3: ("other", "stuck"), 4: ("other", "fell")}
    happened = [event for test, way in ways.items() for event in (started(test), ended(test, *way))]
    judged = (
        "candidate_judged",
        {"candidate": 1, "verdict": "dissimilar", "tests": [2, 3, 4], "known": 0},
    )
    first = (base(1), ended(1, "similar", "stuck"), ("baseline_finished", found | more))
    for similarity, other in (("end-pose", "elsewhere"), ("trajectory", "differently")):
        scenario = {"failure": {"similarity": similarity}}
        *_, before, after = states(*first, *happened, judged, scenario=scenario)
        words = (
            f"  without A (3 models): dissimilar after 3 tests (1 stuck, 1 stuck {other}, 1 fell)"
        )
        assert news("candidate_judged", before, after) == words


def base(test: int) -> tuple[str, dict]:
    return "test_started", {
        "test": test,
        "phase": "baseline",
        "round": None,
        "candidate": None,
        "run": 0,
        "seed": 0,
    }


STARTED = {
    "certificate": 1,
    "run": 10_000,
    "rate": 0.9,
    "keep_rate": 0.8,
    "error": 0.03,
    "at_least": 3,
}


def claim(without: int | None, verdict: str, shown: int, runs: int) -> dict:
    ends = {"similar": shown, "pass": runs - shown}
    return {
        "without": without,
        "verdict": verdict,
        "shown": shown,
        "runs": runs,
        "low": 0.1,
        "high": 0.9,
        "outcomes": ends,
    }


def test_a_certificate_is_told_with_what_follows_from_it():
    lost = {"claims": [claim(None, "lost", 3, 9)], "tests": []}
    _, before, after = states(started(1), ("certificate_started", STARTED))
    assert news("certificate_started", before, after).startswith(
        "certificate 1: fresh runs of what is left (4 models)"
    )
    assert "certificate: 0 of about 60 to 200 runs · 4 of 4 models" in headline(after)
    both = (("certificate_started", STARTED), ("certificate_finished", lost))
    _, before, after = states(*both)
    assert news("certificate_finished", before, after) == (
        "  certificate 1: what is left keeps less than 80 % of the whole world's rate: "
        "f in 3 of 9 fresh runs (10 % to 90 %)"
    )
    _, _, before, after = states(
        *both, ("rate_lost", {"node": 0, "lost": 0, "again": [], "tests": []})
    )
    assert (
        news("rate_lost", before, after)
        == "  back to 4 models, the last environment not shown to have lost the rate"
    )
    _, _, before, after = states(
        *both, ("left_out", {"without": 1, "environment": [0, 2, 3], "evidence_test": 1})
    )
    assert (
        news("left_out", before, after)
        == "  reduced to 3 models after 0 tests: without b f seems to show about as often"
    )


def test_the_headline_counts_tests_that_ended_and_that_run():
    state = states(*map(started, (1, 2, 3, 4)), ended(2, "pass"), ("test_lost", {"test": 3}))[-1]
    assert headline(state).endswith("4 of 4 models · 1 tests, 2 running")
    assert headline(state, 3.25).endswith("2 running, 3.2 s simulated")


def test_what_the_user_does_by_hand_is_told_in_its_own_words():
    tried = ("trial_started", {"trial": 1, "models": [0, 1]})
    judged = ("trial_judged", {"trial": 1, "verdict": "dissimilar", "tests": [], "known": 0})
    _, before, after, last = states(started(1), tried, judged)
    assert news("trial_started", before, after) == "tried 2 of 4 models (try 1): without c, d"
    assert news("trial_judged", after, last) == "  try 1 (2 models): dissimilar after 0 tests"
    before, after = states(
        ("paused", {}), ("command_refused", {"command": 1, "why": "not pinned"})
    )[-2:]
    assert news("paused", states(started(1))[-1], before).endswith("attach with 'ddenv open'")
    assert news("paused", states(started(1))[-1], before, attached=True) == "paused"
    assert news("command_refused", before, after) == "not done: not pinned"
