"""`ddenv why`: what happens without each model that is left."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import asdict

import click

from ddenv.cli.options import json_option


@click.command("why")
@click.argument("run")
@json_option
def why_command(run: str, as_json: bool) -> int:
    """Says why the robot fails in what RUN (a name or a file) has left: what it does without each model, and where the ways part.

    The fresh runs of the certificate show it; no new test is made.
    """
    from ddenv.cli.wrapping import wrapped
    from ddenv.errors import printable
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.folder import find_run
    from ddenv.runs.reasons import parting_sentence, reasons, sentence

    with RunFile(find_run(run)) as file:
        found = reasons(file, fold(file.events()))
    if as_json:
        print(json.dumps({"reasons": [asdict(each) | {"words": sentence(each)} for each in found]}))
        return 0
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for each in found:
        words = printable(f"{sentence(each)} {parting_sentence(each)}".rstrip())
        print("\n".join(wrapped(words, columns, "- ")))
    if not found:
        print("nothing is left that could be left out")
    return 0
