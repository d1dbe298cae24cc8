"""OBJ and STL files, through trimesh. Of both only the shape is read: the files that an OBJ names are never opened."""

from __future__ import annotations

from io import BytesIO

from ddenv.world.files.triangles import Part, parts_of


def read_obj(data: bytes) -> list[Part]:
    """One part for each object and group (`o`, `g`) with faces; polygons become fans. Raises ValueError, IndexError."""
    import trimesh

    text, names = _plain(data.decode("utf-8", errors="replace"))
    scene = trimesh.load_scene(BytesIO(text.encode()), "obj", process=False, skip_materials=True, split_objects=True)
    if not names:
        return []
    return parts_of((names[number], scene.geometry[str(number)]) for number in range(len(names)))


def _plain(text: str) -> tuple[str, list[tuple[str, ...]]]:
    """The vertices and faces alone, in objects called 0, 1, ..., and the names of those.

    trimesh misreads without a word: numbers that count back, the number 0, lines that begin with or are parted by other than one
    blank, and corners with and without `/` in one object; and it joins the names of object and group to one.
    """
    vertices: list[str] = []
    objects: dict[tuple[str, ...], list[str]] = {}
    name, group = "", ""
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            vertices.append("v " + " ".join(rest[:3]))
        elif word == "f" and len(rest) > 2:
            corners = " ".join(str(_counted(corner, len(vertices))) for corner in rest)
            # A file without objects goes by its groups.
            objects.setdefault((name, group) if name else (group,), []).append("f " + corners)
        elif word == "o":
            name, group = " ".join(rest), ""
        elif word == "g":
            group = " ".join(rest)
    faces = [line for number, lines in enumerate(objects.values()) for line in (f"o {number}", *lines)]
    return "\n".join([*vertices, *faces]), list(objects)


def _counted(corner: str, vertices: int) -> int:
    """The number of a corner's vertex, from 1; negative ones count back from the last of the `vertices` before the face."""
    number = int(corner.partition("/")[0])
    counted = number if number > 0 else vertices + 1 + number
    if number == 0 or counted < 1:
        raise ValueError(f"a face names the vertex {number}, which is not there")
    return counted


def read_stl(data: bytes) -> list[Part]:
    """The triangles of a binary or ASCII file; STL has no units, so its numbers are m. Raises ValueError."""
    import trimesh

    end = 84 + 50 * int.from_bytes(data[80:84], "little")
    if data.lstrip()[:5].lower() != b"solid":
        # trimesh takes a binary file for text if anything follows its triangles.
        data = data[: max(end, 84)]
    elif len(data) != end:
        # A name that is not UTF-8 would need a library that guesses encodings.
        data = data.decode("utf-8", errors="replace").encode()
    scene = trimesh.load_scene(BytesIO(data), "stl", process=False)
    return parts_of(((), mesh) for mesh in scene.geometry.values())
