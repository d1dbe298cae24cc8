"""README is short and shows what the study has; the files and messages that pages for newcomers
name are there.
"""

import ast
import re

import pytest
from docs.study_page import README, STUDY, headline, marked

from tests.conftest import ROOT

TROUBLE = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
# What other programs say.
OTHERS = {"No matching distribution found for drake"}


def test_the_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 100


def test_the_readme_has_the_test_command_in_one_line():
    assert re.search(r"^python3 -m venv .*pytest", README.read_text(encoding="utf-8"), re.MULTILINE)


def test_the_headline_figures_are_those_of_the_study():
    assert marked(README.read_text(encoding="utf-8"), "headline") == headline(
        marked(STUDY.read_text(), "nine")
    )


def test_the_headline_has_no_numbers_of_what_is_not_certified():
    nine = """| scenario | method | certified | search tests | paper |
| --- | --- | --- | ---: | ---: |
| ditch | one | yes | 60 | 268 |
| ditch | two | no | 10 | 82 |
| ditch | three | 3 of 3 | 40 (30 to 50) | 359 |
| rubble | one | 2 of 3 | 8 | 179 |
| rubble | two | – | – | 178 |
"""
    assert (
        headline(nine)
        == """| scenario | certified | search tests | paper |
| --- | --- | ---: | ---: |
| ditch | 2 of 3 | 30 to 60 | 268 to 359 |
| rubble | 0 of 2 | – | – |
"""
    )


HOUSE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_the_drawing_of_the_house_has_every_room():
    rooms = {
        path.stem
        for path in (ROOT / "src/ddenv").iterdir()
        if not path.stem.startswith("_") and path.is_dir()
    }
    drawing = HOUSE.split("```")[1]
    assert rooms - set(re.findall(r"\w+", drawing)) == set()


WALKS = dict(
    re.findall(r"^### (The life of .*?)$(.*?)(?=^###? |\Z)", HOUSE, re.MULTILINE | re.DOTALL)
)


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_passes_through_files_that_are_there(walk):
    files = re.findall(r"`([\w/]+\.py)`", WALKS[walk])
    assert files
    assert [file for file in files if not (ROOT / "src/ddenv" / file).is_file()] == []


def test_the_files_that_contributors_are_sent_to_are_there():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    files = re.findall(r"\b(?:src|docs|tests|scenarios|sdf|benchmarks)/[\w/.-]*\w", page)
    assert files
    assert [file for file in files if "NAME" not in file and not (ROOT / file).exists()] == []


def said() -> str:
    """Every text in the source, a line each; a NUL is where something is put in."""
    found = []
    for file in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (
                    part.value if isinstance(part, ast.Constant) else "\0" for part in node.values
                )
                found.append("".join(parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return "\n".join(found)


@pytest.fixture(scope="module")
def texts() -> str:
    return said()


@pytest.mark.parametrize("message", re.findall(r"^\| `([^`]+)` \|", TROUBLE, re.MULTILINE))
def test_the_messages_that_are_explained_are_the_programs(message, texts):
    parts = [part.strip(" :;,.") for part in message.split("...")]
    assert message in OTHERS or all(part in texts for part in parts if len(part) > 3)
