"""An engine that is killed at a moment, and what is to be the same when another one goes on."""

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile


class Killed(Exception):
    pass


def kill_after(file, after):
    """The next `after` events are written; then the engine is gone."""
    append, count = file.append, [0]

    def limited(*values):
        count[0] += 1
        if count[0] > after:
            raise Killed
        return append(*values)

    file.append = limited


def finished_tests(path):
    """Each finished test as (environment, run)."""
    with RunFile(path) as file:
        state = fold(file.events())
        return [(test.environment, test.run) for test in state.finished_tests]


def story(state):
    """What a run's rounds came to: all that must not depend on who worked on it."""
    return state.environment, state.minimal, state.rounds_done, [point.models for point in state.history]


def models_in(state, test):
    """The models in the world of a test, given by its number."""
    return frozenset(state.models_of(state.tests[test - 1]))
