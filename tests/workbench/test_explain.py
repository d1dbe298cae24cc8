from dataclasses import replace

import fake_run
import pytest

from ddenv.runfile.fold import fold
from ddenv.schemas import names
from ddenv.workbench.run.explain import baseline_sentence, explain
from ddenv.workbench.run.methods import ANY, LISTINGS, listing
from ddenv.workbench.run.poll import Poll, Snapshot


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


def test_speculation_is_told(run):
    assert "1 later candidate at the same time" in told(fake_run.mid_round(run))[1]


def test_waiting_tells_the_keys_and_the_sizes(run):
    line, words = told(fake_run.waiting(run))
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


def test_paused_comes_first(run):
    fake_run.mid_round(run).write("paused")
    line, words = told(run)
    assert line == 7
    assert words.startswith("Paused: no new test is started; what runs now is finished first.")


def test_a_step_leaves_behind_what_came_of_it(run):
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
    line, words = told(fake_run.finished(run), "absent")
    assert line == 21
    assert "Minimal: 2 models left" in words
    assert "crate_00, crate_01" in words
    assert "95 % interval 30 % to 95 %" in words


def test_full_runs_of_what_is_left_come_before_the_end(run):
    line, words = told(fake_run.confirming(run))
    assert line == 21
    assert "Confirming what is left with full runs" in words
    assert "run 2 of all that is left but crate_00" in words
    run.write("finished", minimal=True, reason="no candidate showed f")
    assert "f is not seen again; full runs confirm it." in told(run, "absent")[1]


def test_how_a_baseline_run_failed_otherwise_is_counted(run):
    run.created()
    run.test(None, "other", 3.0, failure="fell")
    state = fold(run.baseline().file.events())
    assert "95 %); 1 run failed in another way." in baseline_sentence(state, 3)


def test_files_that_do_not_say_how_a_robot_failed_are_worded_too(run):
    run.created().baseline()
    run.start_round(2)
    run.test(0, "other", 2.3)
    run.start(0, 1)
    assert "the robot failed elsewhere, 2.3 m from f's end" in told(run)[1]


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


@pytest.mark.parametrize("shown", [*LISTINGS.values(), ANY], ids=[*LISTINGS, "any"])
def test_lines_of_a_listing_are_in_order_and_every_step_has_one(shown):
    numbers = [number for number, _ in shown.lines]
    assert numbers == sorted(set(numbers))
    steps = ("baseline", "split", "next", "test", "rerun", "waiting", "reduced", "nothing", "returned")
    assert {shown.line(step, None) for step in steps} <= set(numbers)
    # The panel of the run screen is so wide inside, without the mark and the number.
    assert all(len(code) <= 49 for _, code in shown.lines)


def test_the_listing_says_when_n_grows():
    assert (15, " n_partitions ← n_partitions + 1") in listing("ddenv").lines
    assert (15, " if none similar: n_partitions + 1") in listing("ddenv", "steady").lines


def test_every_algorithm_of_ours_has_its_own_listing():
    assert set(LISTINGS) == set(names("algorithm"))
    assert listing("theirs") is ANY


@pytest.fixture
def run_by(runs):
    """Makes a run by an algorithm, after its baseline."""
    made = []

    def make(algorithm):
        data = fake_run.scenario()
        data["reduction"]["algorithm"] = algorithm
        made.append(fake_run.FakeRun(runs / f"{algorithm}.ddenv", data))
        return made[-1].created().baseline()

    yield make
    for each in made:
        each.close()


def leave_out(run, *groups, kept=None):
    """A round that leaves out each of the groups (places in the kept models) in turn."""
    run.round += 1
    kept = list(range(11)) if kept is None else kept
    rest = [place for place in kept if len(groups) == 1 and place not in groups[0]]
    partitions = [*map(list, groups), *([rest] if rest else [])]
    candidates = [["complement", index, 0.0] for index in range(len(groups))]
    run.write(
        "round_started",
        round=run.round,
        n_partitions=len(partitions),
        environment=kept,
        partitions=partitions,
        candidates=candidates,
    )


BEGINNINGS = {
    "ddmin": "the 11 models of E are cut into parts of equal size, in the order of the world file",
    "probdd": "of the 11 models of E, those go whose loss is the greatest gain to expect",
    "splitting": "the farthest that are undecided go; failure-proximal says what is far",
    "theirs": "theirs decides what is tried",
}


@pytest.mark.parametrize(("algorithm", "words"), BEGINNINGS.items())
def test_before_a_round_each_algorithm_says_where_its_candidates_come_from(run_by, algorithm, words):
    line, told_words = told(run_by(algorithm))
    assert line == listing(algorithm).split
    assert words in told_words
    assert "split by" not in told_words


@pytest.mark.parametrize("algorithm", ["ddmin", "probdd", "splitting", "theirs"])
def test_tests_and_reruns_are_marked_in_the_listing_of_the_algorithm(run_by, algorithm):
    run = run_by(algorithm)
    leave_out(run, [0, 1])
    first = run.start(0)
    explanation = explain(snapshot(run))
    assert explanation.lines is listing(algorithm).lines
    assert "R(" in dict(explanation.lines)[explanation.line]
    assert ("which leaves out a group of 2" in explanation.sentences[0]) == (algorithm in ("probdd", "splitting"))
    run.finish(first, "pass")
    run.start(0, 1)
    explanation = explain(snapshot(run))
    assert "deflake" in dict(explanation.lines)[explanation.line]
    assert "Re-run 1 of 3" in explanation.sentences[0]


