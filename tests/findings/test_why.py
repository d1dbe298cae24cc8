"""Why a run fails, in the four forms in which it is said: on the command line, to programs, in
files, and in the workbench. `GOLDEN=write pytest tests/findings` writes the files after a change
that is meant.
"""

import json
import os
import re
from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.report.bundle import write_bundle
from ddenv.report.report import write_report
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.words.claims import shape_doubts
from ddenv.workbench.why.entries import entries, head, head_of, listed, nothing_yet, said
from tests.findings.moments import MOMENTS

HERE = Path(__file__).parent
WIDTH = 60


def section(markdown, title):
    """The section of a page below a heading; "" if it has none."""
    found = re.search(rf"^## {title}\n(.*?)(?=^## |^---$|\Z)", markdown, re.DOTALL | re.MULTILINE)
    return found[1].strip() if found else ""


def in_files(path, folder):
    """What a report and the issue of a bundle say."""
    report = folder / "report.md"
    write_report(path, report)
    yield "report", section(report.read_text(), "Why it fails")
    try:
        write_bundle(path, folder / "bundle")
    except UserError as error:
        yield "issue", str(error)
    else:
        issue = (folder / "bundle/ISSUE.md").read_text()
        yield "issue", issue[: issue.index("## Reproduce")]


def in_workbench(path):
    with RunFile(path) as file:
        state = fold(file.events())
        known = state.certificates or state.isolated or state.margins
        found, more = entries(file, state) if known else ((), 0)
    yield "title", head_of(state, False)
    if not found:
        yield "page", nothing_yet(state, False, path.stem)
        return
    yield "rows", "\n".join(map(str, (head(WIDTH), *listed(found, WIDTH), f"{more} more")))
    for one in found:
        yield one.name, str(said(one, shape_doubts(state)))


@pytest.mark.parametrize("name", MOMENTS)
def test_what_is_said_is_what_was_said(name, tmp_path, command):
    path = MOMENTS[name](tmp_path)
    done = command("why", path)
    data = command("why", path, "--json").stdout
    forms = [
        ("command line", done.stdout + done.stderr),
        ("json", data and json.dumps(json.loads(data), indent=1)),
        *in_files(path, tmp_path),
        *(in_workbench(path)),
    ]
    text = "\n".join(f"=== {title}\n{words.rstrip()}\n" for title, words in forms)
    text = re.sub(r"[^\s\"':]*/(?=[\w-]+\.ddenv)", "RUNS/", text)
    golden = HERE / f"{name}.golden"
    if os.environ.get("GOLDEN") == "write":
        golden.write_text(text)
    assert text == golden.read_text()
