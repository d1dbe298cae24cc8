"""One world, many runs: how they end, who may listen, and that no run leaves a trace; also in
smaller plants for what is left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ddenv.engine.mcap_file import Streams
from ddenv.errors import UserError
from ddenv.robot.simulation import plant_cache
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.runs.experiment import load_parts
from ddenv.world.load import SCENARIOS, load_scenario
from ddenv.world.model import Box, Model, Sphere, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario
from tests.robot.conftest import all_bits, cube, joint_of, link_of, model_of
from tests.tiers import slow

NOTHING = frozenset()


def same(a, b) -> bool:
    return (
        a.outcome == b.outcome
        and a.failure == b.failure
        and a.trajectory.tobytes() == b.trajectory.tobytes()
    )


def test_reaches_its_goal_on_flat_ground(world_of, husky, scenario_of):
    result = Plant(world_of(), husky, scenario_of()).run(NOTHING, seed=1)
    assert (result.outcome, result.failure) == ("pass", "")
    x, y, z, *_ = result.end_pose
    assert np.hypot(x - 3.0, y) <= 0.5
    # It stands on its wheels: their axes are 0.0328 m above the model's frame, and the tyres sink
    # in by little.
    assert z == pytest.approx(0.1651 - 0.0328, abs=0.005)
    assert result.simulated_seconds == result.trajectory[-1, 0]
    # 2.5 m at up to 1 m/s, with 1 m/s^2 at the start.
    assert 2.5 < result.simulated_seconds < 4.0
    assert result.motions == {}


def test_trajectory_has_a_row_each_tenth_of_a_second_and_one_at_the_end(
    world_of, husky, scenario_of
):
    scenario = scenario_of(failure={"timeout": 1.23}, controller={"period": 0.03})
    trajectory = Plant(world_of(), husky, scenario).run(NOTHING, seed=1).trajectory
    assert trajectory.dtype == np.float64
    assert trajectory[:, 0] == pytest.approx([*np.arange(13) * 0.1, 1.23])
    assert trajectory[0, 1:4] == pytest.approx([0, 0, 0.14])
    assert np.linalg.norm(trajectory[:, 4:], axis=1) == pytest.approx(np.ones(14))


def test_starts_where_the_scenario_says(world_of, husky, scenario_of):
    spawn = {"x": 1.5, "y": -2.0, "z": 0.14, "yaw": 1.0}
    scenario = scenario_of(robot={"model": "husky.sdf", "spawn": spawn}, failure={"timeout": 0.1})
    start = Plant(world_of(), husky, scenario).run(NOTHING, seed=1).trajectory[0]
    assert start[1:] == pytest.approx([1.5, -2.0, 0.14, np.cos(0.5), 0, 0, np.sin(0.5)])


def test_a_robot_with_a_pose_of_its_own_starts_where_the_scenario_says(
    world_of, husky, scenario_of
):
    at = Pose.from_rpy(1.0, 2.0, 3.0, 0.0, 0.0, 0.5)
    links = tuple(replace(link, pose=at @ link.pose) for link in husky.links)
    joints = tuple(
        replace(joint, pose=at @ joint.pose, axis=tuple(at.rotate(joint.axis)))
        for joint in husky.joints
    )
    posed = replace(husky, pose=at @ husky.pose, links=links, joints=joints)
    starts = [
        Plant(world_of(), robot, scenario_of(failure={"timeout": 0.2}))
        .run(NOTHING, seed=1)
        .trajectory[0, 1:]
        for robot in (husky, posed)
    ]
    assert starts[1] == pytest.approx(starts[0], abs=1e-9)


def test_protected_models_and_the_ground_stay(world_of, husky, scenario_of, box):
    template = Plant(
        world_of(box("wall", "1.5 0 0.5 0 0 0", "0.2 4 1")), husky, scenario_of(protected=("wall",))
    )
    assert same(template.run(NOTHING, seed=1), template.run(frozenset({"wall", "ground"}), seed=1))
    assert template.run(NOTHING, seed=1).failure == "stuck"


def test_what_others_depend_on_stays(world_of, husky, scenario_of, box):
    world = world_of(
        box("wall", "1.5 0 0.5 0 0 0", "0.2 4 1"), box("lamp", "0 9 0.5 0 0 0", "1 1 1")
    )
    anchored = Plant(replace(world, anchors=frozenset({"wall"})), husky, scenario_of())
    assert anchored.run(NOTHING, seed=1).failure == "stuck"
    tied = Plant(
        replace(world, anchors=frozenset({"lamp"}), ties=(("lamp", "wall"),)), husky, scenario_of()
    )
    assert tied.run(NOTHING, seed=1).failure == "stuck"


def test_falls_out_of_a_world_without_ground(world_of, husky, scenario_of, box):
    world = world_of(box("table", "0 0 -0.5 0 0 0", "3 3 1"), ground=False)
    result = Plant(world, husky, scenario_of(goal={"x": 50, "y": 0})).run(
        frozenset({"table"}), seed=1
    )
    assert (result.outcome, result.failure) == ("failed", "fell")
    assert result.end_pose[2] < -3.0
    assert result.simulated_seconds < 10.0


def test_unknown_models_are_refused(world_of, husky, scenario_of):
    with pytest.raises(ValueError, match="no such model: wal"):
        Plant(world_of(), husky, scenario_of()).run(frozenset({"wal"}), seed=1)


def test_progress_gets_every_row_and_the_models_that_can_move(world_of, husky, scenario_of, box):
    world = world_of(
        box("ball", "2 0 0.2 0 0 0", "0.4 0.4 0.4", mass=5.0), box("wall", "9 0 1 0 0 0", "1 1 2")
    )
    rows, places = [], []

    def hear(time_s: float, pose: tuple[float, ...], models: dict) -> None:
        rows.append((time_s, *pose))
        places.append(models)

    template = Plant(world, husky, scenario_of(failure={"timeout": 6.0}))
    result = template.run(frozenset({"ball", "wall"}), 1, hear)
    assert np.array(rows).tobytes() == result.trajectory.tobytes()
    assert {name for models in places for name in models} == {"ball"}
    assert (
        np.array([models["ball"] for models in places]).tobytes()
        == result.motions["ball"][:, 1:].tobytes()
    )


def test_numbers_that_are_not_finite_are_an_error_and_leave_no_trace(world_of, husky, scenario_of):
    template = Plant(world_of(), husky, scenario_of())
    before = template.run(NOTHING, seed=1)

    def poison(time_s: float, *_: object) -> None:
        if time_s > 0.45:
            state = template.context.plant_context.get_mutable_discrete_state_vector()
            state.SetFromVector(np.full(state.size(), np.nan))

    broken = template.run(NOTHING, 1, poison)
    assert (broken.outcome, broken.failure) == ("error", "not-finite")
    assert np.isfinite(broken.trajectory).all()
    assert same(template.run(NOTHING, seed=1), before)


def test_what_breaks_in_progress_is_the_callers(world_of, husky, scenario_of, box):
    template = Plant(world_of(box("wall", "1.5 0 0.5 0 0 0", "0.2 4 1")), husky, scenario_of())
    wall = frozenset({"wall"})
    before = template.run(wall, seed=1)

    def leave(*_: object) -> None:
        raise KeyError("gone")

    with pytest.raises(KeyError, match="gone"):
        template.run(NOTHING, 1, leave)
    # The wall, which that run had removed, is back.
    assert same(template.run(wall, seed=1), before)


def test_a_world_drake_cannot_simulate_is_the_users(world_of, add, husky, scenario_of):
    ghost = replace(
        model_of("ghost", link_of("link", Sphere(0.5), Pose((2.0, 2.0, 0.5)), mass=None)),
        static=False,
    )
    heavy = link_of("link", Sphere(0.5), Pose((2.0, 2.0, 0.5)))
    heavy = model_of(
        "heavy", replace(heavy, inertia=replace(heavy.inertia, moments=(1.0, 1.0, 9.0)))
    )
    links = [link_of(name, Sphere(0.1), Pose((float(x), 3.0, 1.0))) for x, name in enumerate("abc")]
    pairs = (("a", "b"), ("b", "c"), ("a", "c"))
    loop = model_of(
        "loop", *links, joints=tuple(joint_of("ball", *pair, (0.0, 3.0, 1.0)) for pair in pairs)
    )
    for model, complaint in ((ghost, r"ghost.*no <inertial>"), (heavy, ""), (loop, "")):
        with pytest.raises(UserError, match=f"cannot be simulated.*{complaint}"):
            Plant(add(world_of(), model), husky, scenario_of())


def test_a_listener_hears_every_step_and_changes_no_bit(world_of, husky, scenario_of):
    template = Plant(world_of(), husky, scenario_of(failure={"timeout": 1.0}))
    streams = Streams()
    quiet, heard = template.run(frozenset(), 3), template.run(frozenset(), 3, listener=streams)
    assert heard.trajectory.tobytes() == quiet.trajectory.tobytes()
    times = [reading.time for reading, _ in streams.heard]
    assert times == sorted(times) and times[0] == 0.0
    assert len(times) * streams.setup.period >= quiet.simulated_seconds
    # A run that is made again is heard from its start.
    template.run(frozenset(), 3, listener=streams)
    assert [reading.time for reading, _ in streams.heard] == times


ALL = frozenset({"a", "b", "c", "d"})


@pytest.fixture
def built(monkeypatch) -> list[frozenset[str]]:
    """The moving models that are left out of each smaller plant which is built. Building is so
    cheap that it always pays.
    """
    monkeypatch.setattr(plant_cache, "BUILD", 0.0)
    monkeypatch.setattr(plant_cache, "PAIR", 0.0)
    reported: list[frozenset[str]] = []
    without = Plant.without

    def tell(self: Plant, names: frozenset[str]) -> Plant:
        smaller = without(self, names)
        reported.append(ALL - smaller.names)
        return smaller

    monkeypatch.setattr(Plant, "without", tell)
    return reported


@pytest.fixture
def cubes(world_of, add) -> World:
    """A cube in the robot's way, a pile of two that falls beside it, a cube far away."""
    return add(
        world_of(), cube("a", 1.2, 0), cube("b", 1, 3), cube("c", 1, 3.1, 0.5), cube("d", 5, -9)
    )


