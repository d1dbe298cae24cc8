"""The pages name every key and option there is, with its default, and their links lead
somewhere.
"""

import re
import shlex

import click
import pytest
from click import Context

from ddenv.cli.command_line import app
from ddenv.schemas import OURS, names
from ddenv.world.scenario import (
    Controller,
    FailureSpec,
    Lidar,
    Planner,
    Reduction,
    Scenario,
    Section,
    Sensors,
    Simulation,
)
from tests.conftest import ROOT

REFERENCE = (ROOT / "docs/reference.md").read_text()
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "tests").glob("*.md"), *(ROOT / "docs").glob("*.md")])
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page):
    titles = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for link in LINK.findall(page.read_text()):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_programs_and_examples_that_pages_name_are_there(page):
    named = re.findall(r"\b(?:benchmarks|docs)/[\w/.-]*\w", page.read_text())
    assert [file for file in named if "NAME" not in file and not (ROOT / file).exists()] == []


@pytest.mark.parametrize(
    "section",
    [Scenario, Sensors, Lidar, Controller, Planner, FailureSpec, Reduction, Simulation],
    ids=lambda section: section.__name__,
)
def test_the_reference_names_every_key(section):
    named = {key for words in re.findall(r"`([\w.]+)`", REFERENCE) for key in words.split(".")}
    assert section.model_fields.keys() - named == set()


@pytest.mark.parametrize(
    ("key", "section"),
    [
        *((f"failure.{key}", FailureSpec) for key in ("epsilon", "timeout")),
        *(
            (f"reduction.{key}", Reduction)
            for key in ("n_partitions", "iterations", "delta", "seed", "baseline_runs")
        ),
        ("simulation.time_step", Simulation),
        *(
            (key, Planner)
            for key in (
                "padding",
                "inflation",
                "look_ahead",
                "replan",
                "patience",
                "recoveries",
                "lowest",
            )
        ),
        *((key, Sensors) for key in ("compass", "gyro", "tilt", "odometry", "compass_rate")),
        *((key, Controller) for key in ("period", "speed", "heading_gain", "skid", "motor_gain")),
        *((f"lidar.{key}", Lidar) for key in ("rate", "range", "noise", "x")),
    ],
)
def test_the_reference_has_the_defaults(key: str, section: type[Section]):
    row = next(line for line in REFERENCE.splitlines() if line.startswith(f"| `{key}`"))
    default = section.model_fields[key.rpartition(".")[2]].default
    assert float(re.match(r"[\d.]+", row.split(" | ")[-1]).group()) == default


@pytest.mark.parametrize("command", ["run", "test", "study"])
def test_the_reference_names_every_option(command):
    parameters = app.get_command(Context(app), command).params
    options = {
        option for parameter in parameters for option in parameter.opts if option.startswith("--")
    }
    assert {option for option in options if f"`{option}" not in REFERENCE} == set()


@pytest.mark.parametrize(
    ("page", "kind"),
    [
        *((page, kind) for page in ("how-it-works.md", "glossary.md") for kind in OURS),
        ("library.md", "algorithm"),
    ],
)
def test_pages_name_every_schema_and_algorithm(page, kind):
    text = (ROOT / "docs" / page).read_text()
    assert {name for name in names(kind) if f"`{name}`" not in text} == set()


COMMAND = re.compile(r"^    (?:\$ )?ddenv\b(.*)$", re.MULTILINE)
COMMANDS = sorted({line for page in PAGES for line in COMMAND.findall(page.read_text())})


@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_of_the_pages_exist_with_their_options(line):
    command, words = app, shlex.split(re.split(r" {2,}", line.strip())[0], comments=True)
    while (
        isinstance(command, click.Group)
        and words
        and (named := command.get_command(Context(command), words[0]))
    ):
        command = named
        words.pop(0)
    assert command is not app, line
    options = {option for each in command.params for option in each.opts + each.secondary_opts}
    assert {
        word.partition("=")[0] for word in words if re.match("--?[a-z]", word)
    } - options == set()
