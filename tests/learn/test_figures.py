"""Figures and places of lessons, counted again from the tests and events of a run with two certificates."""

import pytest

from ddenv.learn.attempt import read_oracle
from ddenv.learn.lesson_figures import OF_RUN, Figures
from ddenv.learn.reading import Places
from ddenv.learn.shelf import LESSONS
from ddenv.runfile.position import position_in
from ddenv.runfile.store import RunFile


@pytest.fixture(scope="module")
def events():
    with RunFile(LESSONS / "quay-kept.ddenv") as file:
        return file.events()


@pytest.fixture(scope="module")
def position(events):
    return position_in(events)


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("certificate 1", "certificate_started"),
        ("claims 2", "certificate_finished"),
        ("back 1", "rate_lost"),
        ("test 258", "test_started"),
        ("result 258", "test_finished"),
        ("verdict 258", "candidate_judged"),
        ("end", "finished"),
    ],
)
def test_a_place_is_the_event_that_its_words_say(events, position, words, kind):
    id = Places(position, events).event(words)
    assert next(event for event in events if event.id == id).kind == kind


def test_figures_of_a_certificate_are_those_of_its_runs(position):
    state = position.end
    figures = Figures(state, state)
    fresh = [test for test in state.tests if test.phase == "certify" and test.run >= state.certificate.first_run]

    def said(node, without):
        runs = [test.outcome == "similar" for test in fresh if (test.node, test.without) == (node, without)]
        return f"f in {sum(runs)} of {len(runs)} fresh runs ("

    assert figures("fresh").startswith(said(state.node, None))
    assert figures("fresh_whole").startswith(said(0, None))
    for name in state.environment:
        assert figures(f"without {name}").startswith(said(state.node, name))
    assert {figures(f"verdict on {name}") for name in ("oil", "ramp")} == {"needed", "not shown"}
    assert figures("certificates") == "2"


def test_figures_of_rates_are_those_of_the_oracle(position):
    oracle = read_oracle(LESSONS / "quay.oracle.json")
    figures = Figures(position.end, position.state(1), oracle)
    assert figures("whole_rate") == figures("here_rate") == "90 %"
    assert figures("rate of gate, oil") == "60 %"
    assert figures("rate of oil") == "0 %"
    # Four runs at 10 %: 1 - 0.9^4.
    assert figures("chance of gate") == "34 %"


def test_a_figure_of_a_run_beside_is_that_of_its_end(position):
    figures = Figures(position.state(1), position.state(1), others={"kept": position.end})
    for name in OF_RUN:
        assert figures(f"kept.{name}") == Figures(position.end, position.end)(name)
