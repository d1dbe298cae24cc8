"""Branches: other failures, what was undone, and earlier environments, in a reduction that the user
guides.
"""

import random

from ddenv.runfile.failures import atlas
from ddenv.words.claims import ended, meaning, smaller_known
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.guided import Guided, at_once, guided, numbers, until  # noqa: F401
from tests.engine.oracles import needs


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
        assert set(state.environment) == set(state.models_of(test)) > {"wall"}
        assert (state.here.parent, state.failures, state.f_position) == (
            test.node,
            (test.id,),
            test.end_pose[:3],
        )
        # What was f is another failure here.
        assert {state.tests[one - 1].outcome for one in whole} == {"other"}
        assert not state.pinned
        branch = state.node
        yield "resume", {}
        state = yield from until(
            lambda state: state.nodes[branch].number != state.node and state.here.parent == branch
        )
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

    path = new_run(
        tmp_path,
        accept_rate="kept",
        growth="steady",
        skip="implied",
        baseline_runs=10,
        keep_rate=0.8,
    )
    state = drive(path, Guided(path, oracle, guide(), 2))
    assert (state.environment, state.minimal) == (("wall",), True)
    assert (
        meaning(state.certificate.claims[0], state.certificate)
        == "keeps at least 66 % of the rate at the start of its branch"
    )
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
        return [one for one in tuple(state.round.candidates) if one.verdict and one.models == gone]

    seen = []
    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert seen == ["undone"]
    assert state.decisions[-1].kind == "unveto" and state.decisions[-1].words.startswith(
        "allowed part "
    )
    assert state.environment == ("wall",)


def test_an_end_above_a_smaller_environment_that_showed_f_says_so(tmp_path):
    def guide():
        state = yield from until(
            lambda state: state.status == "running" and len(state.environment) == 1
        )
        assert state.environment == ("wall",)
        yield "undo", {}

    # The wall fails alone, as its undone reduction showed; otherwise only in pairs.
    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert len(state.environment) > 1
    said = smaller_known(state)
    undone = next(node for node in state.nodes if node.rejected)
    assert said == (
        f"a smaller environment is known to show f: 1 model (#{undone.number} in the history, "
        "taken back)"
    )
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
