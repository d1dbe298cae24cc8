"""A run in plain lines: what is said, what typed words do, and that nothing is ever drawn again."""

import io
import subprocess
import sys

import fake_moments
import pytest

from ddenv.guiding.key_offers import ACTIONS
from ddenv.workbench.line_mode import GUIDES, QUESTIONS, LineMode
from ddenv.workbench.run.run_keys import GUIDING


def said(run, *lines, watch=False, between=lambda: None):
    """All that is said after these lines were typed, one after the other."""
    out = io.StringIO()

    def typed():
        for line in lines:
            between()
            yield line
        yield "quit"

    LineMode(run.path, watch, out).follow(typed())
    assert not any(char in out.getvalue() for char in "\x1b\r\x07")
    return out.getvalue()


def commands(run):
    return [(command.kind, command.data) for command in run.file.commands()]


def test_it_begins_with_where_the_run_is_and_goes_on_with_what_happens(run):
    fake_moments.mid_round(run).hold()
    before = said(run)
    assert "running · round 2, n 3 · 6 of 11 models · 10 tests, 2 running" in before
    assert "an engine is running" in before
    events = iter([lambda: run.finish(11, "pass"), lambda: run.judge(1, "dissimilar", [10, 11])])
    now = said(run, "", "", between=lambda: next(events, lambda: None)())
    assert now.endswith("  without A (4 models): dissimilar after 2 tests (2 pass)\n")


@pytest.mark.parametrize(
    "moment",
    [fake_moments.mid_round, fake_moments.certifying, fake_moments.finished, fake_moments.guided],
)
def test_every_question_has_an_answer_at_any_time(run, moment):
    moment(run)
    for question in QUESTIONS:
        assert len(said(run, question)) > len(said(run))


def test_what_stands_in_the_table_is_said_in_words(run):
    fake_moments.guided(run)
    words = said(run, "table", "models")
    assert "try 2: 2 models, dissimilar, 4 tests" in words
    assert "part B: 3 models, in test, 1 test, ranked by 2.1" in words
    assert "5 models left: crate_00 (pinned), crate_01" in words


def test_typed_words_and_the_keys_of_the_screen_guide_the_run(run):
    fake_moments.waiting(run).hold()
    assert "part A is accepted" in said(run, "a")
    assert commands(run) == [("accept", {"round": 1, "candidate": 0})]
    words = said(
        run,
        "veto part C",
        "p crate_07, crate_08",
        "yes",
        "pin nobody",
        "veto part Z",
        "veto",
        "dance",
        "pin",
    )
    assert commands(run)[1:] == [
        ("veto", {"round": 1, "candidate": 4}),
        ("pin", {"models": [7, 8]}),
    ]
    assert "Part A shows f and waits for you (11 → 4 models)" in words
    for why in (
        "no model 'nobody'",
        "no 'part Z' in this round",
        "no command 'dance'",
        "pin: which models?",
    ):
        assert why in words


def test_a_question_is_answered_by_the_next_line_and_watching_changes_nothing(run):
    fake_moments.not_shown(run)
    run.hold()
    assert "there is no 'try 1'" in said(run, "accept try 1")
    assert "not possible: there is nothing to reject" in said(run, "reject", "yes")
    assert "watching only" in said(run, "pause", "undo", watch=True)
    assert commands(run) == []


def test_every_action_that_guides_a_run_can_be_typed_with_its_key(run):
    typed = {action: key for action, key, _ in GUIDES.values()}
    # The settings are asked for in a dialog.
    assert typed.keys() == ACTIONS.keys() - {"change"}
    assert {action: GUIDING[action].key for action in typed} == typed
    assert not set(GUIDES) & set(QUESTIONS)
    words = said(run, "help")
    assert all(f"\n{word}" in words for word in (*GUIDES, *QUESTIONS, "quit"))


@pytest.mark.programs
def test_the_program_ends_with_the_run_when_nothing_more_can_be_typed(run):
    fake_moments.finished(run)
    words = [sys.executable, "-m", "ddenv", "open", str(run.path), "--lines"]
    done = subprocess.run(
        words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert "finished · round 3, n 2 · 2 of 11 models · 83 tests" in done.stdout
