"""`ddenv why`: what happens without each model that is left, and what the nearest world that passes lacks."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import json_option


@click.command("why")
@click.argument("run", shell_complete=runs)
@json_option
def why_command(run: str, as_json: bool) -> int:
    """Says why the robot fails in what RUN (a name or a file) has left: what it does without each model, and where the ways part.

    The fresh runs of the certificate show it; no new test is made. After 'ddenv isolate RUN' it also says what the nearest world
    that passes lacks.
    """
    from ddenv.cli.wrapping import terminal_columns, wrapped
    from ddenv.evidence.claims import current
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.folder import find_run
    from ddenv.runs.nearest import nearest
    from ddenv.runs.reasons import no_reasons, parting_sentence, reasons, sentence
    from ddenv.text import printable

    with RunFile(find_run(run)) as file:
        state = fold(file.events())
        passing = nearest(file, state)
        found = () if passing is not None and current(state) is None else reasons(file, state)
    if as_json:
        said = [asdict(each) | {"words": sentence(each)} for each in found]
        print(json.dumps({"reasons": said, "nearest": None if passing is None else asdict(passing)}))
        return 0
    columns = terminal_columns()
    for each in found:
        words = printable(f"{sentence(each)} {parting_sentence(each)}".rstrip())
        print("\n".join(wrapped(words, columns, "- ")))
    if passing is not None:
        print("\n".join(wrapped(printable(passing.sentences), columns)))
    if not found and (certificate := current(state)) is not None:
        print("\n".join(wrapped(printable(no_reasons(certificate)), columns)))
    return 0
