"""How fast the robot is simulated: scenarios or a world with everything on, beside bare `AdvanceTo`
on the same plant.

    python benchmarks/simulation.py [--seeds N] [--scenarios ditch,friction,rubble]
    python benchmarks/simulation.py --world WORLD --spawn X,Y,Z,YAW --goal X,Y [--seeds N]

Each scenario runs in its whole world, and in one with every second model removed. Everything on
means sensors, filter, controller, recording, and what the robot notices; where there is a lidar,
also that and the map it makes. Bare is `Simulator.AdvanceTo` in the same context with the same
wheel speeds at the same times, and nothing else. Loose models then never rest, so it is slower
where there are many. Seconds are CPU seconds of one core; the first run in a world, which works out
how loose piles settle, is left out.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.runs.experiment import load_parts, scenario_for_world
from ddenv.world.load import SCENARIOS, load_scenario
from ddenv.world.scenario import Scenario


@dataclass
class Recorder:
    """A drive that remembers the speeds it commanded."""

    drive: Any
    speeds: list[np.ndarray] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.drive, name)

    def wheel_speeds(self, *asked: Any) -> np.ndarray:
        self.speeds.append(self.drive.wheel_speeds(*asked))
        return self.speeds[-1]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--scenarios", default="ditch,friction,rubble")
    parser.add_argument("--world", type=Path)
    parser.add_argument(
        "--spawn", default="0,0,0.2,0", help="x, y, z m and yaw rad; with a world file"
    )
    parser.add_argument("--goal", default="5,0", help="x, y m; with a world file")
    arguments = parser.parse_args()
    print("| scenario | models | simulated s a second | bare AdvanceTo | ratio |")
    print("|---|---|---|---|---|")
    for name, scenario in scenarios(arguments):
        world, robot = load_parts(scenario)
        variants = PlantCache(world, robot, scenario)
        elements = world.elements()
        for kept in (elements, elements[::2]):
            print(
                row(variants._template(frozenset(kept)), name, frozenset(kept), arguments.seeds),
                flush=True,
            )


def scenarios(arguments: argparse.Namespace) -> Iterator[tuple[str, Scenario]]:
    if arguments.world is None:
        for name in arguments.scenarios.split(","):
            yield name, load_scenario(SCENARIOS / f"{name}.yaml")
        return
    x, y, z, yaw = map(float, arguments.spawn.split(","))
    goal_x, goal_y = map(float, arguments.goal.split(","))
    yield (
        arguments.world.stem,
        scenario_for_world(arguments.world, (x, y, z, yaw), (goal_x, goal_y)),
    )


def row(template: Plant, name: str, keep: frozenset[str], seeds: int) -> str:
    template.run(keep, 0)
    simulated = spent = bare_spent = 0.0
    drive = template._drive
    for seed in range(seeds):
        template._drive = recorder = Recorder(drive)
        seconds, result = cpu(lambda: template.run(keep, seed))  # noqa: B023
        template._drive = drive
        simulated, spent = simulated + result.simulated_seconds, spent + seconds
        bare_spent += bare(template, keep, recorder.speeds, result.simulated_seconds)
    speed, bare_speed = simulated / spent, simulated / bare_spent
    return f"| {name} | {len(keep)} | {speed:.0f} | {bare_speed:.0f} | {speed / bare_speed:.2f} |"


def bare(
    template: Plant, keep: frozenset[str], speeds: list[np.ndarray], simulated: float
) -> float:
    """CPU time (s) of simulating a run with these wheel speeds."""
    shared, period = template.context, template._clock.command_period
    built, present = shared.built, keep | template._always
    kept = [body for name, body in built.moving.items() if name in present]
    shared.presence.remove(template.names - present)
    shared.diagram_context.SetTime(0.0)
    sleep = Sleep(shared, kept, (), never=True)
    try:
        motors = built.plant.get_desired_state_input_port(built.robot.instance)
        simulator = Simulator(built.diagram, shared.diagram_context)

        def advance() -> None:
            for number, wheels in enumerate(speeds, start=1):
                motors.FixValue(
                    shared.plant_context, np.concatenate([np.zeros_like(wheels), wheels])
                )
                simulator.AdvanceTo(min(number * period, simulated))

        return cpu(advance)[0]
    finally:
        sleep.end()


def cpu(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU time of `work`, s, and its result."""
    started = time.process_time()
    result = work()
    return time.process_time() - started, result


if __name__ == "__main__":
    main()
