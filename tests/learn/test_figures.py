"""Figures and places of lessons, counted again from the tests and events of a run with three
certificates.
"""

import pytest

from ddenv.errors import UserError
from ddenv.evidence.certificate import IN_TURN, Pairs
from ddenv.learn.attempt import read_oracle
from ddenv.learn.catalog import LESSONS
from ddenv.learn.lesson_figures import OF_RUN, Figures
from ddenv.learn.reading import Places
from ddenv.runfile.position import position_in
from ddenv.runfile.store import RunFile
from ddenv.text import percent_at_least, percent_at_most


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
        ("claims 3", "certificate_finished"),
        ("back 1", "rate_lost"),
        ("test 134", "test_started"),
        ("result 134", "test_finished"),
        ("verdict 134", "candidate_judged"),
        ("end", "finished"),
    ],
)
def test_a_place_is_the_event_that_its_words_say(events, position, words, kind):
    id = Places(position, events).event(words)
    assert next(event for event in events if event.id == id).kind == kind


def test_figures_of_a_certificate_are_those_of_its_runs(position):
    state = position.end
    figures = Figures(state, state)
    fresh = [
        test
        for test in state.tests
        if test.phase == "certify" and test.run >= state.certificate.first_run
    ]

    def said(node, without):
        runs = [
            test.outcome == "similar"
            for test in fresh
            if (test.node, test.without) == (node, without)
        ]
        return f"f in {sum(runs)} of {len(runs)} fresh runs ("

    for name in state.environment:
        assert figures(f"without {name}").startswith(said(state.node, name))
        assert figures(f"verdict on {name}") == "needed"
    assert figures("certificates") == "3"


def test_bounds_are_those_of_the_pairs_at_the_place_of_the_step(events, position):
    """What is shown grows run by run, and is what the bets on the pairs so far say."""
    places, before = Places(position, events), 0.0
    for result in ("result 170", "result 180", "result 200"):
        state = position.state(places.event(result))
        first, ran = (
            state.certificate.first_run,
            {
                (test.node, test.run): test.outcome == "similar"
                for test in state.confirm_tests
                if test.is_finished
            },
        )
        mine = [run for node, run in ran if node == state.node and run >= first]
        # Where what is left showed f, the whole world is taken to show it, too.
        pairs, shown = Pairs(), 0.0
        for run in mine:
            pairs = pairs.after(ran[state.node, run], ran.get((0, run), True))
            shown = pairs.keeps_at_least(state.certificate.error * IN_TURN, shown)
        figures = Figures(position.end, state)
        assert (
            figures("here_left")
            == f"{sum(ran[state.node, run] for run in mine)} of {len(mine)} runs"
        )
        assert figures("here_bound") == percent_at_least(shown) and before < shown < 2 / 3
        before = shown
    with pytest.raises(UserError, match="no fresh run has yet left 'gate' out"):
        figures("here_bound without gate")
    ended = Figures(position.end, position.state(places.event("claims 3")))
    assert (ended("here_aim"), ended("here_bound")) == ("80 %", "80 %")
    # What the certificate said at its end.
    gate = next(claim for claim in position.end.certificate.claims if claim.without == "gate")
    assert (gate.shown, ended("here_bound without gate")) == (0, percent_at_most(gate.bound))


def test_how_often_f_showed_in_the_whole_world_is_told_if_it_ran_with_all_seeds(events, position):
    state = position.state(Places(position, events).event("claims 1"))
    fresh = [
        test.outcome == "similar"
        for test in state.confirm_tests
        if test.node == 0 and test.without is None
    ]
    assert Figures(position.end, state)("here_fresh_whole").startswith(
        f"f in {sum(fresh)} of {len(fresh)} fresh runs ("
    )


def test_figures_of_rates_are_those_of_the_oracle(position):
    oracle = read_oracle(LESSONS / "quay.oracle.json")
    figures = Figures(position.end, position.state(1), oracle)
    assert figures("whole_rate") == figures("here_rate") == "90 %"
    assert figures("rate of gate, oil") == "50 %"
    assert figures("rate of oil") == "0 %"
    # Four runs at 10 %: 1 - 0.9^4.
    assert figures("chance of gate") == "34 %"


def test_a_figure_of_a_run_beside_is_that_of_its_end(position):
    figures = Figures(position.state(1), position.state(1), others={"kept": position.end})
    for name in OF_RUN:
        assert figures(f"kept.{name}") == Figures(position.end, position.end)(name)
