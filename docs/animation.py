"""Draws the README's picture: a reduction from its run file, candidate by candidate, as one
animated SVG.

    ddenv run friction --no-slice --output friction.ddenv
    python docs/animation.py friction.ddenv docs/reduction.svg

Each picture shows one candidate: the models it keeps, and the robot's path in its last test.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ddenv.map.drawing import Frame, at, badge, path_of, written
from ddenv.report.run_data import Record, read_run
from ddenv.runfile.state import Candidate, Test
from ddenv.runfile.store import COLUMNS, RunFile
from ddenv.text import count

SECONDS, LAST = 1.6, 4.0  # of a picture, and of the last one
WIDTH, HIGHEST, TOP = 860.0, 460.0, 14.0  # pixels
OUTCOMES = {
    "similar": "the same failure",
    "other": "another failure",
    "pass": "the goal is reached",
}
STYLE = """
svg { font: 15px Inter, "Segoe UI", Helvetica, Arial, "DejaVu Sans", sans-serif; }
.model { stroke: #24292f; stroke-width: 0.8; fill: #d29922; }
.floor { fill: #b6d6a5; }
.ground { fill: #f6f8fa; }
.path { fill: none; stroke-width: 2.4; stroke-linejoin: round; }
.similar { stroke: #cf222e; fill: #cf222e; }
.other { stroke: #8250df; fill: #8250df; }
.pass { stroke: #1a7f37; fill: #1a7f37; }
.path.similar, .path.other, .path.pass { fill: none; }
text.similar, text.other, text.pass { stroke: none; font-weight: 600; }
.words { fill: #24292f; }
.badge { stroke: #ffffff; stroke-width: 2; }
.start { fill: #1f6feb; }
.goal { fill: #1a7f37; }
.sign { fill: #ffffff; font-weight: 700; text-anchor: middle; }
"""


@dataclass(frozen=True)
class Picture:
    """The models that are there, those that are only left out of this test, and the test with its
    words.
    """

    there: frozenset[str]
    tried: frozenset[str]
    test: Test
    words: str


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path)
    parser.add_argument("svg", type=Path)
    options = parser.parse_args()
    record = read_run(options.run)
    shown = list(pictures(record))
    with RunFile(options.run) as file:
        paths = [
            np.frombuffer(file.trajectory(one.test.id)).reshape(-1, COLUMNS)[::4, 1:3]
            for one in shown
        ]
    options.svg.write_text(drawing(record, shown, paths))


def pictures(record: Record) -> Iterator[Picture]:
    state, here = record.state, record.elements
    baseline = [test for test in state.tests if test.phase == "baseline"]
    first = next(test for test in baseline if test.outcome == "similar")
    yield Picture(here, here, first, f"The whole world: {len(here)} models")
    for made in record.rounds:
        for candidate in made.candidates:
            if candidate.tests and candidate.verdict:
                test = state.tests[candidate.tests[-1] - 1]
                tried = frozenset(state.environments[test.environment].names(state.elements))
                yield Picture(
                    here, tried, test, f"Round {made.number}: {said(candidate, len(tried))}"
                )
                here = tried if candidate.verdict == "similar" else here
    for test in {
        test.environment: test for test in state.tests if test.phase == "certificate"
    }.values():
        tried = frozenset(state.environments[test.environment].names(state.elements))
        if tried < here and len(tried) == len(here) - 1:
            yield Picture(
                here, tried, test, f"Certificate: fresh runs without {', '.join(here - tried)}"
            )
    words = f"What is left: {len(here)} of {len(record.elements)} models: {', '.join(sorted(here))}"
    yield Picture(here, here, first, words)


def said(candidate: Candidate, models: int) -> str:
    kind = "one part alone" if candidate.kind == "partition" else "without one part"
    return f"{kind}, {count(models, 'model')}"


def drawing(record: Record, shown: list[Picture], paths: list[np.ndarray]) -> str:
    assert record.scenario is not None
    spawn, goal = record.scenario.robot.spawn, record.scenario.goal
    ends = [(spawn.x, spawn.y), (goal.x, goal.y)]
    room = WIDTH - 2 * TOP
    frame = Frame.around(record.models, ends, 0.02, 4.0, (room, HIGHEST), (room, 100.0), (TOP, TOP))
    height = float(frame.box[3]) + 52
    times = [SECONDS * number for number in range(len(shown))] + [SECONDS * (len(shown) - 1) + LAST]
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {height:.0f}">',
        f'<style>{STYLE}</style><rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for each in record.models:
        name, kind = each.model.name, "floor" if each.floor else ""
        seen = [1.0] * len(shown)
        if name in record.elements:
            seen = [
                1.0 if name in one.tried else 0.25 if name in one.there else 0.04 for one in shown
            ]
        else:
            kind = "ground"
        path = f'<path class="model {kind}" d="{path_of(each, frame)}"'
        lines.append(
            f"{path}>{animated(seen, times)}</path>" if len(set(seen)) > 1 else f"{path}/>"
        )
    lines += [
        at(frame.pixel(ends[0]), badge("start", "S")),
        at(frame.pixel(ends[1]), badge("goal", "G")),
    ]
    for number, (one, way) in enumerate(zip(shown, paths, strict=True)):
        points = frame.pixels(way)
        line = "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in points)
        x, y = points[-1]
        outcome = one.test.outcome
        opacities = [float(place == number) for place in range(len(shown))]
        lines += [
            f'<g opacity="0">{animated(opacities, times)}',
            (
                f'<path class="path {outcome}" d="{line}"/><circle class="{outcome}" cx="{x:.0f}" '
                f'cy="{y:.0f}" r="6"/>'
            ),
            f'<text class="words" x="{TOP}" y="{height - 18:.0f}">{written(one.words)}</text>',
            (
                f'<text class="{outcome}" x="{WIDTH - TOP}" y="{height - 18:.0f}" '
                f'text-anchor="end">{OUTCOMES[outcome]}</text></g>'
            ),
        ]
    return "\n".join([*lines, "</svg>"]) + "\n"


def animated(values: list[float], times: list[float]) -> str:
    """An opacity that changes at `times`, s, again and again; the last one is when all of it
    ends.
    """
    changes = [
        number for number, value in enumerate(values) if not number or value != values[number - 1]
    ]
    keys = ";".join(f"{times[number] / times[-1]:.4f}" for number in changes)
    opacity = ";".join(f"{values[number]:g}" for number in changes)
    steps = f'calcMode="discrete" dur="{times[-1]:.1f}s" repeatCount="indefinite"'
    return f'<animate attributeName="opacity" values="{opacity}" keyTimes="{keys}" {steps}/>'


if __name__ == "__main__":
    main()
