"""A lesson to start from, beside a copy of its run."""

from __future__ import annotations

from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.position import position_in
from ddenv.runfile.store import RunFile
from ddenv.world.access import read_bytes, write_file

TEXT = """\
# A lesson. 'ddenv learn --check {file}' says what is wrong with it; docs/teaching.md explains every key.
title: The title in the list
aim: What a student can do or say after it, in one sentence.
minutes: 10
run: {run}
steps:
  - at: start
    text: |
      What the robot is supposed to do, and what goes wrong. Figures stand between braces and come from the run:
      this world has {{models}} models, and {{left}} are left at the end.
  - at: baseline
    text: |
      The baseline: the robot {{failure}} in {{failed_runs}} of {{baseline_runs}} runs of the whole world.
  - at: {test}
    text: |
      The first candidate.
    foretell: outcome
  - at: {round}
    text: |
      What do you think of this round?
    foretell: winner
  - at: end
    text: |
      The end: {{kept}}.
    ask: What does 1-minimal mean?
    hint: Think of leaving out one model at a time.
    answers:
      - say: No single model can be left out.
        right: true
        why: Each of them was left out in a test, and the failure was gone.
      - say: There is no smaller world that shows the failure.
        why: Nobody tried all of them.
        misconception: smallest
"""


def write_template(file: Path, run: Path) -> tuple[Path, Path]:
    """Writes both files; returns their paths. Raises UserError, also for a run without a round."""
    copy = file.with_name(run.name)
    for path in (file, copy):
        if path.exists():
            raise UserError(f"{path}: exists already; choose another name")
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise UserError(f"{file}: a lesson's name must end in .yaml")
    with RunFile(run) as content:
        state = position_in(content.events()).end
    first = next((test for test in state.tests if test.phase == "round" and test.implied_by is None), None)
    if first is None or not state.rounds_done:
        raise UserError(f"{run}: has no finished round yet, so there is nothing to predict")
    text = TEXT.format(file=file.name, run=run.name, test=f"test {first.id}", round=f"round {first.round}")
    write_file(copy, read_bytes(run))
    write_file(file, text.encode())
    return file, copy