@pytest.fixture
def scenario(scenario_of) -> Scenario:
    return scenario_of(failure={"timeout": 4.0}, goal={"x": 9, "y": 0})


def rubble() -> tuple[World, Model, Scenario]:
    scenario = load_scenario(SCENARIOS / "rubble.yaml")
    short = scenario.model_copy(
        update={"failure": scenario.failure.model_copy(update={"timeout": 6.0})}
    )
    return *load_parts(scenario), short


@pytest.mark.rates
def test_parts_of_the_rubble_give_the_same_bits_as_in_the_plant_of_all_of_it_in_any_order():
    world, robot, scenario = rubble()
    names = world.elements()
    parts = [frozenset(part) for part in (names[:11], names[:6] + names[16:21], names[::6])]
    whole = Plant(world, robot, scenario)
    expected = [all_bits(whole.run(part, seed=2)) for part in parts]
    touched = {name for *_, (_, first_touched) in expected for name in first_touched}
    # That plant does not know what takes part, so it has times of scans that nobody read, too.
    times = [sensed for *_, (sensed, _) in expected]
    assert touched & whole.removable
    smaller = PlantCache(world, robot, scenario)
    for number in (2, 0, 1, 2, 0):
        *run, (sensed, first_touched) = all_bits(smaller.run(parts[number], seed=2))
        assert sensed.items() <= times[number].items()
        assert (*run, (times[number], first_touched)) == expected[number]


