"""`ddenv margins`: how far the numbers of what a run has left may change before the robot no longer fails as it did."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from ddenv.cli import options
from ddenv.cli.run import idle_run
from ddenv.cli.terminal import announce, say
from ddenv.errors import UserError

BUDGET = 300


@click.command("margins")
@options.run_argument
@click.option(
    "--number",
    "globs",
    multiple=True,
    metavar="GLOB",
    help="Only numbers with such a name, such as green_patch_01.friction, '*.y' or controller.speed; may be given again. "
    "Without it those that promise most come first.",
)
@click.option("--budget", type=options.whole(1), metavar="N", help="Runs at most; 300 if not given.")
@click.option("--list", "listed", is_flag=True, help="Only list the numbers, with how far each is tried.")
@options.engine_options
def margins_command(
    run: str,
    globs: tuple[str, ...],
    budget: int | None,
    listed: bool,
    jobs: int,
    cluster: str | None,
    trust: bool,
    as_json: bool,
) -> int:
    """Says how far each number of what RUN (a name or a file) has left may change before f goes, and from where the robot reaches
    its goal: places, sizes and frictions of models, the start, the goal, the speed, the sensors. It changes nothing else.
    A search that was interrupted goes on.
    """
    from ddenv.cli.follow import Interrupted, follow
    from ddenv.engine.margins import numbers_left, refusal
    from ddenv.evidence.margins import fixes_of
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.programs import last_words, start_engine
    from ddenv.runs.subject import read_parts
    from ddenv.words.margins import lines, rows

    path, state = idle_run(run, trust, cluster)
    if why := refusal(state, path):
        raise UserError(f"{path}: {why}")
    with RunFile(path) as file:
        numbers = numbers_left(read_parts(file), state, globs)
    if listed:
        for one in numbers:
            say(f"{one.name}: {one.now:.4g}, tried from {one.low:.4g} to {one.high:.4g} {one.unit}".rstrip())
        return 0
    goes_on = state.margining is not None and not globs and budget is None
    asked = {} if goes_on else {"margins": json.dumps(globs), "most_runs": budget or BUDGET}
    try:
        follow(path, start_engine(path, jobs, cluster=cluster, **asked), as_json)
    except Interrupted as interrupted:
        if interrupted.state.margining is not None:
            announce(f"interrupted, and all runs are kept; go on with: ddenv margins {path}")
            return 130
    with RunFile(path) as file:
        margins = fold(file.events()).margins
    if margins is None or margins.broken_off:
        raise UserError(last_words(path))
    if not margins.ended:
        raise UserError(f"{path}: the search for margins was stopped; go on with: ddenv margins {path}")
    if as_json:
        found = [asdict(one.margin) | {"words": one.sentence} for one in rows(margins)]
        fixes = [asdict(one) for one in fixes_of(margins)]
        print(json.dumps({"margins": found, "fixes": fixes, "certified": margins.asked.certified}))
    else:
        print("\n".join(lines(margins)))
    return 0
