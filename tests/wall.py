"""The scenario of the small world."""

from ddenv.world.load import load_scenario
from ddenv.world.scenario import Scenario
from tests.conftest import DATA


def wall(**changed: object) -> Scenario:
    """With changes to its sections, given as dictionaries, and in place of its other values.
    Nothing is checked.
    """
    scenario = load_scenario(DATA / "wall.yaml")
    update = {
        name: getattr(scenario, name).model_copy(update=value) if isinstance(value, dict) else value
        for name, value in changed.items()
    }
    return scenario.model_copy(update=update)
