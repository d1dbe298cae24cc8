"""The panels' text, without an app."""

from pathlib import Path

import fake_moments
import fake_run
import pytest

from ddenv.map.footprints import footprints
from ddenv.runfile.fold import fold
from ddenv.runfile.snapshot import Snapshot
from ddenv.text import about, duration, percent, plain, truncated
from ddenv.words.signs import brief, metres
from ddenv.workbench.map.map_colors import mixed
from ddenv.workbench.map.model_looks import FLOOR, KEPT, LEFT_OUT, PROTECTED, REMOVED, kept, looks
from ddenv.workbench.map.place import Shown
from ddenv.workbench.shared.processes import last_line
from ddenv.world.sdf.read import parse_world


def snapshot(run, engine="alive") -> Snapshot:
    return Snapshot(state=fold(run.file.events()), live=tuple(run.file.live()), engine=engine)


WORDS = (
    (duration, {0: "0 s", 59.4: "59 s", 100: "1 min 40 s", 7500: "2 h 05 min"}),
    # In a table they are short.
    (brief, {0.42: "0.4 s", 9.96: "10 s", 312: "312 s", 1500: "25 min", 40_000: "11 h"}),
    # What is not known exactly is rounded.
    (
        lambda times: about(*times),
        {(8.1, 4.2, 22): "8 s (4 to 20)", (122, 61, 301): "2 min (1 to 5)"},
    ),
    (
        lambda times: about(*times),
        {(1,): "1 s", (9000, 3000, 40_000): "2 h (1 to 10)", (0, 0, 0): "1 s"},
    ),
    # Percentages are never rounded to certainty.
    (percent, {0: "0 %", 0.001: "<1 %", 0.5: "50 %", 0.999: ">99 %", 1: "100 %"}),
    (metres, {None: "", "x": "", float("nan"): "", float("inf"): ""}),
)


@pytest.mark.parametrize(("say", "told"), WORDS)
def test_numbers_are_worded(say, told):
    assert {number: say(number) for number in told} == told


def test_names_cannot_steer_the_terminal():
    assert plain("a\x1b[31m\nb\x07") == "a�[31m b�"
    assert truncated("abcdef", 4) == "abc…"


def looks_of(run, candidate=None):
    state = fold(run.file.events())
    prints = footprints(parse_world(run.world, Path("w.sdf")))
    chosen = state.round.candidates[candidate] if candidate is not None else None
    how = looks(
        prints,
        kept(Shown(snapshot=Snapshot(state=state), candidate=chosen)),
        mixed((0, 0, 0), (255, 255, 255)),
    )
    return {
        each.name: (kind, label)
        for each, kind, label in zip(prints, how.kinds, how.signs.texts, strict=True)
    }


def test_kept_models_carry_the_letter_of_their_part_and_removed_ones_none(run, runs):
    drawn = looks_of(fake_moments.mid_round(run))
    assert drawn["crate_00"] == (KEPT, "A")
    assert drawn["crate_05"] == (KEPT, "C")
    assert drawn["crate_10"] == (REMOVED, "")
    assert drawn["floor"] == (PROTECTED, "#")
    # What a candidate leaves out gets a small letter.
    drawn = looks_of(run, candidate=1)
    assert drawn["crate_00"] == (LEFT_OUT, "a")
    assert drawn["crate_02"] == (KEPT, "B")
    # A large element is a floor.
    other = fake_run.FakeRun(runs / "x.ddenv", fake_run.scenario(protected=())).created().baseline()
    other.start_round(2)
    assert looks_of(other)["floor"] == (FLOOR, "A")
    other.close()


def test_the_last_line_of_a_log(tmp_path):
    log = tmp_path / "log"
    assert last_line(log) == ""
    log.write_bytes(b"one\ntwo \x1b[0m\n\n")
    assert last_line(log) == "two �[0m"
