"""Writing a world without some of its models, and files whole or not at all."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.world.access import write_file
from ddenv.world.load import SDF
from ddenv.world.sdf.read import parse_world, read_world
from ddenv.world.write import without
from tests.conftest import DATA

WALL = read_world(DATA / "wall.sdf")
DITCH = read_world(SDF / "worlds" / "ditch.sdf")


@given(removed=st.sets(st.sampled_from(DITCH.elements()), max_size=43))
def test_only_whole_lines_go(removed):
    """Every byte that is left was there, in the same order, and each model took just its own lines
    with it.
    """
    text = without(DITCH, frozenset(removed))
    spans = [DITCH.model(name).spans[0] for name in removed]
    gone = {number for start, end in spans for number in range(_line(start), _line(end) + 1)}
    lines = DITCH.text.split(b"\n")
    assert text == b"\n".join(line for number, line in enumerate(lines) if number not in gone)
    left = [model for model in DITCH.models if model.name not in removed]
    assert [model.links for model in parse_world(text, DITCH.path).models] == [
        model.links for model in left
    ]


def _line(index):
    return DITCH.text.count(b"\n", 0, index)


def test_models_on_one_line_leave_the_rest_of_it():
    one, two = (f"<model name='{name}'><link name='l'/></model>" for name in "ab")
    world = parse_world(
        f"<sdf version='1.9'><world name='w'>{one} {two}</world></sdf>".encode(), DATA
    )
    assert (
        without(world, frozenset("a"))
        == f"<sdf version='1.9'><world name='w'> {two}</world></sdf>".encode()
    )


def test_unknown_models_are_refused():
    with pytest.raises(ValueError, match="nobody"):
        without(WALL, frozenset(["nobody"]))


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "out.sdf"
    target.write_bytes(b"before")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match="No space left"):
        write_file(target, b"after")
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(UserError, match="cannot be written"):
        write_file(tmp_path / "nowhere" / "out.sdf", b"")
