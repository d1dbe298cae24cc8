"""No name, reason or log steers a terminal: what is printed and drawn has no control characters of
theirs.
"""

import io
import json
import re
import sqlite3

import pytest

from ddenv.cli.summary import summary_lines
from ddenv.runfile.events import EngineFailed, Noted
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.programs import last_words
from ddenv.text import printable
from ddenv.words.news import headline
from ddenv.workbench.line_mode import LineMode
from tests.command import in_process
from tests.workbench import fake_moments, fake_run

ESCAPES = "\x1b]0;evil\x07\x1b[2J\x9b31m\x90q\x9c\r\x08\x7f\u202e"
STEERS = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
BOX = "<geometry><box><size>1 1 1</size></box></geometry>"
MESH = "<geometry><mesh><uri>no\x9b/m.dae</uri></mesh></geometry>"


def model(name, shape, pose="1 1 0 0 0 0"):
    link = f'<link name="l"><collision name="c">{shape}</collision></link>'
    return f'<model name="{name}"><static>true</static><pose>{pose}</pose>{link}</model>'


MODELS = (
    model("a\x9b31mb\x90q\x9cc\u202e", BOX)
    + model("far\x85", BOX, "nan 1 0 0 0 0")
    + model("mesh\x9b", MESH)
)
WORLD = f'<?xml version="1.0"?><sdf version="1.9"><world name="w\x9bx">{MODELS}</world></sdf>'


@pytest.fixture
def evil(tmp_path, home):
    """A run whose names and reasons are all escapes, and whose engine was killed while its log was
    full of them.
    """
    run = fake_moments.mid_round(fake_run.FakeRun(tmp_path / "a.ddenv"))
    run.close()
    with sqlite3.connect(run.path) as database:
        for id, text in database.execute(
            "SELECT id, data FROM event WHERE kind = 'created'"
        ).fetchall():
            data = json.loads(text)
            data["scenario"]["name"] += ESCAPES
            data["elements"] = [name + ESCAPES for name in data["elements"]]
            database.execute("UPDATE event SET data = ? WHERE id = ?", (json.dumps(data), id))
    database.close()
    with RunFile(run.path) as file:
        file.own()
        file.append(Noted(about="speed", words=f"slow {ESCAPES}"))
        file.append(EngineFailed(reason=f"broke {ESCAPES}"))
    (tmp_path / "a.ddenv.log").write_text(f"ddenv engine: died {ESCAPES}\nValueError: {ESCAPES}\n")
    return run.path


@pytest.mark.parametrize(
    "words",
    [
        *(
            ("runs",),
            ("doctor", "RUN"),
            ("report", "RUN", "-o", "OUT/r.html"),
            ("export", "RUN", "--sdf", "OUT/e.sdf"),
        ),
        *(
            ("world", "check", "WORLD"),
            ("world", "show", "WORLD"),
            ("world", "show", "RUN", "--took-part"),
            ("isolate", "RUN"),
            ("test", "RUN", "--keep", ESCAPES),
        ),
        *(
            ("open", ESCAPES),
            (ESCAPES,),
            ("run", f"no{ESCAPES}"),
            ("run", "ditch", "--spawn", ESCAPES),
            ("learn", f"RUN{ESCAPES}"),
        ),
        *(
            ("runs", f"--{ESCAPES}"),
            ("run", "ditch", "--jobs", ESCAPES),
            ("doctor", "RUN", "--repair", f"none/{ESCAPES}"),
        ),
    ],
    ids=str,
)
def test_nothing_that_is_printed_steers_the_terminal(evil, tmp_path, monkeypatch, capsys, words):
    (tmp_path / "w.sdf").write_text(WORLD)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "b.ddenv").write_bytes(evil.read_bytes())
    there = {"RUN": str(evil), "WORLD": str(tmp_path / "w.sdf")}
    said = in_process(
        monkeypatch,
        capsys,
        *(there.get(word, word.replace("OUT", str(tmp_path))) for word in words),
    )
    assert said.stdout or said.stderr
    assert not STEERS.search(said.stdout + said.stderr), ascii(said)


def test_no_result_steers_the_terminal(evil):
    with RunFile(evil) as file:
        state = fold(file.events())
    text = "\n".join(
        map(printable, [*summary_lines(state, evil), headline(state), last_words(evil)])
    )
    assert "evil" in text and not STEERS.search(text), ascii(text)


def test_no_line_steers_the_terminal(evil):
    out = io.StringIO()
    typed = iter(["help", "status", "why", "models", "table", f"try {ESCAPES}", "quit"])
    LineMode(evil, True, out).follow(typed)
    assert "evil" in out.getvalue() and not STEERS.search(out.getvalue()), ascii(out.getvalue())
