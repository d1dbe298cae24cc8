"""Meshes are cut in other processes: what ends these, or hangs in them, costs the pieces of one
mesh and nothing else.
"""

import os
import signal
import subprocess
import sys

import pytest

from ddenv.errors import UserError
from ddenv.world.files import cutting
from ddenv.world.files.meshes import pack_pieces
from ddenv.world.files.pieces import convex_pieces
from ddenv.world.files.resources import MeshPart, Resources
from ddenv.world.files.roots import search_roots
from ddenv.world.files.watch import watched
from ddenv.world.model import UNCUT
from ddenv.world.pose import ONE
from ddenv.world.scenario import PLAIN
from ddenv.world.sdf.read import parse_world, read_world
from tests.waiting import PATIENCE
from tests.world.files.cutters import PYRAMID, Cutters, write_world

# Four walls in an L are two boxes.
CORNER = "\n".join(
    [f"v {x} {y} {z}" for z in (0, 1) for x, y in ((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3))]
    + ["f 1 6 5 4 3 2", "f 7 8 9 10 11 12"]
    + [f"f {one} {one % 6 + 1} {one % 6 + 7} {one + 6}" for one in range(1, 7)]
)


@pytest.fixture
def cutters(tmp_path, home, monkeypatch):
    def use(*given):
        made = Cutters(tmp_path, *given)
        monkeypatch.setattr(cutting, "COMMAND", made.command)
        return made

    return use


@pytest.mark.parametrize("deed", ["crashes", "ends", "raises"])
def test_a_mesh_that_ends_its_process_is_its_hull_and_the_world_says_so(
    tmp_path, cutters, command, deed
):
    processes = cutters(deed)
    file = write_world(tmp_path, ("corner", CORNER), ("roof", PYRAMID))
    world = read_world(file)
    assert len(world.model("corner").collisions) == 2
    (hull,) = world.model("roof").collisions
    assert len(hull.shape.vertices) == 5
    assert [note.model for note in world.notes if UNCUT in note.why] == ["roof"]
    assert processes.left() == []
    started = processes.started()
    said = command("world", "check", file)
    (line,) = [line for line in said.stdout.splitlines() if "otherwise than their mesh" in line]
    assert line.endswith(f": roof (its hull: {UNCUT})")
    # This program does not try it again, and a run knows it too.
    assert processes.started() == started
    again = parse_world(world.text, file, PLAIN, Resources(world.resources))
    assert again == world
    assert again.notes == world.notes


@pytest.mark.parametrize("deed", ["computes", "hangs"])
def test_a_mesh_that_takes_too_long_is_its_hull(tmp_path, cutters, deed):
    processes = cutters(deed, 0.1)
    world = read_world(write_world(tmp_path, ("roof", PYRAMID)))
    assert [note.model for note in world.notes if UNCUT in note.why] == ["roof"]
    assert processes.left() == []


def test_whoever_watches_can_stop_it_and_no_process_is_left(tmp_path, cutters, monkeypatch):
    processes = cutters("hangs")
    monkeypatch.setattr(cutting, "SLOW", 0.0)

    def stop(words):
        if words:
            assert words == "cutting meshes into convex pieces: 0 of 1"
            processes.wait()
            raise UserError("stopped")

    with pytest.raises(UserError, match="stopped"), watched(stop):
        read_world(write_world(tmp_path, ("roof", PYRAMID)))
    assert processes.left() == []


def test_ctrl_c_stops_a_command_that_waits_for_a_cut(tmp_path, cutters):
    processes = cutters("hangs")
    code = (
        "import sys\nfrom ddenv.world.files import cutting\nfrom ddenv.cli import main\n"
        f"cutting.COMMAND = {processes.command!r}\nmain()"
    )
    words = [
        sys.executable,
        "-c",
        code,
        "world",
        "check",
        str(write_world(tmp_path, ("roof", PYRAMID))),
    ]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    ) as program:
        first = program.stderr.readline()
        processes.wait()
        # As the terminal does, to all processes.
        os.killpg(program.pid, signal.SIGINT)
        printed, said = program.communicate(timeout=PATIENCE)
    assert first == b"cutting meshes into convex pieces: 0 of 1\n"
    assert (program.returncode, printed, said.strip()) == (130, b"", b"")
    assert processes.left() == []


def test_pieces_are_to_the_bit_those_that_this_process_would_cut(tmp_path, home):
    write_world(tmp_path, ("corner", CORNER), ("roof", PYRAMID))
    disk = Resources({}, search_roots((), tmp_path))
    parts = [MeshPart(f"{name}.obj", tmp_path) for name in ("corner", "roof")]
    for part in parts:
        assert disk.pieces(part, ONE, 8) == []
    expected = {file: pack_pieces(convex_pieces(*mesh)) for file, mesh in disk.uncut.items()}
    assert disk.cut()
    assert [len(disk.pieces(part, ONE, 8)) for part in parts] == [2, 1]
    assert {file: file.read_bytes() for file in expected} == expected
    assert not disk.cut()