def test_ddmin_says_how_n_changes(run_by):
    run = run_by("ddmin")
    run.start_round(3)
    for candidate in range(6):
        run.dissimilar(candidate)
    assert "n doubles" in told(run)[1]
    run.write("round_finished")
    assert "so n doubles" in told(run)[1]
    run.start_round(3)
    run.reduce(0, run.elements[:4], run.similar(0))
    assert "cut in two next" in told(run)[1]
    run.start_round(3, run.elements[:4])
    run.reduce(1, run.elements[1:4], run.similar(1))
    assert "n is one less" in told(run)[1]


FRUITLESS = {
    ("probdd", 2): "each model that was left out is likelier to be needed",
    ("splitting", 2): "one of those that were left out is needed; half of them go next",
    ("probdd", 1): "the model that was left out is needed",
    ("splitting", 1): "the model that was left out is needed",
}


@pytest.mark.parametrize(("algorithm", "size", "words"), [(*what, words) for what, words in FRUITLESS.items()])
def test_a_group_that_is_needed_is_followed_by_what_that_means(run_by, algorithm, size, words):
    run = run_by(algorithm)
    leave_out(run, list(range(size)))
    run.dissimilar(0)
    line, told_words = told(run)
    assert line == 6
    assert f"E stays as it is; {words}." in told_words
    run.write("round_finished")
    assert words in told(run)[1]


@pytest.mark.parametrize("algorithm", ["probdd", "splitting"])
def test_the_last_sweep_is_told_as_one(run_by, algorithm):
    run = run_by(algorithm)
    leave_out(run, [0], [1], [2], kept=[0, 1, 2])
    run.start(0)
    line, words = told(run)
    assert line == 7
    assert "without A (2 models), model 1 of 3 in the last sweep" in words
    run.finish(5, "pass")
    for candidate in range(3):
        run.dissimilar(candidate)
    line, words = told(run)
    assert line == 7
    assert "Each model was left out once: nothing more can be removed." in words
    run.write("round_finished")
    run.write("finished", minimal=True, reason="no candidate showed f")
    assert told(run, "absent")[0] == 8


def test_tries_and_pins_are_told_beside_the_round(run):
    fake_run.guided(run)
    line, words = told(run)
    assert line == 5
    assert "First run of part B (3 models)" in words
    assert "try 3 by hand (4 models) is tested: first run." in words
    assert "Pinned, and so in every candidate: crate_00." in words
    run.judge_trial(3, "similar", [15])
    assert told(run)[1].startswith("try 3 shows f with 4 models: a on its row adopts it.")


def test_how_the_user_came_to_this_environment_is_told_until_something_is_run(run):
    fake_run.guided(run).go_back(1)
    assert told(run)[1].startswith("Went to 6 models (part A).")
    run.write("changed", settings={"iterations": 5})
    assert told(run)[1].startswith("Changed iterations 3 to 5: it holds from this round on.")
    run.try_out(run.elements[:3])
    run.finish(run.start_hand(4), "similar", 0.1, failure="stuck")
    run.judge_trial(4, "similar", [run.tests])
    run.adopt(4, run.elements[:3], run.tests)
    words = told(run)[1]
    assert words.startswith("You adopted try 4: 6 → 3 models. Round 4")
    run.write("accepted_other", test=8, what="try 2", trial=2, environment=[0, 1], outcomes={}, distances={})
    assert told(run)[1].startswith("You took the other failure of try 2 for as good as f: 3 → 2 models.")
    run.start_round(2, run.elements[:2])
    run.dissimilar(0)
    run.write("round_finished")
    assert "You took" not in told(run)[1]


def test_a_budget_that_is_used_up_names_the_key_that_gives_more(run):
    run.created().baseline()
    run.write("changed", settings={"budget": 4})
    run.write("engine_stopped", reason="the budget of 4 tests is used up")
    words = told(run, "absent")[1]
    assert "The engine was stopped: the budget of 4 tests is used up." in words
    assert "c gives more, and the run goes on" in words


def test_what_was_pinned_is_not_called_needed(run):
    fake_run.finished(run)
    for name, words in (
        ("crate_00", "the other one f is not seen again; 1 model pinned by you"),
        ("crate_01", "was not tried"),
    ):
        run.pin(name)
        run.write("finished", minimal=True, reason="")
        assert words in told(run, "absent")[1]


def test_a_file_that_is_gone_and_another_engine_are_told(run):
    fake_run.mid_round(run)
    found = snapshot(run)
    gone = replace(found, gone=True, error="x.ddenv: the run file was deleted", engine="absent")
    assert explain(gone).sentences[0] == "x.ddenv: the run file was deleted."
    other = replace(found, state=found.state.changed(engine_version="0.0.1"))
    assert explain(other).sentences[0].startswith("Another version of ddenv works on this run (0.0.1)")


@pytest.mark.parametrize("scenario", [{}, {"reduction": 3, "failure": {"epsilon": "x"}}])
def test_settings_that_make_no_sense_do_no_harm(run, scenario):
    run.write("created", scenario=scenario, elements=run.elements)
    run.write("engine_started", pid=1, jobs=1, version="0", simulator="none")
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
