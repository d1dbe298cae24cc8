"""A reduction that the user guides by hand: on a simulator that costs nothing."""

import random
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.claims import ended, meaning, smaller_known
from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.runfile.atlas import atlas, models_of
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.test_driver import Killed, _finished, _kill, flaky, needs
from tests.tiers import examples


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Nobody waits for the user to come to rest."""
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)
    monkeypatch.setattr("ddenv.engine.bench.WAIT", 0.0)


class Guided(FakePool):
    """`guide` is a generator: it is sent the state at each look around, and yields commands as (kind, data), or None to wait."""

    def __init__(self, path, oracle, guide, jobs=1):
        super().__init__(oracle, jobs)
        self.viewer = RunFile(path)
        self.guide = guide
        next(guide)

    def finished(self, seconds):
        state = fold(self.viewer.events())
        if state.last_command == len(self.viewer.commands()):
            try:
                asked = self.guide.send(state)
            except StopIteration:
                asked = None
            if asked:
                self.viewer.send(asked[0], **asked[1])
                return []
        return super().finished(seconds)


def numbers(*names):
    return [ELEMENTS.index(name) for name in names]


def until(condition):
    """Waits for a state, not for ever; returns it."""
    for _ in range(2000):
        state = yield
        if condition(state):
            return state
    raise AssertionError(f"{state.status}, round {state.round and state.round.number}, {state.decisions}")


def guided(path, oracle, guide, jobs=1):
    return drive(path, Guided(path, oracle, guide, jobs))


def events(path):
    with RunFile(path) as file:
        return file.events()


def test_a_pinned_model_stays_and_is_part_of_every_candidate(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": numbers("ball")}

    path = new_run(tmp_path)
    pool = Guided(path, needs("wall"), guide())
    state = drive(path, pool)
    assert set(state.environment) == {"wall", "ball"}
    assert state.minimal
    assert state.reason.endswith("; 1 pinned model was never left out")
    leg = next(event.id for event in events(path) if event.kind == "leg_started")
    started = [event.data["test"] for event in events(path) if event.kind == "test_started" and event.id > leg]
    with RunFile(path) as file:
        journal = Journal(file)
    assert all("ball" in journal.keep_of_test(test) for test in started)
    assert [one.kind for one in state.decisions] == ["pin"]


def test_what_is_unpinned_can_go_again(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": numbers("ball", "beam")}
        yield from until(lambda state: state.round.split.pinned)
        yield "unpin", {"models": numbers("ball")}

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert set(state.environment) == {"wall", "beam"}


def test_all_pinned_is_the_end(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": list(range(len(ELEMENTS)))}

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert state.environment == ELEMENTS
    assert state.minimal


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_selection_by_hand_is_tested_and_adopted(tmp_path, jobs):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pause", {}
        yield "try", {"models": numbers("ball", "beam")}
        yield "try", {"models": numbers("wall", "beam")}
        # They are tested while the rounds are paused.
        state = yield from until(lambda state: len(state.trials) == 2 and all(one.verdict for one in state.trials))
        assert state.status == "paused"
        assert [trial.verdict for trial in state.trials] == ["dissimilar", "similar"]
        yield "adopt", {"trial": 1}
        state = yield from until(lambda state: state.refusal[1])
        assert "did not show f" in state.refusal[1]
        yield "adopt", {"trial": 2}
        state = yield from until(lambda state: state.here.how == "adopted")
        assert set(state.environment) == {"wall", "beam"}
        yield "resume", {}

    state = guided(new_run(tmp_path, iterations=3), needs("wall"), guide(), jobs)
    assert state.environment == ("wall",)
    assert state.minimal
    assert state.trials[1].adopted
    assert len(state.trials[0].tests) == 4
    *_, adopted, last = state.nodes
    assert (adopted.how, last.how, last.parent) == ("adopted", "reduced", adopted.number)


def test_no_test_is_made_twice_for_a_trial(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "try", {"models": numbers("wall", "beam")}

    path = new_run(tmp_path)
    pool = Guided(path, needs("wall", "beam"), guide(), 2)
    state = drive(path, pool)
    assert set(state.environment) == {"wall", "beam"}
    assert len(pool.made) == len(set(pool.made))


def test_another_failure_is_taken_for_as_good(tmp_path):
    def oracle(keep, _):
        # Without the beam the robot gets stuck elsewhere.
        return "similar" if {"wall", "beam"} <= keep else "other" if "wall" in keep else "pass"

    def guide():
        state = yield from until(lambda state: any(test.outcome == "other" for test in state.tests))
        test = next(test for test in state.tests if test.outcome == "other")
        yield "pause", {}
        yield "accept_other", {"test": test.id}
        state = yield from until(lambda state: len(state.failures) == 2)
        assert not any(test.outcome == "other" for test in state.tests)
        assert state.here.how == "accepted"
        yield "resume", {}

    state = guided(new_run(tmp_path), oracle, guide())
    assert state.environment == ("wall",)
    assert state.minimal


def test_another_failure_is_reduced_in_a_branch_and_f_is_f_again_outside_of_it(tmp_path):
    def oracle(keep, _):
        # Without the beam the robot gets stuck elsewhere.
        return "similar" if {"wall", "beam"} <= keep else "other" if "wall" in keep else "pass"

    def guide():
        state = yield from until(lambda state: any(test.outcome == "other" for test in state.tests))
        yield "pause", {}
        state = yield from until(lambda state: state.paused)
        met = atlas(state)[0]
        test = state.tests[met.smallest - 1]
        whole = [one.id for one in state.tests if one.phase == "baseline"]
        yield "pin", {"models": numbers("beam")}
        yield "accept_other", {"test": test.id, "instead": True}
        state = yield from until(lambda state: state.here.how == "instead")
        assert set(state.environment) == set(models_of(state, test)) > {"wall"}
        assert (state.here.parent, state.failures, state.f_position) == (test.node, (test.id,), test.end_pose[:3])
        # What was f is another failure here.
        assert {state.tests[one - 1].outcome for one in whole} == {"other"}
        assert not state.pinned
        branch = state.node
        yield "resume", {}
        state = yield from until(lambda state: state.nodes[branch].number != state.node and state.here.parent == branch)
        assert "beam" not in state.environment
        yield "go_back", {"node": 0}
        state = yield from until(lambda state: state.node == 0)
        assert state.failures == (state.baseline.failure_test,)
        assert {state.tests[one - 1].outcome for one in whole} == {"similar"}
        yield "go_back", {"node": branch}
        state = yield from until(lambda state: state.node == branch)
        assert state.failures == (test.id,)
        yield "resume", {}

    path = new_run(tmp_path)
    pool = Guided(path, oracle, guide(), 2)
    state = drive(path, pool)
    assert set(state.environment) == {"wall"}
    assert state.minimal
    assert len(pool.made) == len(set(pool.made))


def test_a_branch_has_to_keep_the_rate_of_its_own_failure_where_it_begins(tmp_path):
    def oracle(keep, seed):
        luck = random.Random(f"{sorted(keep)} {seed}").random()
        if {"wall", "beam"} <= keep:
            return "similar"
        return "other" if "wall" in keep and luck < 0.8 else "pass"

    def guide():
        state = yield from until(lambda state: any(test.outcome == "other" for test in state.tests))
        other = next(test.id for test in state.tests if test.outcome == "other")
        yield "accept_other", {"test": other, "instead": True}

    path = new_run(tmp_path, accept_rate="kept", growth="steady", skip="implied", baseline_runs=10, keep_rate=0.8)
    state = drive(path, Guided(path, oracle, guide(), 2))
    assert (state.environment, state.minimal) == (("wall",), True)
    assert meaning(state.certificate.claims[0], state.certificate) == "keeps 80 % of the rate where its branch begins"
    # The whole world never showed it.
    assert not any(test.outcome == "similar" for test in state.tests if test.phase == "baseline")


def test_an_undone_reduction_is_not_made_again(tmp_path):
    def guide():
        state = yield from until(lambda state: len(state.nodes) == 2)
        first.append(frozenset(state.environment))
        yield "undo", {}

    first = []
    path = new_run(tmp_path)
    state = guided(path, needs("wall"), guide())
    assert state.nodes[1].rejected
    assert (state.nodes[2].parent, state.nodes[2].rejected) == (0, False)
    later = [frozenset(node.environment) for node in state.nodes[2:]]
    assert later
    assert first[0] not in later
    assert "wall" in state.environment


def test_what_was_undone_is_called_so_and_can_be_allowed_again(tmp_path):
    def guide():
        yield from until(lambda state: len(state.nodes) == 2)
        yield "undo", {}
        state = yield from until(lambda state: state.round is not None and undone_in(state))
        candidate = undone_in(state)[0]
        seen.append(candidate.verdict)
        yield "unveto", {"round": state.round.number, "candidate": candidate.index}

    def undone_in(state):
        gone = state.nodes[1].environment
        return [
            one for one in state.round.untried + tuple(state.round.candidates) if one.verdict and one.models == gone
        ]

    seen = []
    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert seen == ["undone"]
    assert state.decisions[-1].kind == "unveto" and state.decisions[-1].words.startswith("allowed part ")
    assert state.environment == ("wall",)


def test_an_end_above_a_smaller_environment_that_showed_f_says_so(tmp_path):
    def guide():
        state = yield from until(lambda state: state.status == "running" and len(state.environment) == 1)
        assert state.environment == ("wall",)
        yield "undo", {}

    # The wall fails alone, as its undone reduction showed; otherwise only in pairs.
    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert len(state.environment) > 1
    said = smaller_known(state)
    undone = next(node for node in state.nodes if node.rejected)
    assert said == f"a smaller environment is known to show f: 1 model (#{undone.number} in the history, taken back)"
    assert said in ended(state)
    assert smaller_known(drive(new_run(tmp_path), FakePool(needs("wall"), 1))) == ""


def test_from_any_reduction_there_is_a_branch_and_nothing_is_lost(tmp_path):
    def guide():
        yield from until(lambda state: len(state.nodes) == 3)
        yield "go_back", {"node": 1}
        state = yield from until(lambda state: state.node == 1)
        assert state.paused
        yield "pin", {"models": numbers(state.environment[0])}
        yield "change", {"settings": {"pair": "timeseg/random", "iterations": 2}}
        yield "resume", {}

    path = new_run(tmp_path)
    state = guided(path, needs("wall", "beam"), guide())
    assert state.nodes[2].environment
    assert state.nodes[3].parent == 1
    assert state.nodes[3].method.endswith("timeseg/random")
    assert state.scenario["reduction"]["iterations"] == 2
    assert {"wall", "beam"} <= set(state.environment)
    assert [one.kind for one in state.decisions] == ["go_back", "pin", "change"]


def test_a_finished_run_can_be_taken_up_again(tmp_path):
    path = new_run(tmp_path)
    assert drive(path, FakePool(needs("wall"), 1)).environment == ("wall",)
    with RunFile(path) as viewer:
        viewer.send("undo")
    state = drive(path, FakePool(needs("wall"), 1))
    assert state.status == "finished"
    assert "wall" in state.environment
    assert len(state.decisions) == 1


def test_a_budget_stops_the_run_and_more_of_it_goes_on(tmp_path):
    path = new_run(tmp_path, budget=5)
    with pytest.raises(Stopped, match="the budget of 5 tests is used up"):
        drive(path, FakePool(needs("wall"), 2))
    assert fold(events(path)).tests_done == 5
    with RunFile(path) as viewer:
        viewer.send("change", settings={"budget": 500})
    assert drive(path, FakePool(needs("wall"), 2)).minimal


def test_a_veto_is_taken_back(tmp_path):
    def guide():
        state = yield from until(lambda state: state.round is not None and len(state.round.candidates) > 3)
        # The first two: that one is passed over when it is wanted again.
        for candidate in (0, 1):
            yield "veto", {"round": state.round.number, "candidate": candidate}
        yield from until(lambda now: now.round.candidates[1].verdict == "vetoed")
        for candidate in (0, 1):
            yield "unveto", {"round": state.round.number, "candidate": candidate}

    path = new_run(tmp_path)
    undisturbed = drive(new_run(tmp_path), FakePool(needs("wall"), 1))
    state = guided(path, needs("wall"), guide())
    assert state.environment == undisturbed.environment
    assert state.minimal
    assert {one.kind for one in state.decisions} == {"veto", "unveto"}


def test_a_veto_of_an_earlier_round_is_taken_back(tmp_path):
    def guide():
        state = yield from until(lambda state: state.round is not None and state.round.n_partitions == 3)
        for one in state.round.candidates:
            if "ball" not in one.models:
                yield "veto", {"round": state.round.number, "candidate": one.index}
        state = yield from until(
            lambda now: (
                now.round.number > state.round.number and any(c.verdict == "vetoed" for c in now.round.candidates)
            )
        )
        one = next(one for one in state.round.candidates if one.verdict == "vetoed")
        yield "unveto", {"round": state.round.number, "candidate": one.index}

    path = new_run(tmp_path)
    state = guided(path, needs("wall", "beam"), guide())
    assert {"wall", "beam"} <= set(state.environment)
    assert state.status == "finished"


@pytest.mark.parametrize(
    ("kind", "data", "why"),
    [
        ("pin", {"models": [99]}, "no such models"),
        ("pin", {"models": "wall"}, "no such models"),
        ("unpin", {"models": [0]}, "not pinned"),
        ("try", {"models": list(range(6))}, "the current environment"),
        ("try", {"models": [True]}, "no such models"),
        ("adopt", {"trial": 1}, "no such try"),
        ("accept_other", {"test": 1}, "did not end in another failure"),
        ("accept_other", {"test": -1}, "no such test"),
        ("undo", {}, "no reduction"),
        ("go_back", {"node": 7}, "no such place"),
        ("go_back", {"node": 0}, "there already"),
        ("change", {"settings": {"seed": 3}}, "only pair"),
        ("change", {"settings": {"pair": "timesg/random"}}, "no partitioning 'timesg'"),
        ("change", {"settings": {"algorithm": "x"}}, "no algorithm 'x'"),
        ("change", {"settings": {"iterations": -1}}, "iterations"),
        ("change", {"settings": {"iterations": 1}}, "already"),
        ("unveto", {"round": 1, "candidate": 0}, "neither vetoed, rejected nor undone"),
        ("unveto", {"round": 9, "candidate": 0}, "round is over"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(tmp_path, kind, data, why):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield kind, data

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert state.minimal
    assert state.refusal[0] == 1
    assert why in state.refusal[1]
    assert not state.decisions


# Any commands at any moment, and a kill at any event.
COMMANDS = st.one_of(
    st.tuples(
        st.sampled_from(["pin", "unpin", "try"]),
        st.fixed_dictionaries({"models": st.lists(st.integers(0, 5), min_size=1, max_size=4)}),
    ),
    st.tuples(st.just("adopt"), st.fixed_dictionaries({"trial": st.integers(1, 3)})),
    st.tuples(st.just("accept_other"), st.fixed_dictionaries({"test": st.integers(1, 40), "instead": st.booleans()})),
    st.tuples(st.just("undo"), st.just({})),
    st.tuples(st.just("go_back"), st.fixed_dictionaries({"node": st.integers(0, 4)})),
    st.tuples(
        st.just("change"),
        st.fixed_dictionaries(
            {
                "settings": st.fixed_dictionaries(
                    {},
                    optional={
                        "pair": st.sampled_from(["learner/timestep", "timeseg/random", "model2model/sequential"]),
                        "iterations": st.integers(0, 2),
                        "algorithm": st.sampled_from(["ddmin", "splitting", "ddenv"]),
                    },
                )
            }
        ),
    ),
    st.tuples(
        st.sampled_from(["veto", "unveto"]),
        st.fixed_dictionaries({"round": st.integers(1, 6), "candidate": st.integers(0, 5)}),
    ),
)


class Disturbed(FakePool):
    """Sends each command after so many tests; whatever pauses the run, it is resumed."""

    def __init__(self, path, oracle, jobs, plan, seed=0):
        super().__init__(oracle, jobs, seed)
        self.viewer, self.plan = RunFile(path), plan

    def finished(self, seconds):
        if self.plan and self.plan[0][0] <= len(self.made):
            _, (kind, data) = self.plan.pop(0)
            self.viewer.send(kind, **data)
            self.viewer.send("resume")
        return super().finished(seconds)


@given(
    salt=st.integers(0, 3),
    plan=st.lists(st.tuples(st.integers(3, 30), COMMANDS), max_size=6),
    moments=st.lists(st.integers(5, 80), max_size=2),
    jobs=st.integers(1, 3),
)
@examples(0.25)
def test_whatever_is_decided_and_whenever_it_is_killed_the_run_ends_sound(salt, plan, moments, jobs):
    with tempfile.TemporaryDirectory() as folder:
        path, oracle, plan = new_run(Path(folder)), flaky(salt, "wall", "beam"), sorted(plan, key=lambda one: one[0])
        for moment in moments:
            try:
                drive(
                    path,
                    Disturbed(path, oracle, jobs, plan, moment),
                    prepare=lambda file, after=moment: _kill(file, after),
                )
            except Killed:
                continue
            break
        state = drive(path, Disturbed(path, oracle, jobs, plan))
        assert state.status == "finished"
        # Whoever folds the file sees the same.
        assert fold(events(path)) == state
        assert state.pinned <= set(state.environment) or any(one.kind == "go_back" for one in state.decisions)
        finished = _finished(path)
        assert len(finished) == len(set(finished))
        for node in state.nodes[1:]:
            assert node.parent < node.number
            # Another failure counts below where it was accepted.
            assert state.tests[node.evidence_test - 1].outcome in ("similar", "other")
        assert state.tests[state.evidence_test - 1].outcome == "similar"
