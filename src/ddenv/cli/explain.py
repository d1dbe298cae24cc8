"""Commands that say why a run fails: `ddenv why` from its fresh runs, `isolate` by the nearest world that passes."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from ddenv.cli import options
from ddenv.cli.run import idle_run
from ddenv.cli.terminal import announce, say
from ddenv.errors import UserError
from ddenv.runs.folder import attach_name, find_run


@click.command("why")
@options.run_argument
@options.json_option
def why_command(run: str, as_json: bool) -> int:
    """Says why the robot fails in what is left of RUN (a name or a file): what it does without each model, and where
    the paths diverge. It uses the fresh runs of the certificate and makes no new test.

    After 'ddenv isolate RUN' it also says what the nearest world that passes lacks.
    """
    from ddenv.evidence.claims import current
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.reasons import nearest, no_reasons, parting_sentence, reasons, sentence

    with RunFile(find_run(run)) as file:
        state = fold(file.events())
        passing, certificate = nearest(file, state), current(state)
        found = () if passing is not None and certificate is None else reasons(file, state)
    if as_json:
        said = [asdict(each) | {"words": sentence(each)} for each in found]
        print(json.dumps({"reasons": said, "nearest": None if passing is None else asdict(passing)}))
        return 0
    for each in found:
        say(f"{sentence(each)} {parting_sentence(each)}".rstrip(), "- ")
    if passing is not None:
        say(passing.sentences)
    if not found and certificate is not None:
        say(no_reasons(certificate))
    return 0


@click.command("isolate")
@options.run_argument
@click.option(
    "--runs",
    type=options.whole(1),
    metavar="N",
    help="Minimum number of fresh runs of the world that passes; 20 by default.",
)
@click.option("--again", is_flag=True, help="Search again even if the nearest world that passes is known.")
@click.option("--give-up", is_flag=True, help="End an interrupted search; the run is left as it was before.")
@options.engine_options
def isolate_command(
    run: str, runs: int | None, again: bool, give_up: bool, jobs: int, cluster: str | None, trust: bool, as_json: bool
) -> int:
    """Finds the nearest world that passes: as few models removed from the whole world of RUN (a name or a file) as it takes for the
    robot to reach its goal. It changes nothing else.
    """
    from ddenv.cli.follow import Interrupted, follow
    from ddenv.guiding.commands import Isolate, Situation
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.programs import start_engine
    from ddenv.runs.reasons import nearest

    path, state = idle_run(run, trust, cluster)
    if give_up:
        if state.isolating is None:
            raise UserError(f"{path}: no search for the nearest world that passes is open: nothing to give up")
        follow(path, start_engine(path, 1, give_up="yes"), as_json)
        return 0
    if why := Isolate(again=True).refusal(Situation(state, "absent")):
        raise UserError(f"{path}: {why}: ddenv resume {attach_name(path)}")
    if state.isolated is None or state.isolating is not None or again or runs is not None:
        try:
            follow(path, start_engine(path, jobs, isolate=runs or 0, cluster=cluster), as_json)
        except Interrupted as interrupted:
            if interrupted.state.isolating is not None or interrupted.state.isolated is None:
                announce(f"interrupted; continue with: ddenv isolate {attach_name(path)}, or end it with --give-up")
                return 130
    with RunFile(path) as file:
        state = fold(file.events())
        found = nearest(file, state)
    if found is None:
        # The engine was stopped from elsewhere.
        raise UserError(
            f"{path}: the search for a world that passes was stopped; continue with: ddenv isolate {attach_name(path)}"
        )
    if as_json:
        print(json.dumps({"nearest": asdict(found)}))
    else:
        say(found.sentences)
    return 0 if found.gone else 1
