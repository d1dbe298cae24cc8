"""What is happening, in words: the line and the sentences for each state of a run."""

from dataclasses import replace

import fake_moments
import fake_run
import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.snapshot import Snapshot
from ddenv.words.baseline import baseline
from ddenv.words.explain import explain
from ddenv.workbench.run.status import facts
from ddenv.workbench.shared.poll import Poll
from tests.shorthand import raw


def snapshot(run, engine="alive") -> Snapshot:
    return Snapshot(state=fold(run.file.events()), live=tuple(run.file.live()), engine=engine)


def told(run, engine="alive") -> tuple[int | None, str]:
    explanation = explain(snapshot(run, engine))
    return explanation.line, " ".join(explanation.sentences)


def searched(run, parts=2):
    """The first round has begun."""
    run.baseline()
    run.start_round(parts)


def counted(run):
    run.test(None, "failed")
    run.test(None, "pass", run=1)


def first_run(run):
    searched(run, 3)
    run.start(0)


def rerun(outcome, failure=""):
    def make(run):
        searched(run)
        run.test(0, outcome, 2.3, failure=failure)
        run.start(0, 1)

    return make


def reduced(run):
    searched(run)
    run.write("reduced", candidate=0, environment=[0, 1, 2, 3, 4, 5], evidence_test=run.similar(0))


def in_vain(run):
    searched(run)
    run.dissimilar(0)
    run.dissimilar(1)


def used_up(run):
    run.baseline().write("changed", settings={"budget": 4})
    run.write("engine_stopped", reason="the budget of 4 tests is used up")


def writes(kind, **data):
    return lambda run: run.write(kind, **data)


NEVER = writes("finished", minimal=False, reason="the robot never failed in 4 runs")
CUT = lambda run: run.baseline().write("finished", minimal=False, reason="stopped early")  # noqa: E731
# What happens after a run was created, the line of the algorithm, and words that are said; first
# while an engine works.
WORKING = (
    (counted, 0, "Of 2 runs so far 1 failed and 1 reached the goal"),
    (
        writes("noted", about="slow", words="this world is slow: 0.25 s"),
        0,
        "This world is slow: 0.25 s.",
    ),
    (
        lambda run: run.baseline(),
        2,
        "11 models",
        "split by model2model",
        "the robot got stuck in 3 of 4 runs (75 %",
    ),
    (first_run, 5, "First run of part A (4 models), candidate 1 of 6", "within 0.33 m"),
    (rerun("pass"), 7, "Re-run 1 of 3", "the goal was reached"),
    (rerun("other", "tipped over"), 7, "Re-run 1 of 3", "the robot tipped over 2.3 m from f's end"),
    (rerun("error"), 7, "Re-run 1 of 3", "broke"),
    (rerun("timeout"), 7, "Re-run 1 of 3", "too long"),
    (reduced, 11, "11 → 6 models"),
    (in_vain, 15),
)
ENDED = (
    (CUT, 21, "and 3 more"),
    (NEVER, None, "The robot never failed in 4 runs."),
    (writes("engine_stopped", reason=""), None, "r resumes"),
    (writes("engine_failed", reason="disk full"), None, "could not go on: disk full"),
    (
        used_up,
        None,
        "was stopped: the budget of 4 tests is used up.",
        "c raises it, and the run goes on",
    ),
)
BEGUN = (*((each, "alive") for each in WORKING), *((each, "absent") for each in ENDED))


@pytest.mark.parametrize(("case", "engine"), BEGUN)
def test_line_and_words_say_what_happens(run, case, engine):
    make, line, *words = case
    make(run.created())
    found = told(run, engine)
    assert found[0] == line and [each for each in words if each not in found[1]] == []
    assert make is not NEVER or found[1] == words[0]


MINIMAL = (
    "Minimal: 2 models left. No single model can be removed: f in 23 of 23 fresh runs (80 % to "
    "100 %), at least 81 %"
)
MEANS = "Minimal means: what is left keeps at least 81 % of the whole world's rate"
CERTIFIES = "they have to show that what is left keeps 66 % of the whole world's rate"
MOMENTS = (
    (fake_moments.mid_round, "alive", 7, "1 later candidate at the same time"),
    (fake_moments.mid_round, "absent", None, "not running", "r resumes", "2 unfinished tests"),
    (
        fake_moments.waiting,
        "alive",
        10,
        "0.12 m from f's end",
        "a accepts it (11 → 4 models), x rejects",
    ),
    (
        fake_moments.certifying,
        "alive",
        21,
        CERTIFIES,
        "So far f shows in 11 of 12 runs of what is left.",
    ),
    (
        fake_moments.certifying,
        "alive",
        21,
        "Now: run 5 of everything that is left except crate_00.",
    ),
    (
        fake_moments.finished,
        "absent",
        21,
        MINIMAL,
        MEANS,
        "crate_00, crate_01",
        "95 % interval 30 % to 95 %",
    ),
    (
        fake_moments.uncertified,
        "absent",
        21,
        "No single model can be removed; no fresh runs were made.",
    ),
    (
        fake_moments.not_shown,
        "absent",
        21,
        "Not shown that each model is needed: tests broke without crate_01",
    ),
)


