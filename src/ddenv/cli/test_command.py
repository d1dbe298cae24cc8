"""Commands that run the robot by itself, outside of a reduction: `ddenv test` and `reproduce`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.options import (
    jobs_option,
    json_option,
    reading_options,
    run_argument,
    runs_and_scenarios,
    scenario_options,
    setting_options,
    trust_option,
    whole,
)
from ddenv.cli.terminal import announce, asking
from ddenv.text import percent

if TYPE_CHECKING:
    from ddenv.runs.subject import Subject

# How `git bisect run` reads exit codes.
FAILS, PASSES, CANNOT_SAY = 1, 0, 125
# The options of `ddenv test` that say which runs are made.
PLANNED = ("minimal", "test", "leave_out", "leave_each_out", "seed", "repeat")


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
    subject: str, keep: str | None, simulator: Path | None, jobs: int, trust: bool, as_json: bool, **options: Any
) -> int:
    """Runs the robot in a scenario, or in a run's world; prints each run's outcome, and in the end how often it fails."""
    from ddenv.cli.test_summary import line, lines, summary
    from ddenv.engine.single_test import plan, run_trials

    planned = {name: options.pop(name) for name in PLANNED}
    names = None if keep is None else [name.strip() for name in keep.split(",") if name.strip()]
    results = []
    with ExitStack() as robots:
        what = _subject(subject, options, simulator, trust, robots)
        for result in run_trials(what, plan(what, keep=names, **planned), jobs):
            results.append(result)
            if not as_json:
                print(line(result), flush=True)
    rows = summary(results)
    others = _elsewhere(what, results) if planned["minimal"] and simulator is not None else []
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
    from ddenv.engine.single_test import in_simulator
    from ddenv.runs.subject import open_subject, robot_file
    from ddenv.runs.trust import check_named, check_trusted
    from ddenv.world.load import load_simulator

    another = None if simulator is None else load_simulator(simulator)
    found = open_subject(name, options, announce)
    # Another simulator may start the scenario's own controller.
    starts = found.scenario if another is None else found.scenario.model_copy(update={"oracle": None})
    if found.run is None:
        check_named(starts, name, asking(trust))
    else:
        check_trusted(starts, found.run, asking(trust))
    if another is not None:
        found = in_simulator(found, another, robots.enter_context(robot_file(found)))
        check_named(found.scenario, str(simulator), asking(trust))
    return found


@click.command("reproduce")
@run_argument
@click.option("--most", type=click.IntRange(1, 10_000), default=60, show_default=True, help="Runs at most.")
@click.option(
    "--folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Where the controller or the simulator of your own lies; the folder of the run's scenario if not given.",
)
@jobs_option("Runs")
@trust_option
@json_option
def reproduce_command(run: str, most: int, folder: Path | None, jobs: int, trust: bool, as_json: bool) -> int:
    """Runs what RUN (a name or a file) has left until it is known whether it still fails at the rate of its certificate.

    Exit codes are those of git bisect run: 1 it fails at that rate, 0 it does not (at less than half of it), 125 it cannot be
    said: the runs do not decide, or something is wrong.
    """
    from ddenv.cli.test_summary import line
    from ddenv.engine.single_test import expected, reproduce, subject_in
    from ddenv.runs.folder import find_run
    from ddenv.runs.trust import check_trusted

    path = find_run(run)
    subject = subject_in(path, folder)
    certificate = expected(subject, path)
    claim = certificate.claims[0]
    check_trusted(subject.scenario, path, asking(trust))
    for result, so_far in reproduce(subject, certificate, most, jobs):
        found = so_far
        if not as_json:
            print(line(result), flush=True)
    if as_json:
        print(json.dumps(asdict(found) | {"expected": {"low": claim.low, "high": claim.high}}))
    else:
        wanted = (
            "each run with a chosen seed" if certificate.seeds else f"{percent(claim.low)} to {percent(claim.high)}"
        )
        print(f"{found}; {wanted} expected")
    return {True: FAILS, False: PASSES, None: CANNOT_SAY}[found.fails]