@pytest.mark.rates
def test_a_script_is_not_played_where_something_static_is_gone_of_a_model_that_was_left_out(
    world_of, add, husky, scenario
):
    """The frame of a door holds a cube up: with the door the cube falls less far."""
    frame = link_of("frame", Box((1.0, 1.0, 0.5)), Pose((1.0, 4.0, 0.25)), mass=5.0)
    leaf = link_of("leaf", Box((0.1, 0.1, 0.1)), Pose((1.0, 6.0, 1.0)))
    joints = (
        joint_of("fixed", "world", "frame", (1.0, 4.0, 0.0)),
        joint_of("revolute", "world", "leaf", (1.0, 6.0, 1.0)),
    )
    world = add(world_of(), model_of("a", frame, leaf, joints=joints), cube("b", 1.0, 4.0, 0.8))
    smaller = PlantCache(world, husky, scenario)
    for keep, height in (({"b"}, 0.15), ({"a", "b"}, 0.65), ({"b"}, 0.15)):
        rows = smaller.run(frozenset(keep), 1).motions["b"]
        assert rows[-1, 3] == pytest.approx(height, abs=0.005)


@pytest.mark.rates
def test_a_plant_is_built_once_while_it_is_asked_for(cubes, husky, scenario, built, monkeypatch):
    smaller = PlantCache(cubes, husky, scenario)
    for seed in range(3):
        smaller.run(ALL, seed)
        smaller.run(ALL - {"a"}, seed)
    assert built == [{"a"}]
    # Those that were used last are held.
    monkeypatch.setattr(plant_cache, "MOST", 2)
    for left_out in ("b", "a", "c", "a", "b"):
        smaller.run(ALL - {left_out}, 1)
    assert built == [{"a"}, {"b"}, {"c"}, {"b"}]


TOO_DEAR = {"BUILD": 1.0, "PAIR": 1.0, "LARGEST": 3, "HELD": 0.0}


@pytest.mark.parametrize("limit", slow(pytest.mark.rates, TOO_DEAR, but=["LARGEST"]))
def test_no_plant_is_built_that_costs_more_than_it_saves(
    cubes, husky, scenario, built, monkeypatch, limit
):
    monkeypatch.setattr(plant_cache, limit, TOO_DEAR[limit])
    result = PlantCache(cubes, husky, scenario).run(ALL - {"d"}, 1)
    assert not built
    assert all_bits(result) == all_bits(Plant(cubes, husky, scenario).run(ALL - {"d"}, 1))


def test_what_is_protected_stays(cubes, husky, scenario, built):
    protected = scenario.model_copy(update={"protected": ("a",)})
    result = PlantCache(cubes, husky, protected).run(frozenset({"b"}), 1)
    assert built == [{"c", "d"}]
    assert "a" in result.motions


def test_the_floor_is_that_of_the_whole_world(world_of, husky, scenario_of, box):
    """What is removed must not change when the robot has fallen out of the world."""
    cellar = box("a", "0 9 -20 0 0 0", "1 1 1", mass=1.0)
    world = world_of(box("table", "0 0 -0.5 0 0 0", "3 3 1"), cellar, ground=False)
    scenario = scenario_of(goal={"x": 50, "y": 0})
    table = frozenset({"table"})
    assert all_bits(PlantCache(world, husky, scenario).run(table, 1)) == all_bits(
        Plant(world, husky, scenario).run(table, 1)
    )
