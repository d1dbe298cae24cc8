"""The map of a world on a terminal."""

import re

import pytest

from ddenv.cli.world_map import terminal_map
from ddenv.text import width
from ddenv.world.load import SDF
from ddenv.world.sdf.read import read_world
from tests.map.worlds import GROUND, box, world_of

ESCAPE = re.compile("\x1b\\[[0-9;]*m")
CRATES = [
    GROUND,
    *(box(f"crate {number}", 3 * number, 0.5 * number, size=(1.5, 1.5, 1)) for number in range(6)),
]
NASTY = "\x7f[bold]<b>\u202e\"'"


def plain(text: str) -> list[str]:
    return ESCAPE.sub("", text).splitlines()


def picture(lines: list[str]) -> list[str]:
    """What is inside the frame."""
    return [re.split("[│┤]", line)[1] for line in lines if line.count("│") + line.count("┤") >= 2]


@pytest.mark.parametrize("color", [True, False])
@pytest.mark.parametrize("size", [(120, 36), (80, 24), (40, 12), (200, 60), (5, 3)])
@pytest.mark.parametrize("count", [0, 1, 6, 300])
def test_a_map_fits_the_terminal(size, count, color):
    models = [
        box(f"model with a long name {number}", number % 20, number // 20)
        for number in range(count)
    ]
    lines = plain(
        terminal_map(world_of(GROUND, *models), *size, color=color, spawn=(0, 0, 0), goal=(5, 5))
    )
    assert len(lines) <= max(size[1], 12)
    assert max(map(width, lines)) <= max(size[0], 40)


def test_the_ditch_is_seen_and_explained():
    world = read_world(SDF / "worlds" / "ditch.sdf")
    lines = terminal_map(
        world, 120, 36, color=False, spawn=(-6.5, 0, 0), goal=(6.5, 0)
    ).splitlines()
    assert lines[0] == "ditch.sdf · 43 models · S start (-6.5, 0), yaw 0 · G goal (6.5, 0)"
    assert any(
        re.search(r"^A  asphalt_\w+ +-?4\.2[01], 0\.00  8\.00 x 9\.00 x 2\.00", line)
        for line in lines
    )
    assert re.search(r"\.\.\. and \d+ more \(--svg FILE names them\)", "\n".join(lines))
    drawn = "".join(picture(lines))
    assert "S→" in drawn
    assert "G" in drawn
    assert len(set(drawn)) > 40


def test_without_colours_models_are_areas_of_their_letters():
    text = terminal_map(world_of(*CRATES), 100, 30, color=False)
    assert "\x1b" not in text
    lines = text.splitlines()
    drawn = "".join(picture(lines))
    for number in range(6):
        (sign,) = {
            match[1] for line in lines if (match := re.search(rf"(\S)  crate {number} ", line))
        }
        assert drawn.count(sign) >= 4


def test_with_colours_models_have_those_of_the_file():
    text = terminal_map(world_of(box("a", 0, 0, color="0.8 0.2 0.2 1")), 80, 24, color=True)
    assert "38;2;204;51;51" in text
    assert all(line.count("\x1b[0m") * 2 == line.count("\x1b[") for line in text.splitlines())


def test_numbers_along_the_axes_are_where_they_belong():
    lines = terminal_map(
        world_of(box("a", 0, 0), box("b", 10, 4)), 80, 24, color=False
    ).splitlines()
    frame = next(line for line in lines if "└" in line)
    numbers = lines[lines.index(frame) + 1]
    ticks = [match.start() for match in re.finditer("┬", frame)]
    zero = re.search(r"(?<!\d)0(?!\d)", numbers).start()
    assert zero in ticks
    row = next(line for line in lines if line.strip().startswith("0┤"))
    assert "AB"[row[zero] == "B"] in row[zero - 1 : zero + 2]


def test_names_cannot_steer_the_terminal():
    text = terminal_map(world_of(box(NASTY, 0, 0), file="\x1b[2J.sdf"), 80, 24, color=False)
    assert all(line.isprintable() for line in text.splitlines())
    assert "\N{REPLACEMENT CHARACTER}[bold]<b>" in text


def test_a_small_model_shows_in_colours_too():
    crates = [box(f"c{number}", 3 * number, 0) for number in range(8)]
    for height in (0.0, 0.2, 0.4, 0.6, 0.8):
        world = world_of(*crates, box("pebble", 5, 6 + height, size=(0.02, 0.02, 0.02)))
        lines = plain(terminal_map(world, 100, 30, color=True))
        (sign,) = {match[1] for line in lines if (match := re.search(r"(\S)  pebble ", line))}
        assert sign in "".join(picture(lines))
