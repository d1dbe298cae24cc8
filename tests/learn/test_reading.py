"""A broken lesson: file, line, key, and what is wrong, in one line."""

import json
import re
import shutil

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.learn import lesson_figures
from ddenv.learn.catalog import LESSONS, open_lesson, write_template

GOOD = """\
title: A title
aim: An aim.
run: delivery.ddenv
steps:
  - at: test 4
    text: There are {models} models.
    foretell: outcome
  - text: Now.
    ask: What?
    answers:
      - say: this
        right: true
        why: because
      - say: that
        why: because not
        misconception: part
"""
WRONG = [
    ("title: A title\n", "", 1, "the key 'title' is missing"),
    ("aim: An aim.", "aims: An aim.", 2, "aims: unknown key (did you mean aim?)"),
    ("There are {models} models", "There are 8 models", 6, "steps[1].text: '8' is a bare figure"),
    ("{models}", "{model}", 6, "unknown figure '{model}'"),
    ("{models}", "{__import__('os')}", 6, "unknown figure"),
    ("test 4", "test 999", 5, "steps[1].at: the run has no test 999; the last one is test"),
    ("- at: test 4", "- at: test four", 5, "'test four' is not a place in a run; expected start"),
    ("test 4", "round 1", 5, "to foretell the outcome it must be a test"),
    ("foretell: outcome", "foretell: all", 7, "use one of outcome, winner, parts"),
    ("right: true", "right: maybe", 12, "steps[2].answers[1].right: expected true or false"),
    ("        right: true\n", "", 11, "expected exactly one answer that is right, found 0"),
    ("misconception: part", "misconception: parts", 16, "use one of part, proof"),
    ("run: delivery.ddenv", "run: ../delivery.ddenv", 3, "is not in the lesson's folder"),
    (
        "run: delivery.ddenv",
        "run: nothing.ddenv",
        3,
        "there is no file 'nothing.ddenv' beside the lesson",
    ),
    ("steps:", "steps: {}\nmore:", 5, "more: unknown key"),
    ("    ask: What?\n", "", 10, "belongs to a question; the key 'ask' is missing"),
    ("Now.", "The {smallest} of all.", 8, "needs an oracle"),
    ("{models}", "{other.tests}", 5, "has no run 'other' beside its own"),
    ("{models}", "{without ramp}", 5, "the last certificate says nothing about 'ramp'"),
    ("{models}", "{rate of sign}", 5, "needs an oracle"),
    ("steps:", "beside: x\nsteps:", 4, "beside: expected names, each with a file"),
    ("title: A title", "title: [", 3, "not valid YAML"),
    ("title: A title", "title: !!python/object/apply:os.system [ls]", 1, "title: expected a text"),
]

ALONE = (
    GOOD.replace("steps:", "oracle: delivery.oracle.json\nsteps:")
    + """\
  - text: Try it.
    try:
      budget: 12
  - text: Look.
    race: [ddmin, splitting]
"""
)
WRONG_ALONE = [
    (
        "oracle: delivery.oracle.json\n",
        "",
        19,
        "steps[3].try: needs the outcome of every part of the world",
    ),
    (
        "budget: 12",
        "budget: 0",
        20,
        "steps[3].try.budget: expected a number from 1 to 600, found '0'",
    ),
    ("budget: 12", "tests: 12", 20, "steps[3].try.tests: unknown key; allowed are budget"),
    ("try:\n      budget: 12", "try: 12", 19, "steps[3].try: expected keys such as budget"),
    (
        "    try:\n",
        "    foretell: outcome\n    try:\n",
        21,
        "a step has one of ask, foretell, try, race, found foretell and try",
    ),
    ("[ddmin, splitting]", "ddmin", 22, "steps[4].race: expected a list with at least one entry"),
    (
        "[ddmin, splitting]",
        "[ddmin]",
        22,
        "steps[4].race: expected 2 to 4 algorithms or pairs, found 1",
    ),
    ("[ddmin, splitting]", "[ddmin, ddmin]", 22, "steps[4].race[2]: 'ddmin' appears twice"),
    (
        "[ddmin, splitting]",
        "[ddmin, spliting]",
        22,
        "steps[4].race[2]: 'spliting' is not allowed (did you mean splitting?)",
    ),
    (
        "[ddmin, splitting]",
        "[ddmin, timeseg/random]",
        21,
        "'timeseg/random' is not recorded yet; 'python -m docs.lessons.record_plays",
    ),
]


def lesson(folder, text):
    shutil.copy(LESSONS / "delivery.ddenv", folder)
    shutil.copy(LESSONS / "delivery.oracle.json", folder)
    file = folder / "mine.yaml"
    file.write_text(text)
    return file


def test_a_good_lesson_is_read(tmp_path):
    assert len(open_lesson(lesson(tmp_path, GOOD)).lesson.steps) == 2
    whole = open_lesson(lesson(tmp_path, ALONE))
    assert whole.lesson.steps[2].budget == 12 and whole.asked == 5
    assert [play.name for play in whole.racers(whole.lesson.steps[3])] == ["ddmin", "splitting"]


def test_a_search_needs_an_oracle_in_which_the_whole_world_fails(tmp_path):
    file = lesson(tmp_path, ALONE.partition("  - text: Look.")[0])
    oracle = tmp_path / "delivery.oracle.json"
    oracle.write_text(json.dumps(json.loads(oracle.read_text()) | {"outcomes": {}, "plays": {}}))
    with pytest.raises(
        UserError, match="f does not show with all models, so there is nothing to search"
    ):
        open_lesson(file)


MISTAKES = [(GOOD, *each) for each in WRONG] + [(ALONE, *each) for each in WRONG_ALONE]


@pytest.mark.parametrize(
    ("good", "old", "new", "line", "words"), MISTAKES, ids=[each[4][:40] for each in MISTAKES]
)
def test_a_mistake_is_one_line_with_its_place(tmp_path, good, old, new, line, words):
    assert old in good
    file = lesson(tmp_path, good.replace(old, new, 1))
    with pytest.raises(UserError) as error:
        open_lesson(file)
    assert str(error.value).startswith(f"{file}:{line}"), error.value
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@given(st.text(alphabet="ab{}_.()[]'1 models\n:-", max_size=40))
def test_a_text_is_never_more_than_a_text(text):
    try:
        lesson_figures.check(text)
    except UserError:
        return
    filled = lesson_figures.filled(text, lambda name: "8")
    assert re.sub("8", "", filled) == re.sub(r"\{[^{}]*\}", "", text)


def test_a_new_lesson_is_whole(tmp_path):
    file, run = write_template(tmp_path / "mine.yaml", LESSONS / "delivery.ddenv")
    assert run.is_file()
    assert open_lesson(file).asked == 5
    with pytest.raises(UserError, match="exists already"):
        write_template(file, LESSONS / "delivery.ddenv")
