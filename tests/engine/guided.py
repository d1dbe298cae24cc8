"""A user who guides a reduction: on a simulator that costs nothing."""

import pytest
from hypothesis import strategies as st

from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from tests.engine.fake import ELEMENTS, FakePool, drive


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Nobody waits for the user to come to rest."""
    monkeypatch.setattr("ddenv.engine.control.SETTLE", 0.0)
    monkeypatch.setattr("ddenv.engine.scheduler.WAIT", 0.0)


class Guided(FakePool):
    """`guide` is a generator: it is sent the state at each look around, and yields commands as
    (kind, data), or None to wait.
    """

    def __init__(self, path, oracle, guide, jobs=1):
        super().__init__(oracle, jobs)
        self.viewer, self.state = RunFile(path), RunState()
        self.guide = guide
        # The first value stands for nothing: the guide reads on from there.
        assert next(guide) is None

    def finished(self, seconds):
        self.state = state = fold(self.viewer.events(self.state.revision), self.state)
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
    raise AssertionError(
        f"{state.status}, round {state.round and state.round.number}, {state.decisions}"
    )


def guided(path, oracle, guide, jobs=1):
    return drive(path, Guided(path, oracle, guide, jobs))


# Any commands at any moment, and a kill at any event.
COMMANDS = st.one_of(
    st.tuples(
        st.sampled_from(["pin", "unpin", "try"]),
        st.fixed_dictionaries({"models": st.lists(st.integers(0, 5), min_size=1, max_size=4)}),
    ),
    st.tuples(st.just("adopt"), st.fixed_dictionaries({"trial": st.integers(1, 3)})),
    st.tuples(
        st.just("accept_other"),
        st.fixed_dictionaries({"test": st.integers(1, 40), "instead": st.booleans()}),
    ),
    st.tuples(st.just("undo"), st.just({})),
    st.tuples(st.just("go_back"), st.fixed_dictionaries({"node": st.integers(0, 4)})),
    st.tuples(
        st.just("change"),
        st.fixed_dictionaries(
            {
                "settings": st.fixed_dictionaries(
                    {},
                    optional={
                        "pair": st.sampled_from(
                            ["learner/timestep", "timeseg/random", "model2model/sequential"]
                        ),
                        "iterations": st.integers(0, 2),
                        "algorithm": st.sampled_from(["ddmin", "splitting", "ddenv"]),
                        "accept_rate": st.sampled_from(["first", "kept", "exact"]),
                        "exact_seeds": st.integers(1, 3),
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
