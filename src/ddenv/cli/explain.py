"""Commands that say why a run fails: `ddenv why` from its fresh runs, `isolate` by the nearest
world that passes, and `margins` by how far the numbers of what is left may change before the robot
no longer fails as it did.
"""

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
    """Says why the robot fails in what is left of RUN (a name or a file): what it does without each
    model, and where the paths diverge. It uses the fresh runs of the certificate and makes no new
    test.

    After 'ddenv isolate RUN' it also says what the nearest world that passes lacks.
    """
    from ddenv.evidence.claims import current
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.reasons import nearest, no_reasons, parting_sentence, reasons, sentence
    from ddenv.words.claims import shape_doubts

    with RunFile(find_run(run)) as file:
        state = fold(file.events())
        passing = nearest(file, state)
        certificate = current(state)
        found = () if passing is not None and certificate is None else reasons(file, state)
    if as_json:
        said = [asdict(each) | {"words": sentence(each)} for each in found]
        print(
            json.dumps({"reasons": said, "nearest": None if passing is None else asdict(passing)})
        )
        return 0
    for each in found:
        say(f"{sentence(each)} {parting_sentence(each)}".rstrip(), "- ")
    if passing is not None:
        say(passing.sentences)
    if not found and certificate is not None:
        say(no_reasons(certificate))
    for words in shape_doubts(state):
        say(words)
    return 0


@click.command("isolate")
@options.run_argument
@click.option(
    "--runs",
    type=options.Whole(1),
    metavar="N",
    help="Minimum number of fresh runs of the world that passes; 20 by default.",
)
@click.option(
    "--again", is_flag=True, help="Search again even if the nearest world that passes is known."
)
@click.option(
    "--give-up", is_flag=True, help="End an interrupted search; the run is left as it was before."
)
@options.engine_options
def isolate_command(
    run: str,
    runs: int | None,
    again: bool,
    give_up: bool,
    jobs: int,
    cluster: str | None,
    trust: bool,
    as_json: bool,
) -> int:
    """Finds the nearest world that passes: as few models removed from the whole world of RUN (a
    name or a file) as it takes for the robot to reach its goal. It changes nothing else.
    """
    from ddenv.cli.follow import Interrupted, follow
    from ddenv.guiding.commands import Context, Isolate
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs import engine_job
    from ddenv.runs.engine_job import EngineOptions
    from ddenv.runs.programs import start_engine
    from ddenv.runs.reasons import nearest

    path, state = idle_run(run, trust, cluster)
    if give_up:
        if state.isolating is None:
            raise UserError(
                f"{path}: no search for the nearest world that passes is open: nothing to give up"
            )
        follow(
            path, start_engine(path, EngineOptions(jobs=1), engine_job.GiveUpIsolation()), as_json
        )
        return 0
    if why := Isolate(again=True).refusal(Context(state, "absent")):
        raise UserError(f"{path}: {why}: ddenv resume {attach_name(path)}")
    if state.isolated is None or state.isolating is not None or again or runs is not None:
        work = EngineOptions(jobs=jobs, cluster=cluster)
        try:
            follow(path, start_engine(path, work, engine_job.Isolate(at_least=runs)), as_json)
        except Interrupted as interrupted:
            if interrupted.state.isolating is not None or interrupted.state.isolated is None:
                announce(
                    f"interrupted; continue with: ddenv isolate {attach_name(path)}, or end it "
                    "with --give-up"
                )
                return 130
    with RunFile(path) as file:
        state = fold(file.events())
        found = nearest(file, state)
    if found is None:
        # The engine was stopped from elsewhere.
        raise UserError(
            f"{path}: the search for a world that passes was stopped; continue with: ddenv "
            f"isolate {attach_name(path)}"
        )
    if as_json:
        print(json.dumps({"nearest": asdict(found)}))
    else:
        say(found.sentences)
    if found.gone:
        return 0
    return 1


@click.command("margins")
@options.run_argument
@click.option(
    "--number",
    "globs",
    multiple=True,
    metavar="GLOB",
    help="Only numbers whose names match, such as green_patch_01.friction, '*.y' or "
    "controller.speed; may be repeated. "
    "Without it the most promising ones come first.",
)
@click.option(
    "--budget", type=options.Whole(1), metavar="N", help="Maximum number of runs; 300 by default."
)
@click.option(
    "--list",
    "listed",
    is_flag=True,
    help="Only list the numbers and the range in which each is tried.",
)
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
    """Says how far each number in what is left of RUN (a name or a file) can change before f is
    gone, and from where the robot reaches its goal: places, sizes and frictions of models, the
    start, the goal, the speed, the sensors. It changes nothing else, and continues an interrupted
    search.
    """
    from ddenv.cli.follow import Interrupted, follow
    from ddenv.engine.margins import numbers_left, refusal
    from ddenv.evidence.margins import fixes_of
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.engine_job import MOST_RUNS, EngineOptions, FindMargins, Job, Reduce
    from ddenv.runs.experiment import read_parts
    from ddenv.runs.programs import last_words, start_engine
    from ddenv.words.claims import shape_doubts
    from ddenv.words.margins import lines, rows

    path, state = idle_run(run, trust, cluster)
    if why := refusal(state, path):
        raise UserError(f"{path}: {why}")
    with RunFile(path) as file:
        numbers = numbers_left(read_parts(file), state, globs)
    if listed:
        for one in numbers:
            say(
                (
                    f"{one.name}: {one.now:.4g}, tried from {one.low:.4g} to {one.high:.4g} "
                    f"{one.unit}"
                ).rstrip()
            )
        return 0
    job: Job = FindMargins(globs=globs, most_runs=budget or MOST_RUNS)
    if state.margining is not None and not globs and budget is None:
        job = Reduce()
    try:
        engine = start_engine(path, EngineOptions(jobs=jobs, cluster=cluster), job)
        follow(path, engine, as_json)
    except Interrupted as interrupted:
        if interrupted.state.margining is not None:
            announce(f"interrupted; all runs are kept; continue with: ddenv margins {path}")
            return 130
    with RunFile(path) as file:
        state = fold(file.events())
    margins = state.margins
    if margins is None or margins.broken_off:
        raise UserError(last_words(path))
    if not margins.ended:
        raise UserError(
            f"{path}: the search for margins was stopped; continue with: ddenv margins {path}"
        )
    if as_json:
        found = [asdict(one.margin) | {"words": one.sentence} for one in rows(margins)]
        fixes = [asdict(one) for one in fixes_of(margins)]
        print(json.dumps({"margins": found, "fixes": fixes, "certified": margins.asked.certified}))
    else:
        print("\n".join((*lines(margins), *shape_doubts(state))))
    return 0
