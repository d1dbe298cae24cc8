"""`ddenv test`: single runs of the robot."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.completing import runs_and_scenarios
from ddenv.cli.options import (
    announce,
    jobs_option,
    reading_options,
    scenario_options,
    setting_options,
    trust_option,
    whole,
)

if TYPE_CHECKING:
    from ddenv.runs.subject import Subject


@click.command("test")
@click.argument("subject", metavar="SCENARIO_OR_RUN", shell_complete=runs_and_scenarios)
@scenario_options
@setting_options(only=("timeout",))
@reading_options
@click.option("--keep", help="Only these models, by name, separated by commas.")
@click.option("--minimal", is_flag=True, help="Only the models of the run's environment.")
@click.option("--test", type=whole(1), metavar="NUMBER", help="The models and the seed of this test of the run.")
@click.option("--leave-out", multiple=True, metavar="MODEL", help="Leave this model out as well; may be repeated.")
@click.option("--leave-each-out", is_flag=True, help="Then leave out each of the models in turn.")
@click.option("--seed", type=whole(0, 2**31), help="Seed of the first run; the next ones count up.")
@click.option("--repeat", type=whole(1, 100_000), default=1, show_default=True, help="Runs of each.")
@click.option(
    "--simulator", type=Path, metavar="FILE", help="Run in this simulator: a YAML file with its name and its command."
)
@jobs_option("Runs")
@trust_option
@click.option("--json", "as_json", is_flag=True, help="Print one object with all runs at the end.")
def test_command(
    subject: str,
    keep: str | None,
    minimal: bool,
    test: int | None,
    leave_out: tuple[str, ...],
    leave_each_out: bool,
    seed: int | None,
    repeat: int,
    simulator: Path | None,
    jobs: int,
    trust: bool,
    as_json: bool,
    **options: Any,
) -> int:
    """Runs the robot in a scenario, or in a run's world; prints each run's outcome, and in the end how often it fails."""
    from ddenv.cli.test_summary import line, lines, summary
    from ddenv.engine.single_test import plan, run_trials

    names = None if keep is None else [name.strip() for name in keep.split(",") if name.strip()]
    results = []
    with ExitStack() as robots:
        what = _subject(subject, options, simulator, trust, robots)
        trials = plan(
            what,
            keep=names,
            minimal=minimal,
            leave_out=list(leave_out),
            leave_each_out=leave_each_out,
            seed=seed,
            repeat=repeat,
            test=test,
        )
        for result in run_trials(what, trials, jobs):
            results.append(result)
            if not as_json:
                print(line(result), flush=True)
    rows = summary(results)
    others = _elsewhere(what, results) if minimal and simulator is not None else []
    if as_json:
        print(json.dumps({"runs": results, "summary": rows, "elsewhere": others}))
    elif len(results) > 1:
        print("\n".join(["", *lines(rows, {each["without"]: each["said"] for each in others})]))
    return 0


def _elsewhere(what: Subject, results: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the runs show of another simulator; [] without a certificate that it can be compared with."""
    from ddenv.cli.test_summary import elsewhere
    from ddenv.evidence.claims import current

    certificate, oracle = None if what.state is None else current(what.state), what.scenario.oracle
    if certificate is None or oracle is None or not certificate.claims[0].low:
        return []
    return elsewhere(results, certificate.claims[0], oracle.name or "this simulator")


def _subject(name: str, options: Mapping[str, Any], simulator: Path | None, trust: bool, robots: ExitStack) -> Subject:
    """What `name` stands for; in another simulator, if one is given. `robots` keeps the file of a robot that only a run has."""
    from ddenv.cli.trusting import allow, allow_named
    from ddenv.engine.single_test import in_simulator
    from ddenv.runs.subject import open_subject, robot_file
    from ddenv.world.load import load_simulator

    another = None if simulator is None else load_simulator(simulator)
    found = open_subject(name, options, announce)
    # Another simulator may start the scenario's own controller.
    starts = found.scenario if another is None else found.scenario.model_copy(update={"oracle": None})
    if found.run is None:
        allow_named(starts, name, trust)
    else:
        allow(starts, found.run, trust)
    if another is not None:
        found = in_simulator(found, another, robots.enter_context(robot_file(found)))
        allow_named(found.scenario, str(simulator), trust)
    return found
