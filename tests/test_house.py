"""The house: what neither ruff nor the import contracts can see. `.ci/run` runs these."""

import re
import subprocess
import sys

from tests.conftest import ROOT


def test_drake_is_never_imported_with_a_star():
    for path in (ROOT / "src").rglob("*.py"):
        assert not re.search(r"pydrake\S* import \*", path.read_text()), path


def test_views_start_without_drake_and_scikit_learn():
    code = (
        "import sys, ddenv.cli, ddenv.workbench.app, ddenv.scene.__main__, ddenv.cli.follow;"
        "print([name for name in ('pydrake', 'sklearn') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_the_first_paint_of_a_run_waits_for_no_slow_import():
    code = (
        "import sys, ddenv.workbench.launch, ddenv.workbench.run.run_screen;"
        "print([name for name in ('numpy', 'pydantic', 'yaml') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr
