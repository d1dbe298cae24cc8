"""What is said of meshes whose convex pieces block the floor otherwise than they do."""

from __future__ import annotations

import numpy as np
import trimesh

from ddenv.world.files.floor_error import note_pieces

MODEL = (
    "<model name='{0}'><static>true</static><link name='l'><collision name='c'><geometry><mesh>"
    "<uri>{0}.obj</uri></mesh></geometry></collision></link></model>"
)


def test_pieces_that_are_like_their_mesh_are_not_named_unless_it_is_too_fine_to_compare(
    read, tmp_path, monkeypatch
):
    # A round wall without a bottom, of one layer of triangles; and one of boxes.
    wall = trimesh.creation.cylinder(radius=0.5, height=1.0, sections=300)
    sides = wall.faces[np.abs(wall.face_normals[:, 2]) < 0.5]
    trimesh.Trimesh(wall.vertices, sides).export(tmp_path / "bin.obj")
    parts = [trimesh.creation.box((1.0, 0.2, 1.0)), trimesh.creation.box((0.2, 1.0, 1.0))]
    parts[1].apply_translation((2.0, 0.0, 0.0))
    trimesh.util.concatenate(parts).export(tmp_path / "boxes.obj")
    text = MODEL.format("bin") + MODEL.format("boxes")
    world = read(text)
    assert list(note_pieces(world, world.names)) == []
    monkeypatch.setattr("ddenv.world.files.meshes.MOST_DRAWN", 100)
    world = read(text)
    ((about, said),) = note_pieces(world, world.names)
    assert about == "pieces"
    assert "bin (" in said and "pieces: perhaps; its mesh is too fine to compare)" in said
