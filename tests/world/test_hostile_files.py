"""Files that mean harm, or that nobody looked at, beside a world: one line, exit code 2, and
soon.
"""

import os
import re

import pytest

from tests.tiers import slow
from tests.world.hostile import (
    AT_ONCE,
    LAUGHS,
    LINK,
    MODEL,
    check_bounded,
    include,
    read_or_refused,
    refusal,
    sdf_model,
    shape,
    world,
)


@pytest.fixture
def refused(tmp_path):
    """What a bounded process says against a world of this text."""

    def run(text, **options):
        path = tmp_path / "hostile.world"
        path.write_bytes(text)
        return refusal(check_bounded(path, **options), tmp_path)

    return run


@pytest.mark.parametrize("place", slow(pytest.mark.fuzz, ["here", "include", "mesh"], but=["mesh"]))
def test_defaults_of_a_document_type_never_fill_the_memory(tmp_path, refused, place):
    """A few bytes of such a file can stand for many GB, with no entity in it."""
    bomb = f'<!DOCTYPE x [<!ATTLIST a x CDATA "{"y" * 1_000_000}">]>'
    inside = "<a/>" * 10_000
    texts = {
        "here": world(MODEL + inside, before=bomb),
        "include": world(include("bomb.sdf")),
        "mesh": shape("<mesh><uri>bomb.dae</uri></mesh>"),
    }
    (tmp_path / "bomb.sdf").write_text(f"{bomb}<sdf version='1.9'>{MODEL}{inside}</sdf>")
    (tmp_path / "bomb.dae").write_text(f"{bomb}<COLLADA>{inside}</COLLADA>")
    refused(texts[place])


@pytest.mark.parametrize("entity", ["'ha'", "SYSTEM 'file:///etc/passwd'"])
def test_entities_are_refused_in_included_files_too(check, tmp_path, entity):
    text = (
        f"<!DOCTYPE sdf [<!ENTITY l0 {entity}>{LAUGHS}]><sdf version='1.9'><model "
        "name='m'>&l9;</model></sdf>"
    )
    (tmp_path / "bomb.sdf").write_text(text)
    said, path = check(world(include("bomb.sdf")))
    assert re.search(r"/bomb\.sdf:1:1: DOCTYPE is not allowed \(its entities", refusal(said, path))


@pytest.mark.parametrize("suffix", ["dae", "obj", "stl", "gltf", "glb"])
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 200, b"v 0 0 0\nf 1 2 3\n", b"{" * 5000, b"<a>" * 5000, b"[1e999]"]
)
def test_a_mesh_that_is_none_is_refused_where_it_is_named(check, tmp_path, suffix, content):
    (tmp_path / f"mesh.{suffix}").write_bytes(content)
    assert re.match(
        r":1: /sdf/world/\S+/mesh: ",
        refusal(*check(shape(f"<mesh><uri>mesh.{suffix}</uri></mesh>"))),
    )


def test_a_gigabyte_is_refused_at_once(tmp_path):
    path = tmp_path / "large.world"
    with path.open("wb") as file:
        file.truncate(1 << 30)
    assert "too large" in refusal(check_bounded(path, seconds=AT_ONCE), path)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("", "is a folder"),
        ("none.world", "no such file"),
        ("none/none.world", "no such"),
        ("a" * 300, "too long"),
        ("a\nb", "no such"),
        ("loop.world", "ymbolic links"),
    ],
)
def test_a_folder_and_a_file_that_is_missing_are_refused(tmp_path, check_file, name, words):
    (tmp_path / "loop.world").symlink_to(tmp_path / "loop.world")
    assert words in refusal(check_file(tmp_path / name), tmp_path)


@pytest.mark.parametrize(
    "name", slow(pytest.mark.fuzz, ["/dev/zero", "/dev/null", "/dev/tty"], but=["/dev/zero"])
)
def test_a_device_is_refused(name):
    refusal(check_bounded(name, seconds=AT_ONCE), name)


def test_a_pipe_is_refused_and_not_waited_on(tmp_path, refused):
    path = tmp_path / "pipe.world"
    os.mkfifo(path)
    refusal(check_bounded(path, seconds=AT_ONCE), path)
    os.mkfifo(tmp_path / "pipe.obj")
    for text in (world(include("pipe.world")), shape("<mesh><uri>pipe.obj</uri></mesh>")):
        refused(text, seconds=AT_ONCE)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read_is_refused(tmp_path, check_file):
    path = tmp_path / "secret.world"
    path.write_bytes(world(MODEL))
    path.chmod(0)
    assert "ermission" in refusal(check_file(path), path)
    other = tmp_path / "hostile.world"
    other.write_bytes(world(include("secret.world")))
    assert "ermission" in refusal(check_file(other), other)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_files_that_include_each_other_are_refused(check, tmp_path, count):
    for number in range(count):
        (tmp_path / f"f{number}.sdf").write_text(
            sdf_model("m", include(f"f{(number + 1) % count}.sdf"))
        )
    said, _ = check(world(include("f0.sdf")))
    cycle = " includes ".join(f"f{number}.sdf" for number in (*range(count), 0))
    assert f"form a cycle: {cycle}" in refusal(said, tmp_path)
    assert re.match(rf"ddenv: {tmp_path}/f\d.sdf:1: /sdf/model\[@name='m'\]/include: ", said.stderr)


def test_files_that_include_each_other_through_a_linked_folder_are_refused(tmp_path, refused):
    (tmp_path / "again").symlink_to(tmp_path)
    (tmp_path / "f.sdf").write_text(
        sdf_model("m", include("again/f.sdf") + include("again/f.sdf", "<name>n</name>"))
    )
    refused(world(include("f.sdf")))


@pytest.mark.parametrize(
    "last", slow(pytest.mark.fuzz, [LINK, ""]), ids=["with a link", "with nothing"]
)
def test_includes_that_multiply_are_bounded(tmp_path, refused, last):
    """Nine files, ten includes in each: a thousand million links."""
    for number in range(9):
        inside = "".join(
            include(f"f{number + 1}.sdf", f"<name>n{copy}</name>") for copy in range(10)
        )
        (tmp_path / f"f{number}.sdf").write_text(sdf_model("m", inside))
    (tmp_path / "f9.sdf").write_text(sdf_model("m", last))
    refused(world(include("f0.sdf")))


def test_a_long_row_of_files_is_read_or_refused(tmp_path):
    for number in range(300):
        (tmp_path / f"f{number}.sdf").write_text(sdf_model("m", include(f"f{number + 1}.sdf")))
    (tmp_path / "f300.sdf").write_text(sdf_model("m", LINK))
    path = tmp_path / "hostile.world"
    path.write_bytes(world(include("f0.sdf")))
    read_or_refused(check_bounded(path), tmp_path)
