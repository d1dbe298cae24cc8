"""`ddenv schemas`: every partitioning, prioritization and algorithm with its explanation."""

import json
import subprocess
import sys
from collections import defaultdict
from importlib.metadata import EntryPoint

import pytest

from ddenv import schemas
from ddenv.cli.lists import schemas_lines as lines
from ddenv.cli.lists import schemas_report as report
from ddenv.text import width
from tests.waiting import PATIENCE


@pytest.fixture(autouse=True)
def forget():
    """What is known is kept for the whole program; here it changes."""
    yield
    schemas._known.cache_clear()
    schemas.explanation.cache_clear()


def test_all_are_listed_with_their_explanations():
    told, found = "\n".join(lines()), report()
    for kind in ("partitioning", "prioritization", "algorithm"):
        assert set(found[f"{kind}s"]) == set(schemas.names(kind))
        for name, words in found[f"{kind}s"].items():
            assert words == schemas.explanation(kind, name) != ""
            assert f"\n  {name}\n    {words}" in told


@pytest.mark.parametrize("columns", [40, 80, 132])
def test_the_lines_are_as_wide_as_the_terminal_and_lose_no_word(columns):
    told = lines(columns)
    assert max(map(width, told)) <= columns
    assert " ".join(" ".join(told).split()) == " ".join(" ".join(lines()).split())


def test_those_of_other_packages_are_listed_and_cannot_steer_the_terminal(tmp_path, monkeypatch):
    (tmp_path / "theirs.py").write_text('def halves(e, n, x):\n    """Two \\x1b[31mhalves."""\n')
    monkeypatch.syspath_prepend(tmp_path)
    entry = EntryPoint("halves", "theirs:halves", "ddenv.partitionings")
    gone = EntryPoint("gone", "nowhere.at_all:gone", "ddenv.partitionings")
    monkeypatch.setattr(
        schemas, "_installed", lambda: defaultdict(list, {"partitioning": [entry, gone]})
    )
    schemas._known.cache_clear()
    schemas.explanation.cache_clear()
    told = "\n".join(lines())
    assert "  halves\n    Two \N{REPLACEMENT CHARACTER}[31mhalves." in told
    assert "  gone\n    (no explanation)" in told
    assert report()["partitionings"]["halves"].startswith("Two")


@pytest.mark.parametrize("words", [[], ["--json"]], ids=["lines", "json"])
def test_the_command_prints_them_without_what_is_slow(words):
    code = (
        "import sys\nfrom ddenv.cli.command_line import app\n"
        f"app(['schemas', *{words}], standalone_mode=False)\n"
        "print([name for name in ('sklearn', 'numpy', 'pydrake', 'scipy') if name in "
        "sys.modules], file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.stderr.strip() == "[]"
    if words:
        assert json.loads(done.stdout) == report()
    else:
        assert done.stdout.rstrip("\n").split("\n") == lines()
