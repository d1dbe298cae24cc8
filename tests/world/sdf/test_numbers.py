"""The numbers of a world: each may be changed in its own text, all other bytes stay, and what
cannot be is said.
"""

import dataclasses

import pytest

from ddenv.errors import UserError
from ddenv.runs.experiment import load_parts
from ddenv.world.load import find_scenario, load_scenario
from ddenv.world.sdf.numbers import NotPossible, changed, check, chosen, numbers_of, part_of
from ddenv.world.sdf.read import parse_world
from tests.conftest import DATA

SHAPE = "<geometry><sphere><radius>0.5</radius></sphere></geometry>"
FRICTIONS = {
    "none": "",
    "surface": "<surface/>",
    "friction": "<surface> <friction></friction></surface>",
    "ode": "<surface><friction><ode><mu>1</mu></ode></friction></surface>",
    "both": "<surface><friction><ode><mu>1.0</mu><mu2>1</mu2></ode></friction></surface>",
    "bullet": "<surface><friction><bullet><friction>1</friction></bullet></friction></surface>",
}
WORLD = f"""<sdf version='1.9'><world name='w'>
<model name='ground'><static>1</static><link name='l'><collision name='c'><geometry><plane/></geometry></collision></link></model>
{
    "".join(
        f"<model name='{name}'><static>1</static><pose>{10 + 3 * place} 0 0.5 0 0 0</pose><link name='l'>"
        f"<collision name='c'>{SHAPE}{surface}</collision><visual name='v'>{SHAPE}</visual></link></model>"
        for place, (name, surface) in enumerate(FRICTIONS.items())
    )
}
<model name='ball'><pose degrees='true'>0 6 0.5 0 0 0</pose><link name='l'><inertial><mass>2</mass></inertial>
<collision name='c'>BODY</collision></link></model>
<model name='follower'><static>1</static><pose relative_to='both'>0 2 0 0 0 0</pose>
<link name='l'><collision name='c'>BODY</collision></link></model>
<state world_name='w'><model name='none'><pose>10 -1 0.5 0 0 0</pose>
<link name='l'><pose>10 -1 0.5 0 0 0</pose></link></model></state>
</world></sdf>""".replace("BODY", SHAPE)


@pytest.fixture(scope="module")
def parts():
    scenario = load_scenario(DATA / "wall.yaml")
    return scenario, parse_world(WORLD.encode(), DATA / "w.sdf"), load_parts(scenario)[1]


def test_each_number_of_a_world_can_be_changed_and_read_again(parts):
    scenario, world, robot = parts
    names = [model.name for model in world.models if model.name != "ground"]
    numbers = numbers_of(scenario, world, robot, names)
    assert {"ball.mass", "none.friction", "ode.radius", "follower.x", "spawn.yaw", "goal.x"} <= set(
        numbers
    )
    assert not [name for name in numbers if name.startswith(("ground.", "both.x", "lidar."))], (
        "an anchor stays"
    )
    for name, one in numbers.items():
        value = one.now + 0.37 * (one.high - one.now)
        there, after = changed(scenario, world, {name: value})
        found = numbers_of(there, after, robot, names)
        differ = [each for each in found if abs(found[each].now - numbers[each].now) > 1e-6]
        assert differ == [name]
        assert abs(found[name].now - value) < 1e-6 * max(1.0, abs(value))
        if there == scenario:
            # Every element keeps its place in the text: only words changed, or a friction is said
            # that was not.
            assert abs(len(after.text) - len(world.text)) < 90
            assert after.text[:40] == world.text[:40]


def test_only_what_is_asked_for_changes_in_the_text(parts):
    scenario, world, _ = parts
    _, after = changed(scenario, world, {"both.friction": 0.05})
    assert after.text == world.text.replace(
        b"<mu>1.0</mu><mu2>1</mu2>", b"<mu>0.05</mu><mu2>0.05</mu2>"
    )
    _, after = changed(scenario, world, {"surface.friction": 0.05})
    said = b"<surface><friction><ode><mu>0.05</mu><mu2>0.05</mu2></ode></friction></surface>"
    assert after.text == world.text.replace(b"<surface/>", said)
    # What is drawn changes with what is touched.
    _, after = changed(scenario, world, {"ode.radius": 0.25})
    assert after.text.count(b"<radius>0.25</radius>") == 2
    scenario_after, same = changed(scenario, world, {"controller.speed": 0.5})
    assert (scenario_after.controller.speed, same) == (0.5, world)


def test_a_part_has_what_is_kept_and_what_always_stays(parts):
    scenario, world, _ = parts
    _, part = part_of(scenario, world, frozenset({"ball", "ode"}), {"ball.y": 5.0})
    assert [model.name for model in part.models] == ["ground", "ode", "both", "ball"]


def test_values_that_are_not_possible_and_why(parts):
    scenario, world, robot = parts
    kept = frozenset({"ode", "friction", "ball", "none"})
    for name, value, why in (
        ("ode.x", 0.0, "the robot stands inside model 'ode' by"),
        ("ode.x", 16.5, "ode would be 0.50 m inside friction"),
        ("ball.z", 0.2, "ball would be 0.30 m inside ground"),
        ("controller.speed", -1.0, "greater than 0"),
        ("ball.mass", -1.0, "mass"),
    ):
        with pytest.raises(NotPossible, match=why.replace("(", r"\(")):
            check(scenario, world, robot, kept, {name: value})
    check(scenario, world, robot, kept, {"ode.z": 0.2})


def test_numbers_are_chosen_by_their_names(parts):
    scenario, world, robot = parts
    numbers = numbers_of(scenario, world, robot, ["ode", "bullet"])
    assert [one.name for one in chosen(numbers, ["*.y"])] == [
        "ode.y",
        "bullet.y",
        "spawn.y",
        "goal.y",
    ]
    assert chosen(numbers, []) == list(numbers.values())
    # Those that promise most come first.
    assert next(iter(numbers)) == "ode.friction"
    with pytest.raises(
        UserError,
        match=r"^--number: there is no number 'ode\.frictio' \(did you mean ode\.friction\?\)",
    ):
        chosen(numbers, ["*.x", "ode.frictio"])
    assert all(dataclasses.astuple(one) for one in numbers.values())


def test_options_of_an_own_controller_are_numbers_too():
    scenario = load_scenario(find_scenario("friction"))
    own = scenario.controller.model_copy(
        update={"use": "mine:Own", "options": {"gain": 2, "name": "a", "on": True}}
    )
    world, robot = load_parts(scenario)
    own_scenario = scenario.model_copy(update={"controller": own})
    numbers = numbers_of(own_scenario, world, robot, ["barrel_01"])
    assert [name for name in numbers if name.startswith("controller.")] == [
        "controller.speed",
        "controller.options.gain",
    ]
    after, _ = changed(own_scenario, world, {"controller.options.gain": 3.0})
    assert after.controller.options == {"gain": 3, "name": "a", "on": True}
