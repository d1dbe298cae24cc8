"""An engine that is killed at a moment, and what is to be the same when another one goes on."""

from tests.engine.fake import drive
from tests.engine.reading import state_of


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
    return [(test.environment, test.run) for test in state_of(path).finished_tests]


def story(state):
    """What a run's rounds came to: all that must not depend on who worked on it."""
    return (
        state.environment,
        state.minimal,
        state.rounds_done,
        [point.models for point in state.history],
    )


def killed(path, pool, moments, **options):
    """One engine after another works on the run, each killed after so many events, until one comes
    to the end.
    """
    for moment in moments:
        pool.running.clear()
        try:
            return drive(
                path, pool, prepare=lambda file, after=moment: kill_after(file, after), **options
            )
        except Killed:
            pass
    return None


def resumed(path, pool):
    """The end of a run that may have been killed."""
    pool.running.clear()
    state = state_of(path)
    return state if state.status == "finished" else drive(path, pool)
