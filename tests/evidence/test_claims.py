"""What a run claims of its result is worded in one place, and claims nothing of models that were
never left out.
"""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.cli.summary import summary, summary_lines
from ddenv.evidence.claims import never_left_out
from ddenv.page.markdown import markdown
from ddenv.report.report import content
from ddenv.report.run_data import read_run
from ddenv.runfile.fold import fold
from ddenv.runfile.snapshot import Snapshot
from ddenv.text import percent_at_least, percent_at_most
from ddenv.words.claims import promise, verdict_on
from ddenv.words.explain import explain
from ddenv.words.news import news
from tests.workbench import fake_run

PINNED = "1 pinned model was never left out"


@pytest.fixture
def pinned(home):
    """A certified run of three models, one of which was pinned."""
    (home / "runs").mkdir()
    run = fake_run.FakeRun(home / "runs" / "crates-1.ddenv")
    run.created().baseline()
    run.start_round(2)
    test = run.similar(0)
    run.reduce(0, run.elements[:3], test)
    run.pin("crate_00")
    run.start_certificate()
    run.certify_all(1, None, 23 * "s")
    for name in ("crate_01", "crate_02"):
        run.certify_all(1, name, 11 * "p")
    run.finish_certificate(
        (None, "kept", 23 * "s"), ("crate_01", "needed", 11 * "p"), ("crate_02", "needed", 11 * "p")
    )
    events = run.file.events()
    state = fold(events)
    run.write(
        "finished",
        minimal=True,
        reason=verdict_on(state.certificate, never_left_out(state, state.certificate)),
    )
    yield run
    run.close()


def test_screen_report_json_and_console_say_that_a_pinned_model_was_never_left_out(pinned):
    state = fold(pinned.file.events())
    found = state.certificate
    means = promise(state, found)
    assert f"any one model that is not pinned ({PINNED})" in means
    assert means[1:] in " ".join(explain(Snapshot(state=state, live=(), engine="absent")).sentences)
    assert means in " ".join(summary_lines(state, pinned.path))
    report = markdown(content(read_run(pinned.path)), "report")
    told = summary(state, pinned.path)
    assert told["certificate"]["means"] == means and told["certificate"]["never_left_out"] == 1
    assert PINNED in told["reason"] and json.dumps(told)
    assert f"any one model that is not pinned ({PINNED})" in report
    last = next(event for event in pinned.file.events() if event.kind == "certificate_finished")
    before = fold(pinned.file.events()[: last.id - 1])
    assert news(last.kind, before, fold(pinned.file.events()[: last.id])).endswith(PINNED)


def test_the_sentence_says_how_many_were_left_out(pinned):
    said = fold(pinned.file.events()).reason
    assert said.startswith("no other single model can be removed: f in 23 of 23 fresh runs")
    assert (
        "without any one of these 2, f in none of 11 fresh runs each (upper bound: 55 % as "
        f"often); {PINNED}"
    ) in said


def test_a_single_model_that_was_left_out_is_named(pinned):
    found = fold(pinned.file.events()).certificate
    said = verdict_on(replace(found, claims=found.claims[:2]))
    assert said.endswith(
        "; without crate_01, f in none of 11 fresh runs (upper bound: 55 % as often)"
    )


@given(st.floats(0.0, 1.0))
def test_a_bound_is_rounded_to_the_side_on_which_it_holds(bound):
    said_least, said_most = (
        float(said(bound)[:-2]) / 100.0 for said in (percent_at_least, percent_at_most)
    )
    assert bound - 0.01 < said_least <= bound + 1e-9
    assert bound - 1e-9 <= said_most < bound + 0.01


def test_a_bound_of_whole_percents_is_said_as_it_is():
    assert [percent_at_least(part / 100.0) for part in range(101)] == [
        f"{part} %" for part in range(101)
    ]
    assert [percent_at_most(part / 100.0) for part in range(101)] == [
        f"{part} %" for part in range(101)
    ]
