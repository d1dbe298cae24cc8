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
    return Snapshot(fold(run.file.events()), tuple(run.file.live()), engine)


def told(run, engine="alive") -> tuple[int | None, str]:
    explanation = explain(snapshot(run, engine))
    return explanation.line, " ".join(explanation.sentences)


def test_before_anything_the_key_that_starts_is_named(run):
    run.write("created", scenario=run.data, elements=run.elements)
    line, words = told(run, "absent")
    assert line is None
    assert "r starts" in words


def test_a_starting_engine_is_not_called_dead(run):
    assert "starts" in told(run.created(), "starting")[1]


def test_it_is_said_that_the_piles_settle(run):
    run.created().write("supports_started")
    assert told(run)[1].startswith("Finding models that support others")
    run.supports()
    assert "rests on" not in told(run)[1]


def test_a_slow_world_is_told_while_its_baseline_runs(run):
    run.created().write("noted", about="slow", words="this world is slow: 0.25 s simulated in each second")
    assert "This world is slow: 0.25 s simulated in each second." in told(run)[1]


def test_the_baseline_counts_its_runs(run):
    run.created()
    run.test(None, "failed")
    run.test(None, "pass", run=1)
    line, words = told(run)
    assert line == 0
    assert "Of 2 runs so far 1 failed and 1 reached the goal" in words


def test_between_baseline_and_round_the_partitioning_is_named(run):
    line, words = told(run.created().baseline())
    assert line == 2
    assert "11 models" in words
    assert "split by model2model" in words
    assert "Baseline: the robot got stuck in 3 of 4 runs (75 %" in words


def test_a_first_run_is_line_5(run):
    run.created().baseline()
    run.start_round(3)
    run.start(0)
    line, words = told(run)
    assert line == 5
    assert "First run of part A (4 models), candidate 1 of 6" in words
    assert "within 0.33 m" in words


@pytest.mark.parametrize(
    ("outcome", "reason"),
    [
        ("pass", "the goal was reached"),
        ("other", "the robot tipped over 2.3 m from f's end"),
        ("error", "broke"),
        ("timeout", "too long"),
    ],
)
def test_a_rerun_is_line_7_and_says_why(run, outcome, reason):
    run.created().baseline()
    run.start_round(2)
    run.test(0, outcome, 2.3, failure="tipped over" if outcome == "other" else "")
    run.start(0, 1)
    line, words = told(run)
    assert line == 7
    assert "Re-run 1 of 3" in words
    assert reason in words


def test_speculation_is_shown(run):
    assert "1 later candidate at the same time" in told(fake_moments.mid_round(run))[1]


def test_waiting_names_the_keys_and_the_sizes(run):
    line, words = told(fake_moments.waiting(run))
    assert line == 10
    assert "got stuck 0.12 m from f's end" in words
    assert "a accepts it (11 → 4 models), x rejects" in words


def test_a_reduction_is_line_11(run):
    run.created().baseline()
    run.start_round(2)
    test = run.similar(0)
    run.write("reduced", candidate=0, environment=[0, 1, 2, 3, 4, 5], evidence_test=test)
    line, words = told(run)
    assert line == 11
    assert "11 → 6 models" in words


def test_a_round_without_f_is_line_15(run):
    run.created().baseline()
    run.start_round(2)
    run.dissimilar(0)
    run.dissimilar(1)
    assert told(run)[0] == 15


def test_a_full_disk_comes_first(run):
    fake_moments.mid_round(run).write("disk_space", enough=False, needed=32_000_000, free=1)
    assert told(run)[1].startswith("The disk is full: no new test starts until 32 MB are free.")
    assert facts(snapshot(run))["state"][0] == "! out of disk space"
    run.write("disk_space", enough=True, needed=32_000_000, free=10**9)
    assert "disk" not in told(run)[1]


def test_paused_comes_first(run):
    fake_moments.mid_round(run).write("paused")
    line, words = told(run)
    assert line == 7
    assert words.startswith("Paused: no new test starts; running tests finish first.")


def test_after_a_step_its_result_is_shown(run):
    run.created().baseline()
    run.start_round(2)
    run.reduce(0, run.elements[:6], run.similar(0))
    run.start_round(3, run.elements[:6])
    run.write("paused")
    assert "part A showed f: 11 → 6 models. Next is part A (2 models)" in told(run)[1]
    run.test(0, "pass")
    assert told(run)[1].endswith(
        "Next is re-run 1 of 3 of part A (2 models), candidate 1 of 6: last time the goal was reached."
    )


def test_a_minimal_end_names_what_is_kept(run):
    line, words = told(fake_moments.finished(run), "absent")
    assert line == 21
    assert "Minimal: 2 models left" in words
    assert "crate_00, crate_01" in words
    assert "95 % interval 30 % to 95 %" in words


def test_what_showed_f_is_run_again_until_it_is_clear_that_it_keeps_the_rate(run):
    run.created().baseline()
    run.start_round(2)
    run.test(0, "similar", 0.1, failure="stuck")
    run.test(0, "pass", run=1)
    assert (
        "Next is one more run of part A (6 models), candidate 1 of 2: f showed in 1 of 2 runs so far." in told(run)[1]
    )
    run.live((run.start(0, 2), 0.4))
    words = told(run)[1]
    assert "Run 3 of part A (6 models), candidate 1 of 2: f showed in 1 of 2 runs so far." in words
    assert "It is accepted once its runs show that it keeps the rate of f" in words


def test_a_certificate_comes_before_the_end(run):
    line, words = told(fake_moments.certifying(run))
    assert line == 21
    assert "they have to show that what is left keeps 67 % of the whole world's rate" in words
    assert "So far f shows in 11 of 12 runs of what is left." in words
    assert "Now: run 5 of everything that is left except crate_00." in words


