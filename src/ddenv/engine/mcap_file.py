"""Runs as an MCAP file: what Foxglove, Rerun and `ros2 bag` show. The streams are made again from the seeds, bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
from itertools import islice
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from ddenv.claims import current
from ddenv.engine.judging import rows_of
from ddenv.engine.ros_messages import DEFINITIONS, nanoseconds
from ddenv.engine.single_test import Subject, plan, subject_of_run
from ddenv.engine.streams import Chosen, Streams, messages
from ddenv.errors import UserError
from ddenv.robot.result import Progress
from ddenv.robot.simulation.template import Variants
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.nearest import nearest
from ddenv.runs.reasons import GOAL, F, reasons
from ddenv.world.access import write_file


def write_mcap(run: Path, target: Path, progress: Callable[[str, float], None]) -> list[str]:
    """Makes the failing run, that of what is left, and one that reaches its goal again (`_chosen` says which), and writes their
    streams to `target`; returns a line about each.

    `progress(name, seconds)` gets the simulated time, s. Raises UserError, also for runs by a simulator of the user's own and for
    runs that give other bits here; then nothing is written.
    """
    if target.exists():
        raise UserError(f"{target}: exists already; choose another name")
    with RunFile(run) as file:
        subject = subject_of_run(file)
        if subject.scenario.oracle is not None:
            raise UserError(f"{run}: a simulator of your own made it; only runs on Drake have streams to write")
        chosen = [_named(subject, name, test) for name, test in _chosen(file)]
        stored = {one.test: rows_of(file, one.test) for one in chosen}
    if not chosen:
        raise UserError(f"{run}: f is not known yet, so there is no run to write; run it first: ddenv resume {run}")
    template = Variants(subject.world, subject.robot, subject.scenario)
    said, output = [], BytesIO()
    writer = Writer(output)
    schemas = {name: writer.register_msgdef(name, text) for name, text in DEFINITIONS.items()}
    for one in chosen:
        streams = Streams()
        result = template.run(one.models, one.seed, _progress(progress, one.name), one.full, streams)
        if not np.array_equal(result.trajectory, stored[one.test]):
            raise UserError(f"{run}: test {one.test} gives other bits here: another Drake or another processor made it")
        for topic, kind, seconds, message in messages(one, result, streams, subject):
            whole = topic if topic.startswith("/") else f"/{one.name}/{topic}"
            writer.write_message(whole, schemas[kind], message, nanoseconds(seconds))
        said.append(f"/{one.name}: test {one.test}, seed {one.seed}, {result.simulated_seconds:.1f} s")
    writer.finish()  # type: ignore[no-untyped-call]
    write_file(target, output.getvalue())
    return said


def _progress(progress: Callable[[str, float], None], name: str) -> Progress:
    return lambda seconds, *_: progress(name, seconds)


def _chosen(file: RunFile) -> Iterator[tuple[str, int]]:
    """Names and tests: one that shows f, the last one of what is left, and one that reaches its goal.

    That is in the nearest world that passes, where it is known, and then the first one has its seed; else in what is left
    without a model of it.
    """
    state = fold(file.events())
    passes = nearest(file, state)
    pair = None if passes is None else passes.parting
    if state.f_test is not None:
        alike = pair is not None and state.tests[pair.with_test - 1].outcome == F
        yield "whole", pair.with_test if alike and pair is not None else state.f_test.id
    if state.evidence_test is not None:
        yield "left", state.evidence_test
    if pair is not None:
        yield "passing", pair.without_test
        return
    found = () if current(state) is None else reasons(file, state)
    passing = (each.parting for each in found if each.parting and each.ends[0].kind == GOAL)
    for parting in islice(passing, 1):
        yield "passing", parting.without_test


def _named(subject: Subject, name: str, number: int) -> Chosen:
    (trial,) = plan(subject, test=number)
    cut = subject.state is not None and subject.state.tests[number - 1].cut
    return Chosen(name, number, trial.keep, trial.seed, not cut)
