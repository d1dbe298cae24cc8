"""The house: imports point down, files are one idea, the code is tidy."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

BIN = Path(sys.executable).parent


def test_imports_only_point_down():
    done = subprocess.run([BIN / "lint-imports"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("command", [["check"], ["format", "--check"]], ids=" ".join)
def test_ruff(command):
    done = subprocess.run([BIN / "ruff", *command, "--no-cache", "."], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_file_is_over_400_lines():
    long = {
        str(path): count for path in (ROOT / "src").rglob("*.py") if (count := len(path.read_text().splitlines())) > 400
    }
    assert not long


def test_drake_is_never_imported_with_a_star():
    for path in (ROOT / "src").rglob("*.py"):
        assert "import *" not in path.read_text(), path


def test_views_start_without_drake_and_scikit_learn():
    code = (
        "import sys, ddenv.cli, ddenv.workbench.app, ddenv.scene.__main__, ddenv.cli.follow;"
        "print([name for name in ('pydrake', 'sklearn') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr
