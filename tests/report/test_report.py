"""A report tells what a run came to, whatever state it is in, and whatever its names hold."""

import re
from html.parser import HTMLParser
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import pytest

from ddenv.errors import UserError
from ddenv.page.blocks import Picture, Table
from ddenv.page.markdown import markdown
from ddenv.report.report import content, files_of, write_report
from ddenv.report.rounds import MOST_ROUNDS
from ddenv.report.run_data import read_run
from tests.workbench import fake_moments, fake_run

VOID = {"meta"}
INLINE = {"strong", "bdi"}
EVIL = (
    "</script><script>alert(1)</script>",
    '<b>&"x" [bold] ]]>',
    "\u202eabc`",
    "\u05e9" * 30,
    "n" * 300,
    "a|b *c* _d_ [e](f) ``",
)


class Page(HTMLParser):
    """The tags and words of a page; fails where tags are not balanced."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words, self.attributes = [], set(), [], set()
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes.update(name for name, _ in attrs)
        if tag not in VOID:
            self.open.append(tag)
        self.part(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        self.part(tag)

    def part(self, tag):
        self.words.append("" if tag in INLINE else " ")

    def handle_data(self, data):
        if "style" not in self.open:
            self.words.append(data)

    @property
    def text(self):
        return " ".join("".join(self.words).split())


def page(run, tmp_path):
    (file,) = write_report(run.path, tmp_path / "report.html", force=True)
    return Page(file.read_text())


def table(report, title):
    """The rows of the table that has a column of this title."""
    tables = (
        block for section in report.sections for block in section.blocks if isinstance(block, Table)
    )
    return next(each.rows for each in tables if title in each.head)


def words(cell):
    """A cell without what makes parts of it stand out."""
    parts = cell if isinstance(cell, tuple) else (cell,)
    return "".join(part if isinstance(part, str) else part.text for part in parts)


def rows_of(run, title):
    """The rows of that table in the report on a run, in words."""
    return [tuple(map(words, row)) for row in table(content(read_run(run.path)), title)]


def test_a_certificate_that_was_stopped_says_what_it_has_shown(run):
    fake_moments.certifying(run).write("engine_stopped", reason="stopped by the user")
    text = markdown(content(read_run(run.path)), "a")
    assert "Its certificate is not finished: what its runs have shown so far still holds." in text
    assert "| what is left | 12 | 11 | keeps at least 53 % of the rate |" in text


def test_it_begins_with_a_paragraph_for_everyone(run):
    fake_moments.mid_round(run)
    assert "Fresh runs have not checked that yet." in "".join(
        map(words, content(read_run(run.path)).lead[0].parts)
    )


def test_a_finished_run_in_a_few_words(run, tmp_path):
    fake_moments.finished(run)
    report = content(read_run(run.path))
    # How long it took to write its events depends on the machine.
    assert re.sub(r"\d+ s of", "0 s of", "".join(map(words, report.lead[0].parts))) == (
        "In short: The robot got stuck before it reached its goal. Of the 11 models in its world, "
        "2 are enough to make it fail this way: crate_00, crate_01. It failed like this in 23 of "
        "23 new runs with nothing else there (80 % to 100 % of all runs, with 95 % confidence); "
        "with any one of them removed, in at most 1 of 12 (at most 49 %). This took 83 simulated "
        "runs and 0 s of computing time."
    )
    titles = [section.title for section in report.sections]
    first = [
        "The minimal environment",
        "What the result is worth",
        "Why it fails",
        "How it got there",
    ]
    assert [title for title in titles if title in first] == first
    rows = rows_of(run, "model")
    assert rows[0] == ("crate_00", "static", "-4.50, 0.00, 0.15", "1.20 × 0.80 × 0.30")
    assert [row[0] for row in rows] == ["crate_00", "crate_01"]
    text = page(run, tmp_path).text
    assert "2 of 11 models are enough to make the robot fail" in text
    assert (
        "Minimal: no single model can be removed: f in 23 of 23 fresh runs (80 % to 100 %)" in text
    )
    assert "without crate_01 12 11 pass, 1 similar" in text.replace(
        "1 similar, 11 pass", "11 pass, 1 similar"
    )
    assert "the robot got stuck at (2.00, 0.40, 0.20) m." in text
    assert "got stuck in 3 of 4 runs: 75 %, 95 % interval 30 % to 95 %" in text
    assert f"ddenv test {run.path} --minimal --leave-each-out" in text
    assert "ddenv run crates.yaml --pair model2model/failure-proximal --iterations 3" in text


@pytest.mark.programs
def test_the_nearest_world_that_passes_has_its_map(run, tmp_path):
    fake_moments.isolated(run)
    assert "A nearest world that passes lacks 1 model of 11 (crate_00)" in page(run, tmp_path).text
    # Its caption is read aloud, not shown.
    assert "The nearest world that passes, from above" in str(content(read_run(run.path)))


def test_what_a_removal_drops_stands_in_the_table_of_models(run):
    fake_moments.piled(run)
    assert {row[0]: row[-1] for row in rows_of(run, "removing it drops") if row[-1]} == {
        "crate_02": "crate_01",
        "crate_04": "crate_07",
        "crate_05": "crate_01, crate_02",
    }


def test_rounds_as_they_ended_and_what_was_decided_by_hand(run, tmp_path):
    fake_moments.guided(run)
    assert rows_of(run, "round") == [
        ("1", "2", "1 of 2", "part A", "6", "1"),
        ("2", "3", "1 of 6", "without A, taken back", "4", "1"),
        ("3", "2", "2 of 2", "under way", "5", "4"),
    ]
    assert [row[-1] for row in rows_of(run, "what the user did")][:2] == [
        "took back without A: 6 models again",
        "pinned crate_00",
    ]
    # The page needs nothing else, and runs nothing.
    made = page(run, tmp_path)
    assert not made.tags & {"script", "link", "img", "iframe", "a", "object"}
    assert not made.attributes & {"src", "href", "onload", "onclick"}


def test_other_failures_have_names_numbers_and_the_smallest_environment(run):
    run.created().baseline(others=2)
    run.start_round(2)
    run.dissimilar(0)
    sections = {one.title: one.blocks for one in content(read_run(run.path)).sections}
    rows = next(block for block in sections["Other failures met"] if isinstance(block, Table)).rows
    assert [row[:4] for row in rows] == [
        ("fell at (3.00, 1.40)", "1.41", "2", "11 models (test 4)"),
        ("tipped over at (2.00, 0.40)", "0.00", "2", "6 models (test 7)"),
    ]
    seen = next(block for block in sections["How certain it is"] if isinstance(block, Table))
    assert seen.rows == (("1", "stuck at (2.00, 0.40)", "3"), ("2", "fell at (3.00, 1.40)", "2"))
    assert seen.strong == {0}


def test_settings_that_were_changed_on_the_way(run):
    run.created().baseline().write("changed", settings={"iterations": 7})
    rows = {row[0]: row[1] for row in rows_of(run, "setting")}
    assert rows["iterations"] == "7 (changed during the run; initially 3)"


STATES = {
    "Not started yet": lambda run: run,
    "The engine is not running": lambda run: run.created(),
    "Stopped: as you asked.": lambda run: (
        run.created().baseline().write("engine_stopped", reason="as you asked")
    ),
    "The engine could not go on: no disk.": lambda run: run.created().write(
        "engine_failed", reason="no disk"
    ),
    "No failure is known yet": lambda run: run.created().write(
        "finished", minimal=False, reason="no run failed"
    ),
    "This run has not ended. This report shows what was known at": lambda run: (
        fake_moments.mid_round(run).hold()
    ),
}


@pytest.mark.parametrize("told", STATES)
def test_a_run_that_has_not_come_to_an_end_says_so(run, tmp_path, told):
    STATES[told](run)
    text = page(run, tmp_path).text
    # It is not known yet which tests that idle workers started early were needed.
    assert told in text and "idle workers" not in text


def test_of_a_damaged_run_what_makes_sense_is_told(run, tmp_path):
    fake_moments.finished(run).write("reduced", candidate=99, environment=[77], evidence_test=1)
    text = page(run, tmp_path).text
    assert "Parts of this run could not be read." in text and "is invalid here" in text
    assert "2 of 11 models" in text


def test_without_a_world_there_is_no_map(run, tmp_path):
    fake_moments.finished(run).file._db.execute(
        "UPDATE document SET content = ? WHERE name = 'world'", (b"<sdf",)
    )
    report = content(read_run(run.path))
    assert not any(
        isinstance(each, Picture) and each.name == "map" for each in report.sections[0].blocks
    )
    text = page(run, tmp_path).text
    assert "No map: the world cannot be read." in text and "Left: crate_00, crate_01." in text


def evil(tmp_path):
    data = fake_run.scenario((), '<i>&x</i> | `y` "')
    data["description"] = "</p><script>alert(1)</script> # *x*"
    names = [escape(name, {'"': "&quot;"}) for name in EVIL]
    run = fake_run.FakeRun(tmp_path / "evil.ddenv", data, fake_run.world_text(names))
    run.created().baseline()
    run.start_round(3)
    run.reduce(1, run.elements[:-1], run.similar(1))
    run.pin(*run.elements[:3])
    return run


def test_names_are_shown_as_they_are_and_do_nothing(tmp_path):
    run = evil(tmp_path)
    made = page(run, tmp_path)
    assert not made.tags & {"script", "i", "b"}
    for name in EVIL[:2] + EVIL[3:5]:
        assert name in made.text
    assert "\u202e" not in made.text and "\N{REPLACEMENT CHARACTER}abc`" in made.text
    run.close()


def test_markdown_is_the_same_with_pictures_beside_it(tmp_path):
    run = evil(tmp_path)
    file, *drawn = write_report(run.path, tmp_path / "a report.md")
    text = file.read_text()
    assert not re.search(
        r"(?<![\\`])<(script|i|b)\b", re.sub(r"(`+).*?(?<!`)\1(?!`)", "", text, flags=re.S)
    )
    assert "\\<script\\>alert(1)\\</script\\> # \\*x\\*" in text
    rows = [line for line in text.splitlines() if line.startswith("| ") and "static" in line]
    assert len(rows) == len(EVIL) and all(len(re.findall(r"(?<!\\)\|", row)) == 5 for row in rows)
    assert {path.name for path in drawn} == set(
        re.findall(r"\]\((.*?\.svg)\)", text.replace("%20", " "))
    )
    assert {file, *drawn} <= set(files_of(file))
    for path in drawn:
        assert ElementTree.fromstring(path.read_text()).tag.endswith("svg")
    run.close()


def test_nothing_is_overwritten_unless_asked(run, tmp_path):
    fake_moments.finished(run)
    file = tmp_path / "report.md"
    (tmp_path / "report.chart.svg").write_text("mine")
    with pytest.raises(UserError, match=r"report\.chart\.svg: exists already; .*--force"):
        write_report(run.path, file)
    assert not file.exists()
    write_report(run.path, file, force=True)
    assert (tmp_path / "report.chart.svg").read_text() != "mine"


def test_where_a_report_cannot_be_written_and_what_is_no_run(run, tmp_path):
    (tmp_path / "x.ddenv").write_text("no")
    for path, name, told in (
        (run.path, "report.pdf", "ends in .html or .md"),
        (run.path, "no/report.html", "there is no folder"),
        (tmp_path / "x.ddenv", "x.html", "is not a ddenv run file"),
    ):
        with pytest.raises(UserError, match=told):
            write_report(path, tmp_path / name)
        assert not (tmp_path / name).exists()


def test_very_many_rounds_are_summed_up(run, tmp_path):
    run.created().baseline()
    left = run.elements
    for number in range(1, 101):
        run.start_round(2, left)
        if number in (7, 8, 50):
            run.reduce(0, left := left[: round(len(left) / 2)], run.similar(0))
        else:
            run.dissimilar(0)
            run.dissimilar(1)
        run.write("round_finished")
    rows = rows_of(run, "round")
    assert len(rows) <= MOST_ROUNDS
    assert rows[:2] == [
        ("1", "2", "2 of 2", "none", "11", "8"),
        ("7", "2", "1 of 2", "part A", "6", "1"),
    ]
    assert [row[3] for row in rows] == ["none", "part A", "part A", "part A", "none"]
    assert len((tmp_path / write_report(run.path, tmp_path / "r.html")[0]).read_text()) < 100_000


def test_pictures_are_drawn_of_worlds_of_any_kind(tmp_path):
    empty = b'<sdf version="1.9"><world name="w"/></sdf>'
    bare = (
        b'<sdf version="1.9"><world name="w"><model name="ghost"><link '
        b'name="l"/></model></world></sdf>'
    )
    far = (
        fake_run.box("a", 0, 0)
        + fake_run.box("b", 9e5, 0)
        + fake_run.box("hall", 0, 0, size=(9e5, 9e5, 1))
    )
    huge = f'<sdf version="1.9"><world name="w">{far}</world></sdf>'.encode()
    for number, world in enumerate((empty, bare, huge)):
        run = fake_run.FakeRun(tmp_path / f"{number}.ddenv", fake_run.scenario(()), world)
        run.created().baseline()
        for section in content(read_run(run.path)).sections:
            for block in section.blocks:
                if isinstance(block, Picture):
                    ElementTree.fromstring(block.svg)
                    assert "nan" not in block.svg and "inf" not in block.svg
        run.close()
