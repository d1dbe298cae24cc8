"""The command line, as a user starts it or in this process."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import dataclass

import pytest

from ddenv.cli import main
from tests.waiting import PATIENCE

DDENV = (sys.executable, "-m", "ddenv")


@dataclass(frozen=True)
class Said:
    """What a command left: its exit code and all that it printed."""

    returncode: int
    stdout: str
    stderr: str


def ddenv(*words: object, **options) -> Said:
    """A process of its own. `options` are those of `subprocess.run`."""
    return _said([*DDENV, *map(str, words)], **options)


def python(code: str) -> Said:
    """A new Python that does nothing but this."""
    return _said([sys.executable, "-c", code])


def loaded(code: str, *modules: str) -> list[str]:
    """Those of `modules` that a new Python has imported after this."""
    done = python(
        f"import sys\n{code}\nprint(*(name for name in {modules} if name in sys.modules))"
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1].split()


def _said(words: list[str], **options) -> Said:
    done = subprocess.run(
        words, capture_output=True, timeout=PATIENCE, stdin=subprocess.DEVNULL, **options
    )
    return Said(
        done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")
    )


def in_process(monkeypatch, capsys, *words: object) -> Said:
    """Without a process of its own, which takes most of a second; a warning counts as a line, since
    it would be printed.
    """
    monkeypatch.setattr(sys, "argv", ["ddenv", *map(str, words)])
    with warnings.catch_warnings(record=True) as shown, pytest.raises(SystemExit) as left:
        warnings.simplefilter("always")
        # It would not be printed, and is of whatever garbage is collected just now.
        warnings.simplefilter("ignore", ResourceWarning)
        main()
    printed = capsys.readouterr()
    code = left.value.code or 0
    return Said(code, printed.out, printed.err + "".join(f"{each.message}\n" for each in shown))


def is_one_line(done, *words: str) -> None:
    """That a command was refused in one line with these words, and printed nothing else."""
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), (
        done.stdout + done.stderr
    )
    assert "Traceback" not in done.stderr
    assert all(word in done.stderr for word in words), done.stderr
