"""Each setting is declared once, and is everywhere it belongs."""

import json

import pytest
import yaml
from click import Context
from docs import settings_table
from pydantic import ValidationError

from ddenv.cli.command_line import app
from ddenv.errors import UserError
from ddenv.report.run_data import Record
from ddenv.settings import (
    CHANGEABLE,
    OPTIONS,
    PRINTED,
    SETTINGS,
    Failure,
    Reduction,
    Simulation,
    put,
    read,
)
from ddenv.workbench.setup import form
from ddenv.world.load import load_scenario, validate
from ddenv.world.scenario import Scenario
from tests.command import loaded
from tests.conftest import DATA

EVERY = pytest.mark.parametrize("one", SETTINGS.values(), ids=SETTINGS.keys())
WALL = yaml.safe_load((DATA / "wall.yaml").read_text())


def parameters(command):
    return app.get_command(Context(app), command).params


def scenario(**reduction):
    return validate(WALL | {"reduction": reduction}, "s.yaml")


def test_no_two_have_one_name():
    declared = [name for each in (Reduction, Failure, Simulation) for name in each.__annotations__]
    assert sorted(declared) == sorted(SETTINGS)


@EVERY
def test_it_is_in_the_scenario_and_its_schema(one):
    definitions = Scenario.model_json_schema()["$defs"]
    section = Scenario.model_fields[one.section].annotation.__name__
    found = definitions[section]["properties"][one.name]
    assert found["default"] == one.default
    assert found["description"] == one.summary
    assert read(scenario().model_dump(mode="json"), one) == one.default or one.name in (
        "timeout",
        "epsilon",
        "time_step",
    )


@EVERY
def test_a_scenario_takes_what_is_in_its_range(one):
    limits = [limit for limit in (one.least, one.above, one.most) if limit is not None]
    step = 1 if one.kind is int else 0.01
    numbers = [number for limit in limits for number in (limit - step, limit, limit + step)]
    others = [float("inf"), float("nan")] if one.kind is float else []
    values = (
        [one.kind(number) for number in numbers]
        + others
        + [*one.choices, "of nobody", None, -1, True, False]
    )
    for value in values:
        # Any word can be the name of another package's schema; pydantic makes a number of a truth
        # value.
        if (one.shown == "method" and isinstance(value, str)) or (
            isinstance(value, bool) and one.kind is not bool
        ):
            continue
        if one.kind is bool and value in (-1, None) and not one.stored:
            continue
        data = json.loads(load_scenario(DATA / "wall.yaml").model_dump_json())
        data[one.section][one.name] = value
        try:
            Scenario.model_validate(data)
            allowed = True
        except ValidationError:
            allowed = False
        assert allowed == one.allows(value) or (one.name == "as_printed" and value is True), value


@EVERY
def test_it_is_where_it_shows_and_nowhere_else(one):
    options = {
        name for command in ("run", "test") for each in parameters(command) for name in each.opts
    }
    fields = set(form.FIELDS) | {"algorithm", "pair"}
    assert (one.option in options) == (one.shown != "scenario") or not one.option
    assert (one.name in fields) == (one.shown in ("method", "basic", "more"))
    assert f"--{one.name.replace('_', '-')}" not in options or one.option
    shown = [each for each in parameters("run") if one.option in each.opts]
    assert not one.option or shown[0].help.startswith(f"{one.summary[:1].upper()}{one.summary[1:]}")


@EVERY
def test_it_is_in_the_docs(one):
    assert settings_table.row(one) in settings_table.PAGE.read_text()


def test_the_table_in_the_docs_is_the_one_that_the_settings_make():
    page = settings_table.PAGE.read_text()
    assert settings_table.filled(page) == page
    assert page.count("<!-- settings -->") == 1


def test_it_is_in_the_report(tmp_path):
    from ddenv.report.repeat import settings
    from ddenv.report.report import read_run
    from ddenv.runs.creation import create_run

    create_run(load_scenario(DATA / "wall.yaml"), tmp_path / "a.ddenv")
    record = read_run(tmp_path / "a.ddenv")
    assert isinstance(record, Record)
    rows = {row[0]: row for row in settings(record).blocks[0].rows}
    for one in SETTINGS.values():
        assert rows[one.label][2] == one.meaning


def test_what_may_change_on_the_way_is_in_the_dialog_and_nothing_else():
    from ddenv.workbench.run.change import OTHERS

    assert {*(one.name for one in OTHERS), "pair", "algorithm"} == set(CHANGEABLE)
    method = {"pair", "algorithm", "accept_rate", "exact_seeds", "iterations", "budget"}
    assert set(CHANGEABLE) == method | {"epsilon", "failure"}


def test_nothing_slow_is_imported_for_them():
    assert loaded("import ddenv.settings", "pydantic", "numpy", "click", "yaml") == []


# As printed.


def test_as_printed_stands_for_what_the_paper_has():
    printed = scenario(as_printed=True)
    assert printed.reduction.as_printed
    assert {name: getattr(printed.reduction, name) for name in PRINTED} == PRINTED
    assert printed == scenario(
        growth="paper", skip="known", accept_rate="first", early_stop=False, slice=False
    )
    assert not scenario().reduction.as_printed
    assert Scenario.model_validate_json(printed.model_dump_json()) == printed


WRONG = {
    "another": (
        {"as_printed": True, "growth": "steady"},
        "the paper has growth: paper, but growth is 'steady'",
    ),
    "no truth value": (
        {"as_printed": "often"},
        "reduction.as_printed: should be true or false, found 'often'",
    ),
    "typo": ({"as_print": True}, r"reduction.as_print: unknown key \(did you mean as_printed\?\)"),
}


@pytest.mark.parametrize(("reduction", "words"), WRONG.values(), ids=WRONG.keys())
def test_what_as_printed_cannot_be(reduction, words):
    with pytest.raises(UserError, match=words):
        scenario(**reduction)


def test_it_is_switched_on_and_off_and_leaves_other_variants_alone():
    one = SETTINGS["as_printed"]
    data = scenario(growth="paper").model_dump(mode="json")
    put(data, one, False)
    assert data["reduction"]["growth"] == "paper"
    put(data, one, True)
    assert read(data, one) is True
    put(data, one, False)
    assert data == scenario().model_dump(mode="json")


def test_what_is_damaged_has_its_default():
    damaged = {
        "reduction": {"iterations": "many", "budget": 10**400, "growth": 3, "seed": -1},
        "failure": None,
    }
    for one in OPTIONS:
        value = read(damaged, one)
        assert value == one.default
