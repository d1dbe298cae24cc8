"""The house: what neither ruff nor the import contracts can see. `.ci/run` runs these."""

import re

from tests.command import loaded
from tests.conftest import ROOT


def test_drake_is_never_imported_with_a_star():
    for path in (ROOT / "src").rglob("*.py"):
        assert not re.search(r"pydrake\S* import \*", path.read_text()), path


def test_views_start_without_drake_and_scikit_learn():
    views = "import ddenv.cli, ddenv.workbench.app, ddenv.scene.__main__, ddenv.cli.follow"
    assert loaded(views, "pydrake", "sklearn") == []


def test_the_first_paint_of_a_run_waits_for_no_slow_import():
    first = "import ddenv.workbench.launch, ddenv.workbench.run.run_screen"
    assert loaded(first, "numpy", "pydantic", "yaml") == []