@pytest.mark.parametrize("case", MOMENTS)
def test_at_each_moment_line_and_words_say_what_happens(run, case):
    make, engine, line, *words = case
    make(run)
    found = told(run, engine)
    assert found[0] == line and [each for each in words if each not in found[1]] == []
    # Only a certificate may call it so.
    assert ("Minimal" in found[1]) == (make is fake_moments.finished)


def test_before_an_engine_works_the_key_that_starts_one_is_named(run):
    run.write("created", scenario=run.data, elements=run.elements)
    assert told(run, "absent")[0] is None and "r starts" in told(run, "absent")[1]
    assert "starts" in told(run.created(), "starting")[1]
    fake_moments.mid_round(run).write("paused")
    line, words = told(run)
    assert line == 7 and words.startswith("Paused: no new test starts; running tests finish first.")


@pytest.mark.parametrize("scenario", [{}, {"reduction": 3, "failure": {"epsilon": "x"}}])
def test_settings_that_make_no_sense_do_no_harm(run, scenario):
    run.write("created", scenario=scenario, elements=run.elements)
    run.write("engine_started", pid=1, jobs=1, version="0", simulator="none")
    assert told(run)[0] == 0


def test_it_is_said_that_the_piles_settle(run):
    run.created().write("supports_started")
    assert told(run)[1].startswith("Finding models that support others")
    assert facts(snapshot(run))["state"][0] == "▶ finding models that support others"
    run.supports()
    assert "rests on" not in told(run)[1]


def test_a_full_disk_comes_first(run):
    fake_moments.mid_round(run).write("disk_space", enough=False, needed=32_000_000, free=1)
    assert told(run)[1].startswith("The disk is full: no new test starts until 32 MB are free.")
    assert facts(snapshot(run))["state"][0] == "! out of disk space"
    run.write("disk_space", enough=False, needed=2_000_000, free=1, in_file=True)
    assert told(run)[1].startswith("The run file is as large as a file may be (ulimit -f)")
    assert facts(snapshot(run))["state"][0] == "! file too large"
    run.write("disk_space", enough=True, needed=32_000_000, free=10**9)
    assert "disk" not in told(run)[1]


def test_after_a_step_its_result_is_shown(run):
    run.created().baseline()
    run.start_round(2)
    run.reduce(0, run.elements[:6], run.similar(0))
    run.start_round(3, run.elements[:6])
    run.write("paused")
    assert "part A showed f: 11 → 6 models. Next is part A (2 models)" in told(run)[1]
    run.test(0, "pass")
    assert told(run)[1].endswith(
        "Next is re-run 1 of 3 of part A (2 models), candidate 1 of 6: last time the goal was "
        "reached."
    )


def test_what_showed_f_is_run_again_until_it_is_clear_that_it_keeps_the_rate(run):
    run.created().baseline()
    run.start_round(2)
    run.test(0, "similar", 0.1, failure="stuck")
    run.test(0, "pass", run=1)
    assert (
        "Next is one more run of part A (6 models), candidate 1 of 2: f showed in 1 of 2 runs so "
        "far."
    ) in told(run)[1]
    run.live((run.start(0, 2), 0.4))
    words = told(run)[1]
    assert "Run 3 of part A (6 models), candidate 1 of 2: f showed in 1 of 2 runs so far." in words
    assert "It is accepted once its runs show that it keeps the rate of f" in words


def test_where_f_is_rarer_the_key_that_goes_back_is_named(run):
    words = told(fake_moments.rarer(run))[1]
    assert (
        "f is rarer than it was: f in 1 of 6 here, 3 of 4 in the whole world. u goes back to 11 "
        "models."
    ) in words
    assert (
        "rarer"
        not in told(fake_moments.mid_round(fake_run.FakeRun(run.path.with_name("b.ddenv"))))[1]
    )


def test_other_failures_in_the_baseline_are_named_and_counted(run):
    state = fold(run.created().baseline(others=2).file.events())
    assert (
        "95 %). Other failures: 2. fell at (3.00, 1.40) in 2 runs (--failure selects another one)."
        in baseline(state)
    )


