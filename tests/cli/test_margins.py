"""`ddenv margins`, and where its table is shown: with the report, the issue of a bundle, the
workbench; and a fix as a world.
"""

import json
import re
from collections import Counter

from ddenv.cli.follow import Interrupted
from ddenv.report.bundle import write_bundle
from ddenv.report.report import write_report
from ddenv.runs.engine_job import EngineOptions, FindMargins, Reduce
from ddenv.words.margins import bar, rows
from tests.command import is_one_line
from tests.workbench import fake_moments

FRICTION = (
    "crate_00.friction (0.1): f down to 0 (5 of 5 runs), the end of its range; f up to 0.2 (5 of "
    "5 runs), the robot reaches its goal at 0.4 (7 of 7 runs)"
)
FIX = (
    "The nearest fix found: crate_00.friction from 0.1 to 0.4, 33 % of its scale; the robot "
    "reaches its goal in 20 of 20 fresh runs"
)


def test_the_table_and_its_sentences_stand_everywhere(run, started, tmp_path, command):
    fake_moments.with_margins(run)
    done = command("margins", run.path, "--number", "crate_0*", "--jobs", 1)
    job = FindMargins(globs=("crate_0*",), most_runs=300)
    assert (done.returncode, started) == (0, [(run.path, EngineOptions(jobs=1), job)])
    said = done.stdout.splitlines()
    assert said[0].split() == ["number", "now", "f", "until", "instead", "runs"]
    assert said[1].split() == [
        "crate_00.friction",
        "0.1",
        "0",
        "(end)",
        "…",
        "0.2",
        "goal",
        "at",
        "0.4",
        "17",
    ]
    assert f"{FRICTION}." in said
    assert "no f at 0.31 (0 of 7 runs), where the robot was lost in 7" in done.stdout
    assert "1.25 is not possible: crate_01 would be 0.20 m inside crate_00" in done.stdout
    assert FIX in done.stdout
    assert "at most 5 %" in said[-1]
    found = json.loads(command("margins", run.path, "--json").stdout)
    assert [one["asked"]["name"] for one in found["margins"]] == ["crate_00.friction", "crate_01.y"]
    assert found["margins"][0]["words"] == FRICTION
    assert (found["fixes"][0]["value"], found["fixes"][0]["confirmed"]) == (0.4, True)
    write_report(run.path, tmp_path / "report.md")
    write_bundle(run.path, tmp_path / "handed")
    for text in (
        (tmp_path / "report.md").read_text(),
        (tmp_path / "handed" / "ISSUE.md").read_text(),
    ):
        assert FRICTION in text.replace("\\", "")
        assert FIX in text.replace("\\", "")


