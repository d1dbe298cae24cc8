"""The page of the workbench shows every screen, its pictures are there, and the list of keys is
complete.
"""

import re
from importlib import import_module
from pkgutil import walk_packages

import pytest
from docs import workbench_keys
from docs.workbench_pictures import PICTURES
from textual.screen import Screen

import ddenv.workbench
from ddenv.workbench.config import actions
from tests.conftest import ROOT

DOCS = ROOT / "docs"
PAGE = (DOCS / "workbench.md").read_text(encoding="utf-8")
SHOWN = {name: words for words, name in re.findall(r"!\[([^]]*)\]\(screens/([\w-]+)\.svg\)", PAGE)}


def screens():
    """All that a user can come to: what other screens are made of is none."""
    home = ddenv.workbench
    names = [module.name for module in walk_packages(home.__path__, f"{home.__name__}.")]
    found = [value for name in names for value in vars(import_module(name)).values()]
    ours = {
        each
        for each in found
        if isinstance(each, type) and issubclass(each, Screen) and each.__module__ in names
    }
    return {
        each.__name__
        for each in ours
        if not any(other is not each and issubclass(other, each) for other in ours)
    }


def test_every_screen_has_a_picture():
    assert screens() - {picture.screen for picture in PICTURES.values()} == set()


def test_the_page_shows_every_picture():
    assert {name: picture.words for name, picture in PICTURES.items()} == SHOWN


def test_every_picture_was_made_and_is_still_needed():
    assert {path.name for path in (DOCS / "screens").iterdir()} == {
        f"{name}.svg" for name in PICTURES
    }


@pytest.mark.parametrize(
    "path", sorted((DOCS / "screens").glob("*.svg")), ids=lambda path: path.stem
)
def test_pictures_tell_nothing_of_the_machine(path):
    text = path.read_text(encoding="utf-8")
    assert re.findall(r"/(?:home|root|work|Users|opt|wt)\b", text) == []


def test_the_list_of_keys_has_every_key():
    page = workbench_keys.PAGE.read_text(encoding="utf-8")
    assert workbench_keys.filled(page) == page, (
        "python docs/workbench_keys.py writes the tables again"
    )
    assert {id.partition(".")[0] for id in actions()} == set(workbench_keys.sections(page))
