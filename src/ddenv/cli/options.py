"""Options that several commands share."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import click

JOBS = os.cpu_count() or 1
# What `ddenv.world.scenario.IGNORABLE` holds, which is too slow to import for every command.
IGNORABLE = ("heightmap", "image", "mesh", "include", "joint")


class Numbers(click.ParamType):
    """Comma-separated finite numbers, at least and at most so many."""

    def __init__(self, name: str, fewest: int, most: int) -> None:
        self.name, self.fewest, self.most = name, fewest, most

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        try:
            numbers = tuple(float(word) for word in value.split(","))
        except ValueError:
            numbers = ()
        if not self.fewest <= len(numbers) <= self.most or not all(map(math.isfinite, numbers)):
            self.fail(
                f"expected {self.name}, such as {','.join('1.5' for _ in range(self.most))}; found '{value}'",
                param,
                ctx,
            )
        return numbers


def scenario_options(command):
    """How a scenario is chosen and changed: shared by the commands that take one."""
    for option in reversed(
        (
            click.option(
                "--spawn", type=Numbers("x,y,z,yaw", 3, 4), help="Where the robot starts, m and rad (for an SDF world)."
            ),
            click.option("--goal", type=Numbers("x,y", 2, 2), help="Where it shall go, m (for an SDF world)."),
            click.option("--world", type=Path, help="Another SDF world in place of the scenario's."),
            click.option("--timeout", type=float, help="Simulated time the robot has, s."),
        )
    ):
        command = option(command)
    return command


def reading_options(command):
    """How the world's SDF is read where it names other files: shared by the commands that read one."""
    for option in reversed(
        (
            click.option(
                "--model-path", type=Path, multiple=True, help="A folder of models, searched first; may be repeated."
            ),
            click.option(
                "--stand-in",
                multiple=True,
                metavar="URI=SHAPE",
                help="A shape for what cannot be found there, such as model://barrel=cylinder:0.3,1.0; may be repeated.",
            ),
            click.option(
                "--ignore",
                multiple=True,
                type=click.Choice(IGNORABLE),
                help="Leave such elements out instead of refusing the file; may be repeated.",
            ),
        )
    ):
        command = option(command)
    return command


def method_options(command):
    """By which method one world is reduced, in place of what the scenario says."""
    for option in reversed(
        (
            click.option("--pair", help="Partitioning/prioritization, such as model2model/failure-proximal."),
            click.option("--algorithm", help="How the environment is searched; 'ddenv schemas' lists all."),
            click.option("--budget", type=click.IntRange(0), help="The most tests in all; 0: any number."),
            click.option("--seed", type=int, help="Seed of the first run; run i of each candidate uses seed + i."),
        )
    ):
        command = option(command)
    return command


def search_options(command):
    """How candidates are tried and judged, in place of what the scenario says: what is left out stays the scenario's."""
    for option in reversed(
        (
            click.option("--iterations", type=int, help="Re-runs of a candidate that did not show the failure."),
            click.option("--baseline-runs", type=int, help="Runs of the whole world before the first round."),
            click.option("--n-partitions", type=int, help="Partitions in the first round."),
            click.option("--delta", type=float, help="Change of the angular velocity where trajectoryseg cuts, rad/s."),
            click.option(
                "--candidates", metavar="both|partitions|complements", help="What ddenv tries of each partition."
            ),
            click.option(
                "--complement-order", metavar="paper|far-first", help="In which order ddenv tries the complements."
            ),
            click.option("--growth", metavar="paper|steady", help="When n grows: after every round, or a vain one."),
            click.option(
                "--skip", metavar="known|implied", help="What is not tried: judged sets, or their subsets too."
            ),
            click.option("--prior", metavar="spatial|uniform", help="Where probdd and splitting begin."),
            click.option("--epsilon", type=float, help="How near to the failure's end a similar failure ends, m."),
            click.option(
                "--similarity", metavar="end-pose|trajectory", help="Where it ends, or also how it got there."
            ),
            click.option(
                "--early-stop/--no-early-stop",
                default=None,
                help="End a test when the robot is stuck for good; full runs confirm what is left.",
            ),
        )
    ):
        command = option(command)
    return command