def test_the_report_outlines_how_far_a_model_may_move_and_has_both_paths(run, tmp_path):
    fake_moments.with_margins(run)
    write_report(run.path, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    section = page[page.index("<h2>Margins") : page.index("</section>", page.index("<h2>Margins"))]
    assert "paths now and with crate_00.friction = 0.4, seed 0." in section
    signs = re.findall(r'<path class="(until|from|over|now|changed)" d="M[-\d]', section)
    # Of crate_01.y: no f below, f above, and beyond that it would be inside another model; then the
    # legend has one line of each.
    assert Counter(signs) == {"over": 3, "until": 2, "now": 2, "changed": 2}


def test_a_value_is_tried_again_in_what_is_left(run, monkeypatch, command):
    fake_moments.with_margins(run)
    asked = []
    made = {
        "without": None,
        "models": 2,
        "outcome": "pass",
        "seed": 1,
        "end_pose": None,
        "failure": "",
        "distance": None,
    }
    monkeypatch.setattr(
        "ddenv.engine.single_test.run_trials", lambda *given: asked.append(given) or [made]
    )
    words = [
        "--minimal",
        "--margin",
        "crate_01.y=1.5",
        "--margin",
        "crate_00.friction",
        "--repeat",
        3,
    ]
    assert command("test", run.path, *words).returncode == 0
    ((subject, trials, _),) = asked
    assert subject.world.model("crate_01").pose.position[1] == 1.5
    # Without a value it is that of the fix.
    assert {one.mu for one in subject.world.model("crate_00").collisions} == {0.4}
    assert [set(trial.keep) for trial in trials] == 3 * [set(run.state.environment)]
    is_one_line(command("test", run.path, "--margin", "crate_01.y"), "no value of crate_01.y")
    is_one_line(command("test", "ditch", "--margin", "asphalt_far.x=4"), "--margin: needs a run")


def test_bars_stand_on_one_scale(run):
    fake_moments.with_margins(run)
    friction, place = (one.margin for one in rows(run.state.margins))
    lines_of = [bar(friction, 41), bar(place, 41)]
    assert {len(line) for line in lines_of} == {41}
    # 0.2 is 11 % of the scale away, 0.4 a third; roots of these are drawn.
    assert lines_of[0].strip() == "██████|██████+++++"
    assert (
        lines_of[1].index("·")
        < lines_of[1].index("|")
        < lines_of[1].index("█")
        < lines_of[1].index("x")
    )


def test_what_cannot_be_is_refused_in_one_line(run, started, command):
    fake_moments.with_margins(run)
    is_one_line(command("margins", run.path, "--number", "crate_00.frction"), "did you mean")
    for words, why in (
        (["--bundle", "a.zip", "--margin", "crate_00.x"], "--margin: needs --sdf FILE"),
        (["--sdf", "a.sdf", "--margin", "nothing.x"], "has no number 'nothing.x'"),
        (["--sdf", "a.sdf", "--margin", "crate_01.y"], "no value of crate_01.y is known"),
        (["--sdf", "a.sdf", "--margin", "crate_01.y=far"], "expected NAME=NUMBER"),
        (["--sdf", "a.sdf", "--margin", "crate_00.friction=-1"], "friction must not be negative"),
        (["--sdf", "a.sdf", "--margin", "spawn.x=1"], "also give --scenario FILE"),
        (["--sdf", "a.sdf", "--margin", "crate_01.y=1", "--passes"], "give one of them"),
    ):
        is_one_line(command("export", run.path, *words), why)
    assert started == []


def test_a_run_whose_failure_is_not_known_is_refused(run, started, command):
    run.created()
    is_one_line(command("margins", run.path), "f is not known yet")


def test_the_fix_is_written_as_a_world_that_differs_by_one_number(run, tmp_path, command):
    fake_moments.with_margins(run)
    left, fixed = tmp_path / "left.sdf", tmp_path / "fixed.sdf"
    command("export", run.path, "--sdf", left)
    done = command("export", run.path, "--margin", "crate_01.y=1.5", "--output", fixed)
    assert done.returncode == 0, done.stderr
    pairs = list(zip(left.read_text().splitlines(), fixed.read_text().splitlines(), strict=True))
    ((before, after),) = [pair for pair in pairs if pair[0] != pair[1]]
    differ = [
        words for words in zip(before.split(), after.split(), strict=True) if words[0] != words[1]
    ]
    assert [words[1] for words in differ] == ["1.5"]


def test_who_is_interrupted_reads_how_to_go_on(run, monkeypatch, command):
    fake_moments.finished(run)
    numbers = (
        {
            "name": "crate_00.y",
            "now": 0.0,
            "low": -3.0,
            "high": 3.0,
            "scale": 3.0,
            "resolution": 0.01,
        },
    )
    began = {
        "environment": run.state.nodes[run.state.node].id,
        "rate": 0.9,
        "error": 0.01,
        "budget": 50,
    }
    run.write(
        "margins_started",
        numbers=numbers,
        certified=True,
        status="finished",
        before="done",
        **began,
    )
    state = run.state

    def interrupted(*_):
        raise Interrupted(state)

    monkeypatch.setattr("ddenv.runs.programs.start_engine", lambda *_, **__: None)
    monkeypatch.setattr("ddenv.cli.follow.follow", interrupted)
    done = command("margins", run.path, "--number", "crate_00.y", "--budget", 50)
    assert done.returncode == 130
    assert f"continue with: ddenv margins {run.path}\n" in done.stderr
    asked = []
    monkeypatch.setattr(
        "ddenv.runs.programs.start_engine", lambda path, options, job: asked.append(job)
    )
    command("margins", run.path)
    command("margins", run.path, "--budget", 70)
    assert asked == [Reduce(), FindMargins(most_runs=70)]


def test_margins_and_reasons_say_whose_shapes_are_only_nearly_those_of_their_meshes(
    run, started, command
):
    fake_moments.with_margins(run)
    words = "what is left has models whose convex pieces block the floor otherwise: bin (3 pieces)"
    assert words[1:] not in command("why", run.path).stdout.replace("\n", " ")
    run.write("noted", about="pieces", words=words)
    for done in (command("why", run.path), command("margins", run.path, "--jobs", 1)):
        assert "".join(done.stdout.split()).endswith(f"W{words[1:]}.".replace(" ", ""))
