"""`ddenv test`: runs the robot by itself, outside of a reduction, and says how often it failed in
each environment.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli import options
from ddenv.cli.terminal import announce, asking
from ddenv.text import Data, coordinates, count, percent, printable

if TYPE_CHECKING:
    from ddenv.runfile.progress import Claim
    from ddenv.runs.experiment import Experiment

# The options that say which runs are made.
PLANNED = ("minimal", "test", "leave_out", "leave_each_out", "seed", "repeat")


@click.command("test")
@click.argument("subject", metavar="SCENARIO_OR_RUN", shell_complete=options.runs_and_scenarios)
@options.scenario_options
@options.setting_options(only=("timeout",))
@options.reading_options
@options.fetch_option
@click.option("--keep", help="Only these models, by name, separated by commas.")
@click.option("--minimal", is_flag=True, help="Only the models of the run's environment.")
@click.option(
    "--test",
    type=options.Whole(1),
    metavar="NUMBER",
    help="Use the models and the seed of this test of the run.",
)
@click.option(
    "--leave-out",
    multiple=True,
    metavar="MODEL",
    help="Leave this model out as well; may be repeated.",
)
@click.option("--leave-each-out", is_flag=True, help="Then leave out each of the models in turn.")
@click.option(
    "--margin",
    multiple=True,
    metavar="NUMBER[=VALUE]",
    help="Change a number, as 'ddenv export --margin' does.",
)
@click.option(
    "--seed",
    type=options.Whole(0, 2**31),
    help="Seed of the first run; the next ones count up from it.",
)
@click.option(
    "--repeat",
    type=options.Whole(1, 100_000),
    default=1,
    show_default=True,
    help="Number of runs of each.",
)
@click.option(
    "--simulator",
    type=Path,
    metavar="FILE",
    help="Run in this simulator: a YAML file with its name and its command.",
)
@options.jobs_option("Runs")
@options.trust_option
@click.option("--json", "as_json", is_flag=True, help="Print one object with all runs at the end.")
def test_command(
    subject: str,
    keep: str | None,
    simulator: Path | None,
    jobs: int,
    trust: bool,
    as_json: bool,
    **given: Any,
) -> int:
    """Runs the robot in a scenario, or in a run's world; prints each run's outcome, and at the end
    how often it fails.
    """
    from ddenv.engine.single_test import plan, run_trials
    from ddenv.evidence.claims import current
    from ddenv.runs.export import with_margins

    planned = {name: given.pop(name) for name in PLANNED}
    margins = given.pop("margin")
    names = None if keep is None else [name.strip() for name in keep.split(",") if name.strip()]
    results = []
    with ExitStack() as robots:
        what = with_margins(_subject(subject, given, simulator, trust, robots), margins)
        trials = plan(what, keep=names, **planned)
        if margins or simulator is not None:
            # What is changed is no repetition.
            trials = [replace(trial, of=None) for trial in trials]
        for result in run_trials(what, trials, jobs):
            results.append(result)
            if not as_json:
                print(line(result), flush=True)
    rows = summary(results)
    certificate = None if what.state is None else current(what.state)
    oracle = what.scenario.oracle
    others = []
    # Without a certificate there is nothing to compare with.
    if (
        planned["minimal"]
        and simulator is not None
        and certificate
        and oracle
        and certificate.claims[0].low
    ):
        others = elsewhere(results, certificate.claims[0], oracle.name or "this simulator")
    if as_json:
        print(json.dumps({"runs": results, "summary": rows, "elsewhere": others}))
    elif len(results) > 1:
        print("\n".join(["", *lines(rows, {each["without"]: each["said"] for each in others})]))
    # Where every run broke, nothing was tested.
    return int(not any(row["runs"] for row in rows))


def _subject(
    name: str, given: Mapping[str, Any], simulator: Path | None, trust: bool, robots: ExitStack
) -> Experiment:
    """What `name` stands for; in another simulator, if one is given. `robots` keeps the file of a
    robot that only a run has.
    """
    from ddenv.engine.single_test import in_simulator
    from ddenv.runs.experiment import open_experiment, robot_file
    from ddenv.runs.trust import check_named, check_trusted
    from ddenv.world.load import load_simulator

    another = None if simulator is None else load_simulator(simulator)
    found = open_experiment(name, given, announce)
    # Another simulator may start the scenario's own controller.
    if another is None:
        starts = found.scenario
    else:
        starts = found.scenario.model_copy(update={"oracle": None})
    if found.run is None:
        check_named(starts, name, asking(trust))
    else:
        check_trusted(starts, found.run, asking(trust))
    if another is not None:
        found = in_simulator(found, another, robots.enter_context(robot_file(found)))
        check_named(found.scenario, str(simulator), asking(trust))
    return found


def line(result: Mapping[str, Any]) -> str:
    how = result["failure"]
    if result["end_pose"] is not None:
        how = (
            f"ended at ({coordinates(result['end_pose'][:3])}) m after "
            f"{result['simulated_seconds']:.1f} s"
        )
        how += f"  {result['failure']}" if result["failure"] else ""
        how += "" if result["distance"] is None else f"  {result['distance']:.2f} m from f"
    without = f"  without {result['without']}" if result["without"] else ""
    said = printable(f"seed {result['seed']:<10} {result['outcome']:<8} {how}{without}")
    if "recorded" in result:
        return f"{said}\n  {printable(result['recorded'])}"
    return said


def summary(results: Sequence[Mapping[str, Any]]) -> list[Data]:
    """For all models, then without each one that was left out: its runs that did not break, and how
    many of them failed.

    `shown` counts the runs that ended in f, or in any failure where no f is known; `rate`, `low`
    and `high` are None without runs.
    """
    from ddenv.evidence.rates import wilson_interval
    from ddenv.runfile.state import BROKEN

    rows = []
    for without in dict.fromkeys(result["without"] for result in results):
        there = [each for each in results if each["without"] == without]
        outcomes = Counter(str(each["outcome"]) for each in there)
        shown = outcomes["similar"] + outcomes["failed"]
        runs = sum(number for outcome, number in outcomes.items() if outcome not in BROKEN)
        low, high = wilson_interval(shown, runs) if runs else (None, None)
        row = {"without": without, "models": there[0]["models"], "runs": runs, "shown": shown}
        rows.append(
            row
            | {
                "rate": shown / runs if runs else None,
                "low": low,
                "high": high,
                "outcomes": dict(outcomes),
            }
        )
    return rows


def lines(rows: Sequence[Mapping[str, Any]], said: Mapping[str | None, str] = {}) -> list[str]:
    """The same for people; `said` has other words for a row, by the model that was left out."""
    # Without a known f, all failures are alike.
    known = any("similar" in row["outcomes"] or "other" in row["outcomes"] for row in rows)
    found = []
    for row in rows:
        words = said.get(row["without"], "")
        if not words:
            if row["without"]:
                words = f"without {row['without']}"
            else:
                words = f"all {count(row['models'], 'model')}"
            share = f"{row['shown']} of {count(row['runs'], 'run')}"
            shown = f"{f'f in {share}' if known else f'{share} failed'}"
            words += (
                f": {shown} ({percent(row['low'])} to {percent(row['high'])})"
                if row["runs"]
                else ": no run ended"
            )
        broke = sum(row["outcomes"].values()) - row["runs"]
        found.append(printable(words + (f"; {count(broke, 'more run')} broke" if broke else "")))
    return found


def elsewhere(results: Sequence[Mapping[str, Any]], here: Claim, simulator: str) -> list[Data]:
    """What runs in another simulator show of what is left, of which the certificate says `here`,
    and of that without each model.

    What is left `fails` if f shows there at the certificate's rate, and not if at less than half of
    it. Without a model it fails if f shows nearly as often as with it there, and not if the model
    is needed; None where the runs do not decide. `said` has the same in words. An environment
    without a run that ended is left out.
    """
    from ddenv.evidence.rates import shows_at
    from ddenv.runfile.state import BROKEN
    from ddenv.words.claims import in_another_simulator, without_in_another_simulator

    found = []
    for row in (each for each in summary(results) if each["runs"]):
        there = replace(
            here, **{key: row[key] for key in ("without", "shown", "runs", "low", "high")}
        )
        if row["without"] is None:
            ended = (
                each
                for each in results
                if each["without"] is None and each["outcome"] not in BROKEN
            )
            fails = shows_at((each["outcome"] == "similar" for each in ended), here.low)
            said = in_another_simulator(simulator, fails, there, here)
        else:
            verdict = _needed_there(results, row["without"])
            fails = {"needed": False, "helps": True, "not needed": True}.get(verdict)
            said = without_in_another_simulator(simulator, verdict, there)
        found.append({"without": row["without"], "fails": fails, "said": said})
    return found


def _needed_there(results: Sequence[Mapping[str, Any]], without: str) -> str:
    """What pairs of runs with the same seed show of a model, as in a certificate; "" if they do not
    decide.
    """
    from ddenv.environment import Environment
    from ddenv.evidence.certificate import ERROR, falls, settle
    from ddenv.evidence.rates import Shown
    from ddenv.runfile.state import BROKEN

    rest = Environment.whole(1)
    left = Environment.whole(2)
    models = {rest: without, left: None}
    shown: dict[tuple[str | None, int], Shown] = {
        (one["without"], one["seed"]): "broken"
        if one["outcome"] in BROKEN
        else one["outcome"] == "similar"
        for one in results
    }
    seeds = [seed for model, seed in shown if model is None and (without, seed) in shown]

    def shown_in(environment: Environment, run: int) -> Shown:
        if run < len(seeds):
            return shown[models[environment], seeds[run]]
        return None

    return settle(falls(rest, left, ERROR), shown_in).verdict