def test_minimal_is_said_with_what_it_means(run):
    words = told(fake_moments.finished(run), "absent")[1]
    assert (
        "Minimal: 2 models left. No single model can be removed: f in 23 of 23 fresh runs (80 % to 100 %), at least 81 %"
        in words
    )
    assert "Minimal means: what is left keeps at least 81 % of the whole world's rate" in words


def test_without_fresh_runs_nothing_is_called_minimal(run):
    words = told(fake_moments.uncertified(run), "absent")[1]
    assert "No single model can be removed; no fresh runs were made." in words
    assert "Minimal" not in words


def test_what_is_not_shown_is_said_in_so_many_words(run):
    words = told(fake_moments.not_shown(run), "absent")[1]
    assert "Not shown that each model is needed: tests broke without crate_01" in words
    assert "Minimal" not in words


def test_where_f_is_rarer_the_key_that_goes_back_is_named(run):
    words = told(fake_moments.rarer(run))[1]
    assert "f is rarer than it was: f in 1 of 6 here, 3 of 4 in the whole world. u goes back to 11 models." in words
    assert "rarer" not in told(fake_moments.mid_round(fake_run.FakeRun(run.path.with_name("b.ddenv"))))[1]


def test_other_failures_in_the_baseline_are_named_and_counted(run):
    state = fold(run.created().baseline(others=2).file.events())
    assert "95 %). Other failures: 2. fell at (3.00, 1.40) in 2 runs (--failure selects another one)." in baseline(
        state
    )


def test_a_baseline_that_goes_on_says_why(run):
    run.created()
    for number in range(4):
        run.test(None, "failed" if number == 1 else "pass", run=number, failure="stuck" if number == 1 else "")
    assert "The robot runs in the whole world 4 times" in told(run)[1]
    run.start(run=4)
    assert "Few runs of the whole world show f, or they show several failures, so more runs are made." in told(run)[1]
    assert "Of 4 runs so far 1 failed and 3 reached the goal." in told(run)[1]


def test_an_early_end_is_not_called_minimal(run):
    run.created()
    run.write("finished", minimal=False, reason="the robot never failed in 4 runs")
    line, words = told(run, "absent")
    assert line is None
    assert words == "The robot never failed in 4 runs."


@pytest.mark.parametrize(
    ("kind", "words"), [("engine_stopped", "r resumes"), ("engine_failed", "could not go on: disk full")]
)
def test_stopped_and_failed(run, kind, words):
    run.created().write(kind, reason="disk full")
    assert words in told(run, "absent")[1]


def test_a_killed_engine_is_named_with_the_key_that_resumes(run):
    fake_moments.mid_round(run)
    words = told(run, "absent")[1]
    assert "not running" in words
    assert "r resumes" in words
    assert "2 unfinished tests" in words


def test_the_chance_to_miss_f_names_the_cure(run):
    state = fold(run.created().baseline(failures=1).file.events())
    words = "for a 95 % chance of seeing f, use --iterations 2"
    assert words not in baseline(state)
    state.scenario["reduction"] = {"iterations": 1}
    assert words in baseline(state)


def test_long_lists_of_models_are_cut(run):
    run.created().baseline()
    run.write("finished", minimal=False, reason="stopped early")
    assert "and 3 more" in told(run, "absent")[1]


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
        "accepted_other", test=8, what="try 2", trial=2, environment=[0, 1], outcomes={"8": "similar"}, distances={}
    )
    assert told(run)[1].startswith("Accepted another failure as f: try 2")
    run.start_round(2, run.elements[:2])
    run.dissimilar(0)
    run.write("round_finished")
    assert "Accepted another" not in told(run)[1]


def test_a_budget_that_is_used_up_names_the_key_that_gives_more(run):
    run.created().baseline()
    run.write("changed", settings={"budget": 4})
    run.write("engine_stopped", reason="the budget of 4 tests is used up")
    words = told(run, "absent")[1]
    assert "The engine was stopped: the budget of 4 tests is used up." in words
    assert "c raises it, and the run goes on" in words


def test_what_was_pinned_is_not_called_needed(run):
    fake_moments.finished(run)
    run.pin("crate_00")
    run.start_certificate()
    run.finish_certificate((None, "kept", 23 * "s"), ("crate_01", "needed", 11 * "p"))
    run.write("finished", minimal=True, reason="no other single model can be removed")
    assert "any one model that is not pinned (" in told(run, "absent")[1]
    assert (
        "never left out) removed, f shows at most 54 % as often; the chance that this is wrong"
        in told(run, "absent")[1]
    )
    assert "p unpins." in told(run, "absent")[1]


def test_a_file_that_is_gone_and_another_engine_are_named(run):
    fake_moments.mid_round(run)
    found = snapshot(run)
    gone = replace(found, gone=True, error="x.ddenv: the run file was deleted", engine="absent")
    assert explain(gone).sentences[0] == "x.ddenv: the run file was deleted."
    other = replace(found, state=found.state.changed(engine_version="0.0.1"), version="0.1.0")
    assert explain(other).sentences[0].startswith("Another version of ddenv works on this run (0.0.1)")


@pytest.mark.parametrize("scenario", [{}, {"reduction": 3, "failure": {"epsilon": "x"}}])
def test_settings_that_make_no_sense_do_no_harm(run, scenario):
    run.write("created", scenario=scenario, elements=run.elements)
    run.write("engine_started", pid=1, jobs=1, version="0", simulator="none")
    assert told(run)[0] == 0


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
