"""What is in a run file, and what a viewer writes into it."""

from dataclasses import asdict

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile


def events(path):
    with RunFile(path) as file:
        return file.events()


def state_of(path):
    return fold(events(path))


def told(path, *kinds):
    """The data of all events of these kinds."""
    return [asdict(one.event) for one in events(path) if one.kind in kinds]


def send(path, kind, **data):
    """The user's command."""
    with RunFile(path) as viewer:
        return viewer.send(kind, **data)


def models_in(state, test):
    """The models in the world of a test, given by its number."""
    return frozenset(state.models_of(state.tests[test - 1]))
