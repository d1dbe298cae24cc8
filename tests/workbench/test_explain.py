import fake_run
import pytest

from ddenv.runfile.fold import fold
from ddenv.workbench.explain import ALGORITHM, baseline_sentence, explain
from ddenv.workbench.poll import Poll, Snapshot


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


def test_a_starting_engine_is_no_dead_one(run):
    assert "starts" in told(run.created(), "starting")[1]


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
    assert "3 of 4 runs failed (75 %" in words


def test_a_first_run_is_line_5(run):
    run.created().baseline()
    run.start_round(3)
    run.start(0)
    line, words = told(run)
    assert line == 5
    assert "First run of part A (4 models), candidate 1 of 6" in words
    assert "within 0.5 m" in words


@pytest.mark.parametrize(
    ("outcome", "reason"),
    [
        ("pass", "the goal was reached"),
        ("other", "failed elsewhere, 2.3 m from f's end"),
        ("error", "broke"),
        ("timeout", "too long"),
    ],
)
def test_a_rerun_is_line_7_and_says_why(run, outcome, reason):
    run.created().baseline()
    run.start_round(2)
    run.test(0, outcome, 2.3)
    run.start(0, 1)
    line, words = told(run)
    assert line == 7
    assert "Re-run 1 of 3" in words
    assert reason in words


def test_speculation_is_told(run):
    assert "1 later candidate at the same time" in told(fake_run.mid_round(run))[1]


def test_waiting_tells_the_keys_and_the_sizes(run):
    line, words = told(fake_run.waiting(run))
    assert line == 10
    assert "ended 0.12 m from f's end" in words
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


def test_paused_comes_first(run):
    fake_run.mid_round(run).write("paused")
    line, words = told(run)
    assert line == 7
    assert words.startswith("Paused: no new test is started; what runs now is finished first.")


def test_a_minimal_end_names_what_is_kept(run):
    line, words = told(fake_run.finished(run), "absent")
    assert line == 21
    assert "Minimal: 2 models left" in words
    assert "crate_00, crate_01" in words
    assert "95 % interval 30 % to 95 %" in words


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


def test_a_killed_engine_is_told_with_the_way_out(run):
    fake_run.mid_round(run)
    words = told(run, "absent")[1]
    assert "not running" in words
    assert "r resumes" in words
    assert "2 tests" in words


def test_the_chance_to_miss_f_names_the_cure(run):
    state = fold(run.created().baseline(failures=1).file.events())
    assert "for 95 % certainty set iterations to 2" in baseline_sentence(state, 1)
    assert "certainty" not in baseline_sentence(state, 3)


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


def test_lines_of_the_algorithm_are_in_order():
    numbers = [number for number, _ in ALGORITHM]
    assert numbers == sorted(numbers)


@pytest.mark.parametrize("scenario", [{}, {"reduction": 3, "failure": {"epsilon": "x"}}])
def test_settings_that_make_no_sense_do_no_harm(run, scenario):
    run.write("created", scenario=scenario, elements=run.elements)
    run.write("engine_started", pid=1, jobs=1)
    assert told(run)[0] == 0


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("waiting", {"candidate": 99}),
        ("waiting", {"candidate": -1}),
        ("reduced", {"candidate": 99, "environment": [0], "evidence_test": 1}),
        ("test_started", {"test": 1}),
        ("created", {"scenario": 3, "elements": 4}),
    ],
)
def test_events_that_do_not_fit_are_told_and_the_rest_is_shown(run, kind, data):
    run.created().baseline()
    run.start_round(2)
    run.write(kind, **data)
    poll = Poll(run.path)
    found = poll.look()
    poll.close()
    assert f"({kind})" in found.error
    assert found.state.round.number == 1
    explain(found)