def test_a_baseline_that_goes_on_says_why(run):
    run.created()
    for number in range(4):
        run.test(
            None,
            "failed" if number == 1 else "pass",
            run=number,
            failure="stuck" if number == 1 else "",
        )
    assert "The robot runs in the whole world 4 times" in told(run)[1]
    run.start(run=4)
    assert (
        "Few runs of the whole world show f, or they show several failures, so more runs are made."
        in told(run)[1]
    )
    assert "Of 4 runs so far 1 failed and 3 reached the goal." in told(run)[1]


def test_the_chance_to_miss_f_names_the_cure(run):
    state = fold(run.created().baseline(failures=1).file.events())
    words = "for a 95 % chance of seeing f, use --iterations 2"
    assert words not in baseline(state)
    state.scenario["reduction"] = {"iterations": 1}
    assert words in baseline(state)


def test_a_damaged_file_says_so(run):
    run.created().write("nonsense")
    poll = Poll(run.path)
    found = poll.look()
    assert poll.look() is None
    poll.close()
    assert "unknown kind 'nonsense'" in explain(found).sentences[0]
    assert found.state.status == "baseline"


def test_tries_and_pins_are_named_beside_the_round(run):
    fake_moments.guided(run)
    line, words = told(run)
    assert line == 5
    assert "First run of part B (3 models)" in words
    assert "try 3 (4 models) is being tested: first run." in words
    assert "Pinned, and so in every candidate: crate_00." in words
    run.judge_trial(3, "similar", [15])
    assert told(run)[1].startswith("try 3 shows f with 4 models: a adopts it.")


def test_how_the_user_came_to_this_environment_is_shown_until_a_test_is_made(run):
    fake_moments.guided(run).go_back(1)
    assert told(run)[1].startswith("Went to 6 models (#1, part A).")
    run.write("changed", settings={"iterations": 5})
    assert told(run)[1].startswith("Changed iterations from 3 to 5.")
    run.try_out(run.elements[:3])
    run.finish(run.start_hand(4), "similar", 0.1, failure="stuck")
    run.judge_trial(4, "similar", [run.tests])
    run.adopt(4, run.elements[:3], run.tests)
    words = told(run)[1]
    assert words.startswith("Adopted try 4: 3 models. Round 4")
    run.write(
        "accepted_other",
        test=8,
        what="try 2",
        trial=2,
        environment=[0, 1],
        outcomes={"8": "similar"},
        distances={},
    )
    assert told(run)[1].startswith("Accepted another failure as f: try 2")
    run.start_round(2, run.elements[:2])
    run.dissimilar(0)
    run.write("round_finished")
    assert "Accepted another" not in told(run)[1]


def test_what_was_pinned_is_not_called_needed(run):
    fake_moments.finished(run)
    run.pin("crate_00")
    run.start_certificate()
    run.finish_certificate((None, "kept", 23 * "s"), ("crate_01", "needed", 11 * "p"))
    run.write("finished", minimal=True, reason="no other single model can be removed")
    assert "any one model that is not pinned (" in told(run, "absent")[1]
    assert (
        "never left out) removed, f shows at most 55 % as often; the chance that this is wrong"
        in told(run, "absent")[1]
    )
    assert "p unpins." in told(run, "absent")[1]


def test_a_file_that_is_gone_and_another_engine_are_named(run):
    fake_moments.mid_round(run)
    found = snapshot(run)
    gone = replace(found, gone=True, error="x.ddenv: the run file was deleted", engine="absent")
    assert explain(gone).sentences[0] == "x.ddenv: the run file was deleted."
    other = replace(found, state=found.state.changed(engine_version="0.0.1"), version="0.1.0")
    assert (
        explain(other).sentences[0].startswith("Another version of ddenv works on this run (0.0.1)")
    )


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("waiting", {"round": 1, "candidate": 99}),
        ("waiting", {"round": 1, "candidate": -1}),
        ("reduced", {"round": 1, "candidate": 99, "environment": 0, "evidence_test": 1}),
        ("test_started", {"test": 1}),
        ("created", {"scenario": 3, "elements": 4}),
    ],
)
def test_invalid_events_are_named_and_the_rest_is_shown(run, kind, data):
    run.created().baseline()
    run.start_round(2)
    raw(run.file, kind, data)
    poll = Poll(run.path)
    found = poll.look()
    poll.close()
    assert f"({kind})" in found.error
    assert found.state.round.number == 1
    explain(found)


def test_where_f_is_rare_the_other_way_is_offered_until_something_is_left_out(run):
    run.created().baseline(failures=1)
    run.write("noted", about="rare", words="f shows in 1 of 4 runs: exactly takes less")
    run.start_round(2)
    assert "F shows in 1 of 4 runs: exactly takes less. Press c to change it." in told(run)[1]
    run.reduce(0, run.elements[:4], run.similar(0))
    assert "exactly takes less" not in told(run)[1]
