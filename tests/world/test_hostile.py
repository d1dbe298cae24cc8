"""Files that mean harm, or that nobody looked at: one line, exit code 2, and soon."""

import os
import re
import resource
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

from ddenv.cli import main
from tests.tiers import slow
from tests.waiting import PATIENCE

# Bytes, and seconds of CPU: generous for a slow machine, and other work on it does not count.
MEMORY = 3 << 30
SECONDS = 30
AT_ONCE = 10
BOX = "<geometry><box><size>1 2 3</size></box></geometry>"
LINK = f"<link name='l'><collision name='c'>{BOX}</collision></link>"
MODEL = f"<model name='m'>{LINK}</model>"


def world(inside: str, version: str = "1.9", before: str = "") -> bytes:
    return f"{before}<sdf version='{version}'><world name='w'>{inside}</world></sdf>".encode()


def model(inside: str, name: str = "m") -> bytes:
    return world(f"<model name='{name}'>{inside}</model>")


def shape(inside: str) -> bytes:
    return model(f"<link name='l'><collision name='c'><geometry>{inside}</geometry></collision></link>")


def include(uri: str, more: str = "") -> str:
    return f"<include><uri>{uri}</uri>{more}</include>"


def joint(inside: str, kind: str = "revolute", name: str = "j") -> str:
    return f"<joint name='{name}' type='{kind}'>{inside}</joint>"


def ends(parent: str, child: str) -> str:
    return f"<parent>{parent}</parent><child>{child}</child>"


def links(count: int) -> str:
    return "".join(f"<link name='l{number}'/>" for number in range(count))


@dataclass(frozen=True)
class Said:
    """What a command left: its exit code and all that it printed."""

    code: int
    out: str
    err: str


def in_process(monkeypatch, capsys, *arguments: object) -> Said:
    """`ddenv world check`, without a process of its own; a warning counts as a line, since it would be printed."""
    monkeypatch.setattr(sys, "argv", ["ddenv", "world", "check", *map(str, arguments)])
    with warnings.catch_warnings(record=True) as told, pytest.raises(SystemExit) as left:
        warnings.simplefilter("always")
        # It would not be printed, and is of whatever garbage is collected just now.
        warnings.simplefilter("ignore", ResourceWarning)
        main()
    printed = capsys.readouterr()
    code = left.value.code or 0
    return Said(code, printed.out, printed.err + "".join(f"{each.message}\n" for each in told))


def in_own_process(*arguments: object, seconds: int = SECONDS, **environment: str) -> Said:
    """`ddenv world check` as a user starts it, with an end to its time and its memory."""

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))

    done = subprocess.run(
        [sys.executable, "-m", "ddenv", "world", "check", *map(str, arguments)],
        capture_output=True,
        timeout=PATIENCE,
        stdin=subprocess.DEVNULL,
        preexec_fn=bounded,
        env={**os.environ, **environment},
    )
    return Said(done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace"))


def refusal(said: Said, path: Path | str) -> str:
    """The one line of a refusal, after the name of the program and of the file."""
    assert "Traceback" not in said.err, said.err[-2000:]
    assert (said.code, said.out) == (2, ""), said
    assert said.err.endswith("\n") and said.err.count("\n") == 1, said.err[-2000:]
    line = said.err[:-1]
    assert line.isprintable()
    assert line.startswith(f"ddenv: {path}"), line
    return line.removeprefix(f"ddenv: {path}")


def read_or_refused(said: Said, path: Path) -> None:
    if said.code == 0:
        assert said.err == ""
        assert all(line.isprintable() for line in said.out.splitlines()), said.out
    else:
        refusal(said, path)


@pytest.fixture
def check(tmp_path, monkeypatch, capsys):
    """Checks a world of the given text, in a folder of its own."""

    def run(text: bytes, *arguments: str) -> tuple[Said, Path]:
        path = tmp_path / "hostile.world"
        path.write_bytes(text)
        return in_process(monkeypatch, capsys, path, *arguments), path

    return run


LAUGHS = "".join(f"<!ENTITY l{i + 1} '{f'&l{i};' * 10}'>" for i in range(9))
NO_XML = {
    "nothing": b"",
    "blanks": b" \n\t\n",
    "words": b"a world, please",
    "bytes": bytes(range(256)),
    "zeros": b"\0" * 1000,
    "cut in a tag": world(MODEL)[:60],
    "cut in an attribute": world(MODEL)[:38],
    "cut before the end": world(MODEL)[:-6],
    "two roots": world(MODEL) * 2,
    "words behind": world(MODEL) + b"more",
    "tags that cross": b"<sdf version='1.9'><world name='w'><a><b></a></b></world></sdf>",
    "an attribute twice": b"<sdf version='1.9' version='1.9'/>",
    "an unquoted attribute": b"<sdf version=1.9/>",
    "a bare ampersand": model(LINK, "a & b"),
    "an unknown entity": model("<pose>&nbsp;</pose>" + LINK),
    "UTF-16 with its mark": world(MODEL).decode().encode("utf-16"),
    "UTF-16 without a mark": world(MODEL).decode().encode("utf-16-be"),
    "UTF-16 as it says": b"<?xml version='1.0' encoding='utf-16'?>" + world(MODEL),
    "UTF-32": world(MODEL).decode().encode("utf-32"),
    "an encoding nobody knows": b"<?xml version='1.0' encoding='klingon'?>" + world(MODEL),
    "an encoding that is none": b"<?xml version='1.0' encoding='zip'?>" + world(MODEL),
    "an encoding of many bytes": b"<?xml version='1.0' encoding='shift_jis'?>" + world(MODEL),
    "bytes that are no UTF-8": model(LINK).replace(b"'m'", b"'\xff\xfe'"),
    "a lone surrogate by number": model(LINK, "&#xD800;"),
    "a lone surrogate in bytes": model(LINK).replace(b"'m'", b"'\xed\xa0\x80'"),
    "a NUL by number": model(LINK, "&#0;"),
    "a NUL in a name": model(LINK).replace(b"'m'", b"'\0'"),
    "an escape code in a name": model(LINK, "\x1b[31m"),
    "a billion laughs": world(MODEL, before=f"<!DOCTYPE sdf [<!ENTITY l0 'ha'>{LAUGHS}]>") + b"&l9;",
    "a quadratic blowup": world("&a;" * 1000, before=f"<!DOCTYPE sdf [<!ENTITY a '{'a' * 10000}'>]>"),
    "an external entity": world("&a;", before="<!DOCTYPE sdf [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>"),
    "an endless external entity": world("&a;", before="<!DOCTYPE sdf [<!ENTITY a SYSTEM 'file:///dev/zero'>]>"),
    "an entity from the network": world("&a;", before="<!DOCTYPE sdf [<!ENTITY a SYSTEM 'http://localhost:1/'>]>"),
    "a parameter entity": world("", before="<!DOCTYPE sdf [<!ENTITY % a SYSTEM 'file:///etc/passwd'> %a;]>"),
    "an entity of a DTD elsewhere": world("&a;", before="<!DOCTYPE sdf SYSTEM 'file:///etc/passwd'>"),
    "another kind of file": b"<html><body><p>404</p></body></html>",
    "no world": b"<sdf version='1.9'/>",
    "a model alone": b"<sdf version='1.9'>" + MODEL.encode() + b"</sdf>",
    "two worlds": b"<sdf version='1.9'><world name='a'/><world name='b'/></sdf>",
}


@pytest.mark.parametrize("name", NO_XML)
def test_what_is_no_world_is_refused_in_one_line(check, name):
    refusal(*check(NO_XML[name]))


@pytest.mark.parametrize(
    "version", ["", " ", "1", "1.3", "1.13", "1.99", "2.0", "-1.6", "nan", "1.6.0", "6", "9" * 5000]
)
def test_unknown_versions_are_refused(check, version):
    assert re.match(r":1: /sdf: ", refusal(*check(world(MODEL, version))))


def test_a_missing_version_is_refused(check):
    assert re.match(r":1: /sdf: ", refusal(*check(b"<sdf><world name='w'/></sdf>")))


BAD_POSES = ("nan 0 0 0 0 0", "0 inf 0 0 0 0", "0 0 -inf 0 0 0", "0 0 0 nan 0 0", "1e400 0 0 0 0 0", "1e308 0 0 0 0 0")
NO_POSES = ("0 0 0", "0 0 0 0 0 0 0", "a b c d e f", "0,0,0,0,0,0", "0x1 0 0 0 0 0", "1_0 0 0 0 0 0", "0 " * 100_000)
HOLDERS = {
    "model": f"<model name='m'>%s{LINK}</model>",
    "link": "<model name='m'><link name='l'>%s</link></model>",
    "collision": f"<model name='m'><link name='l'><collision name='c'>%s{BOX}</collision></link></model>",
    "visual": f"<model name='m'><link name='l'><visual name='v'>%s{BOX}</visual></link></model>",
    "state": f"{MODEL}<state world_name='w'><model name='m'>%s</model></state>",
    "link in state": f"{MODEL}<state world_name='w'><model name='m'><link name='l'>%s</link></model></state>",
}


@pytest.mark.parametrize("pose", BAD_POSES + NO_POSES, ids=lambda pose: pose[:16])
@pytest.mark.parametrize("holder", HOLDERS)
def test_a_pose_that_is_none_is_refused_where_it_stands(check, holder, pose):
    line = refusal(*check(world(HOLDERS[holder] % f"<pose>{pose}</pose>")))
    assert re.match(r":1: /sdf/world/\S+/pose: ", line), line


SIZES = ("0", "-1", "nan", "inf", "-inf", "1e308", "", "large", "1e-320")
SHAPES = {
    "size": "<box><size>1 1 {}</size></box>",
    "radius": "<sphere><radius>{}</radius></sphere>",
    "length": "<cylinder><radius>1</radius><length>{}</length></cylinder>",
    "radii": "<ellipsoid><radii>1 {} 1</radii></ellipsoid>",
    "height": "<polyline><height>{}</height><point>0 0</point><point>1 0</point><point>0 1</point></polyline>",
}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("tag", SHAPES)
def test_a_size_that_no_thing_has_is_refused_where_it_stands(check, tag, size):
    line = refusal(*check(shape(SHAPES[tag].format(size))))
    assert re.match(rf":1: /sdf/world/\S+/geometry/\w+/{tag}: ", line), line


@pytest.mark.parametrize("scale", ["0 1 1", "-1 1 1", "nan 1 1", "1 1", "1e-320 1 1", "1e-200 1e-200 1e-200"])
def test_a_saved_scale_that_leaves_nothing_is_refused(check, scale):
    said, path = check(world(f"{MODEL}<state world_name='w'><model name='m'><scale>{scale}</scale></model></state>"))
    assert re.match(r":1: /sdf/world/", refusal(said, path))


NO_SHAPES = {
    "no geometry": model("<link name='l'><collision name='c'/></link>"),
    "an empty geometry": shape(""),
    "an unknown shape": shape("<torus/>"),
    "a box without size": shape("<box/>"),
    "a normal of no length": shape("<plane><normal>0 0 0</normal></plane>"),
    "a heightmap": shape("<heightmap><uri>h.png</uri></heightmap>"),
    "points in a line": shape("<polyline><point>0 0</point><point>1 1</point><point>2 2</point></polyline>"),
    "a point of NaN": shape("<polyline><point>0 0</point><point>nan 1</point><point>2 2</point></polyline>"),
    "a mesh without a file": shape("<mesh/>"),
    "a mesh scaled to nothing": shape("<mesh><uri>a.obj</uri><scale>0 0 0</scale></mesh>"),
    "friction below zero": model(
        f"<link name='l'><collision name='c'>{BOX}<surface><friction><ode><mu>-1</mu></ode></friction></surface>"
        "</collision></link>"
    ),
    "a model without links": model(""),
    "models inside from a population": world("<population name='p'/>"),
    "two states": world("<state/><state/>"),
}


@pytest.mark.parametrize("name", NO_SHAPES)
def test_what_cannot_be_built_is_refused_where_it_stands(check, name):
    assert re.match(r":1: /sdf/world/", refusal(*check(NO_SHAPES[name])))


TWO = "<link name='a'/><link name='b'/>"
HINGE = "<axis><xyz>0 0 1</xyz>%s</axis>"
JOINTS = {
    "a loop of two": TWO + joint(ends("a", "b"), "fixed", "j") + joint(ends("b", "a"), "fixed", "k"),
    "a loop of three": links(3) + "".join(joint(ends(f"l{i}", f"l{(i + 1) % 3}"), "fixed", f"j{i}") for i in range(3)),
    "two parents": links(3) + joint(ends("l0", "l2"), "fixed", "j") + joint(ends("l1", "l2"), "fixed", "k"),
    "itself": TWO + joint(ends("a", "a"), "fixed"),
    "a child that is nowhere": TWO + joint(ends("a", "c"), "fixed"),
    "a parent that is nowhere": TWO + joint(ends("c", "a"), "fixed"),
    "no child": TWO + joint("<parent>a</parent>", "fixed"),
    "no ends": TWO + joint("", "fixed"),
    "the world as a child": TWO + joint(ends("a", "world"), "fixed"),
    "a joint as its own child": TWO + joint(ends("a", "j"), "fixed"),
    "no type": TWO + f"<joint name='j'>{ends('a', 'b')}</joint>",
    "a type that is unknown": TWO + joint(ends("a", "b"), "telepathic"),
    "a screw": TWO + joint(ends("a", "b"), "screw"),
    "no axis": TWO + joint(ends("a", "b")),
    "an axis of no length": TWO + joint(ends("a", "b") + "<axis><xyz>0 0 0</xyz></axis>"),
    "an axis of NaN": TWO + joint(ends("a", "b") + "<axis><xyz>nan 0 0</xyz></axis>"),
    "limits the wrong way round": TWO
    + joint(ends("a", "b") + HINGE % "<limit><lower>1</lower><upper>0</upper></limit>"),
    "a lower limit of NaN": TWO + joint(ends("a", "b") + HINGE % "<limit><lower>nan</lower></limit>"),
    "a lower limit that is out of reach": TWO + joint(ends("a", "b") + HINGE % "<limit><lower>1e20</lower></limit>"),
    "an upper limit that is out of reach": TWO + joint(ends("a", "b") + HINGE % "<limit><upper>-1e20</upper></limit>"),
    "damping below zero": TWO + joint(ends("a", "b") + HINGE % "<dynamics><damping>-1</damping></dynamics>"),
    "axes that are parallel": TWO
    + joint(ends("a", "b") + "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2>", "universal"),
    "one name for two links": "<link name='a'/><link name='a'/>",
}


@pytest.mark.parametrize("name", JOINTS)
def test_joints_that_cannot_be_are_refused_where_they_stand(check, name):
    assert re.match(r":1: /sdf/world/model\[@name='m'\]", refusal(*check(model(JOINTS[name]))))


def frame(name: str, relative_to: str) -> str:
    return f"<frame name='{name}'><pose relative_to='{relative_to}'>0 0 1 0 0 0</pose></frame>"


def attached(name: str, to: str) -> str:
    return f"<frame name='{name}' attached_to='{to}'/>"


USE = "<pose relative_to='a'>0 0 0 0 0 0</pose>"
CIRCLES = {
    "a frame relative to itself": frame("a", "a") + f"<model name='m'>{USE}{LINK}</model>",
    "two frames": frame("a", "b") + frame("b", "a") + f"<model name='m'>{USE}{LINK}</model>",
    "three frames": frame("a", "b") + frame("b", "c") + frame("c", "a") + f"<model name='m'>{USE}{LINK}</model>",
    "frames attached": attached("a", "b") + attached("b", "a") + f"<model name='m'>{USE}{LINK}</model>",
    "a model relative to itself": f"<model name='a'>{USE}{LINK}</model>",
    "models relative to each other": "".join(
        f"<model name='{name}'><pose relative_to='{other}'/>{LINK}</model>" for name, other in ("ab", "ba")
    ),
    "two links": "<model name='m'><link name='a'><pose relative_to='b'/></link><link name='b'>"
    "<pose relative_to='a'/></link></model>",
    "a joint and its child": "<model name='m'><link name='p'/><link name='a'><pose relative_to='j'/></link>"
    + joint(ends("p", "a"), "fixed")
    + "</model>",
    "a frame that is nowhere": f"<model name='m'>{USE}{LINK}</model>",
    "a frame of another model": f"<model name='m'>{LINK}<link name='k'><pose relative_to='o'/></link></model>"
    f"<model name='o'>{LINK}</model>",
    "a placement frame that is nowhere": f"<model name='m' placement_frame='a'>{LINK}</model>",
}


@pytest.mark.parametrize("name", CIRCLES)
def test_frames_that_lead_nowhere_are_refused_where_they_stand(check, name):
    assert re.match(r":1: /sdf/world/", refusal(*check(world(CIRCLES[name]))))


NAMELESS = {
    "model": f"<model>{LINK}</model>",
    "link": "<model name='m'><link/></model>",
    "collision": f"<model name='m'><link name='l'><collision>{BOX}</collision></link></model>",
    "visual": f"<model name='m'><link name='l'><visual>{BOX}</visual></link></model>",
    "joint": f"<model name='m'>{TWO}<joint type='fixed'>{ends('a', 'b')}</joint></model>",
    "frame": f"<model name='m'>{LINK}<frame/><link name='k'><pose relative_to='l'/></link></model>",
}


@pytest.mark.parametrize("given", ["", " name=''", " name='  '", " name='&#10;'"])
@pytest.mark.parametrize("tag", NAMELESS)
def test_a_missing_name_is_refused_where_it_is_missing(check, tag, given):
    text = NAMELESS[tag].replace(f"<{tag}>", f"<{tag}{given}>").replace(f"<{tag}/>", f"<{tag}{given}/>")
    text = text.replace(f"<{tag} type", f"<{tag}{given} type")
    line = refusal(*check(world(text)))
    assert re.match(rf":1: /sdf/world\S*/{tag}(\[@name='\s*'\])?: ", line), line


URIS = (
    "../../../../../../etc/passwd",
    "a/../../../../../../../etc/passwd",
    "%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
    "..%2f..%2f..%2f..%2fetc/passwd",
    "file://../../../etc/passwd",
    "file:///etc/passwd",
    "file:///dev/zero",
    "/dev/zero",
    "/dev/tty",
    "/proc/self/mem",
    "model://../../etc/passwd",
    "model://a/../../../etc",
    "model://%2e%2e/%2e%2e/etc/passwd",
    "package://../x",
    "http://localhost:1/model.sdf",
    "https://fuel.gazebosim.org/1.0/../models/../../x",
    "https://fuel.gazebosim.org/1.0/o/models/m/1/files/../../../../x",
    "ftp://localhost/x",
    "javascript:alert(1)",
    "model://",
    "file://",
    "..",
    ".",
    "/",
    "~",
    "~nobody/x",
    "%00",
    "a%00b",
    "%ff%fe",
    "a" * 5000,
    "a/" * 5000,
    "\\\\server\\share",
    "C:\\Windows\\win.ini",
    "hostile.world",
    "./hostile.world",
    "x/../hostile.world",
    "&#x9b;31mred",
    "one&#10;two",
    "🦊",
)


@pytest.mark.parametrize("uri", URIS, ids=lambda uri: uri[:40])
def test_a_uri_that_leads_to_no_model_is_refused(check, uri):
    said, path = check(world(include(uri)))
    # The complaint may be about what is wrong inside a file that was found.
    inner = re.match(r"ddenv: (/[^:]*)", said.err)
    place = path if inner is None or inner[1] == str(path) else Path(inner[1])
    refusal(said, place)
    assert "root:" not in said.err


@pytest.mark.parametrize("uri", URIS, ids=lambda uri: uri[:40])
def test_a_mesh_uri_that_leads_to_no_mesh_is_refused_where_it_stands(check, uri):
    line = refusal(*check(shape(f"<mesh><uri>{uri}</uri></mesh>")))
    assert re.match(r":1: /sdf/world/\S+/geometry/mesh: ", line), line


NAMES = (
    "world",
    "__model__",
    "__root__",
    "a::b",
    "::",
    "::a",
    "a::",
    "x #2",
    "/",
    "'",
    "]",
    "\u202e",
    "\ufeff",
    "木" * 2000,
)
RUDE = ("&#10;", "a&#13;b", "a&#9;b", "a&#x9b;31m", "&#x2028;", "&#x85;")


@pytest.mark.parametrize("name", NAMES + RUDE, ids=lambda name: ascii(name)[:20])
@pytest.mark.parametrize("json", [(), ("--json",)], ids=["table", "json"])
def test_a_strange_name_is_read_or_refused_and_never_steers_the_terminal(check, name, json):
    text = f'<sdf version="1.9"><world name="w"><model name="{name}">{LINK}</model></world></sdf>'
    read_or_refused(*check(text.encode(), *json))


@pytest.mark.parametrize("name", RUDE)
@pytest.mark.parametrize("wrong", ["<pose>{}</pose>", "<frame name='{}'/><frame name='x' attached_to='{}'/>"])
def test_what_a_complaint_quotes_never_steers_the_terminal(check, name, wrong):
    use = "<model name='u'><pose relative_to='x{}'/></model>"
    refusal(
        *check(world((wrong + use).replace("{}", name) + f"<model name='{name}'>{LINK}<pose>{name} x</pose></model>"))
    )


def test_a_complaint_stays_readable_however_long_the_names_are(check):
    name = "n" * 100_000
    assert (
        len(refusal(*check(model(LINK + frame(name, name) + f"<link name='k'><pose relative_to='{name}'/></link>"))))
        < 5000
    )


@pytest.mark.parametrize(
    "inside", [include("{}"), shape("<mesh><uri>{}</uri></mesh>").decode()], ids=["include", "mesh"]
)
@pytest.mark.parametrize(
    "uri", ["model://" + "n" * 100_000, "a/../" * 20_000 + "x", "n" * 100_000 + ":x"], ids=lambda uri: uri[:10]
)
def test_a_complaint_stays_readable_however_long_the_uris_are(check, inside, uri):
    text = inside.format(uri)
    assert len(refusal(*check(text.encode() if text.startswith("<sdf") else world(text)))) < 5000


def test_a_name_reserved_for_the_world_never_becomes_a_link(check):
    """A joint's parent `world` would mean either of two things."""
    refusal(*check(model("<link name='a'/><link name='world'/>" + joint(ends("world", "a"), "fixed"))))


def test_a_byte_order_mark_is_no_harm(check):
    said, _ = check(b"\xef\xbb\xbf" + world(MODEL))
    assert (said.code, said.err) == (0, "")


@pytest.mark.parametrize("xml", ["1.1", "1.0", "2.0", ""])
def test_other_versions_of_xml_are_read_or_refused(check, xml):
    read_or_refused(*check(f"<?xml version='{xml}'?>".encode() + world(MODEL)))


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "ascii", "utf-8"])
def test_encodings_of_one_byte_are_read(check, encoding):
    name = "m" if encoding == "ascii" else "Bäume"
    text = f"<?xml version='1.0' encoding='{encoding}'?>".encode() + model(LINK, name).decode().encode(encoding)
    said, _ = check(text)
    assert said.code == 0
    assert name in said.out


@pytest.mark.parametrize("place", slow(pytest.mark.fuzz, ["here", "include", "mesh"], but=["mesh"]))
def test_defaults_of_a_document_type_never_fill_the_memory(tmp_path, place):
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
    path = tmp_path / "hostile.world"
    path.write_bytes(texts[place])
    refusal(in_own_process(path), tmp_path)


@pytest.mark.parametrize("entity", ["'ha'", "SYSTEM 'file:///etc/passwd'"])
def test_entities_are_refused_in_included_files_too(check, tmp_path, entity):
    text = f"<!DOCTYPE sdf [<!ENTITY l0 {entity}>{LAUGHS}]><sdf version='1.9'><model name='m'>&l9;</model></sdf>"
    (tmp_path / "bomb.sdf").write_text(text)
    said, path = check(world(include("bomb.sdf")))
    assert "entities" in refusal(said, path.with_name("bomb.sdf"))


@pytest.mark.parametrize("name", ["model.config", "model.sdf"])
def test_entities_are_refused_in_the_files_of_a_model(check, tmp_path, name):
    folder = tmp_path / "bomb"
    folder.mkdir()
    (folder / name).write_text(f"<!DOCTYPE x [<!ENTITY l0 'ha'>{LAUGHS}]><model>&l9;</model>")
    said, _ = check(world(include("bomb")))
    assert "entities" in refusal(said, tmp_path)


@pytest.mark.parametrize("entity", ["'ha'", "SYSTEM 'file:///etc/passwd'"])
def test_entities_are_refused_in_meshes_too(check, tmp_path, entity):
    (tmp_path / "bomb.dae").write_text(f"<!DOCTYPE x [<!ENTITY l0 {entity}>{LAUGHS}]><COLLADA>&l9;</COLLADA>")
    assert "entities" in refusal(*check(shape("<mesh><uri>bomb.dae</uri></mesh>")))


@pytest.mark.parametrize("suffix", ["dae", "obj", "stl", "gltf", "glb"])
@pytest.mark.parametrize("content", [b"", b"\0" * 200, b"v 0 0 0\nf 1 2 3\n", b"{" * 5000, b"<a>" * 5000, b"[1e999]"])
def test_a_mesh_that_is_none_is_refused_where_it_is_named(check, tmp_path, suffix, content):
    (tmp_path / f"mesh.{suffix}").write_bytes(content)
    assert re.match(r":1: /sdf/world/\S+/mesh: ", refusal(*check(shape(f"<mesh><uri>mesh.{suffix}</uri></mesh>"))))


@pytest.mark.parametrize("vertex", ["nan 0 0", "inf 0 0", "1e308 0 0", "0 0"])
def test_a_mesh_with_vertices_nowhere_is_refused_where_it_is_named(check, tmp_path, vertex):
    (tmp_path / "mesh.obj").write_text(f"v {vertex}\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    assert re.match(r":1: /sdf/world/\S+/mesh: ", refusal(*check(shape("<mesh><uri>mesh.obj</uri></mesh>"))))


def test_a_gigabyte_is_refused_at_once(tmp_path):
    path = tmp_path / "large.world"
    with path.open("wb") as file:
        file.truncate(1 << 30)
    assert "too large" in refusal(in_own_process(path, seconds=AT_ONCE), path)


@pytest.mark.parametrize(
    "text", [world(include("large.obj")), shape("<mesh><uri>large.obj</uri></mesh>")], ids=["include", "mesh"]
)
def test_a_gigabyte_that_is_named_is_refused_at_once(tmp_path, text):
    with (tmp_path / "large.obj").open("wb") as file:
        file.truncate(1 << 30)
    path = tmp_path / "hostile.world"
    path.write_bytes(text)
    assert "MB" in refusal(in_own_process(path, seconds=AT_ONCE), path)


def test_a_folder_is_refused(tmp_path):
    assert "folder" in refusal(in_own_process(tmp_path), tmp_path)


def test_a_file_that_is_missing_is_refused(tmp_path, monkeypatch, capsys):
    for name in ("none.world", "none/none.world", "a" * 300, "new\nline"):
        said = in_process(monkeypatch, capsys, tmp_path / name)
        refusal(said, tmp_path)


@pytest.mark.parametrize("name", slow(pytest.mark.fuzz, ["/dev/zero", "/dev/null", "/dev/tty"], but=["/dev/zero"]))
def test_a_device_is_refused(name):
    refusal(in_own_process(name, seconds=AT_ONCE), name)


def test_a_pipe_is_refused_and_not_waited_on(tmp_path):
    path = tmp_path / "pipe.world"
    os.mkfifo(path)
    refusal(in_own_process(path, seconds=AT_ONCE), path)
    other = tmp_path / "hostile.world"
    for text in (world(include("pipe.world")), shape("<mesh><uri>pipe.obj</uri></mesh>")):
        (tmp_path / "pipe.obj").unlink(missing_ok=True)
        os.mkfifo(tmp_path / "pipe.obj")
        other.write_bytes(text)
        refusal(in_own_process(other, seconds=AT_ONCE), other)


def test_a_link_that_leads_to_itself_is_refused(tmp_path, monkeypatch, capsys):
    path = tmp_path / "loop.world"
    path.symlink_to(path)
    refusal(in_process(monkeypatch, capsys, path), path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read_is_refused(tmp_path, monkeypatch, capsys):
    path = tmp_path / "secret.world"
    path.write_bytes(world(MODEL))
    path.chmod(0)
    assert "ermission" in refusal(in_process(monkeypatch, capsys, path), path)
    other = tmp_path / "hostile.world"
    other.write_bytes(world(include("secret.world")))
    assert "ermission" in refusal(in_process(monkeypatch, capsys, other), other)


def sdf_model(name: str, inside: str) -> str:
    return f"<sdf version='1.9'><model name='{name}'>{inside}</model></sdf>"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_files_that_include_each_other_are_refused(check, tmp_path, count):
    for number in range(count):
        (tmp_path / f"f{number}.sdf").write_text(sdf_model("m", include(f"f{(number + 1) % count}.sdf")))
    said, _ = check(world(include("f0.sdf")))
    assert "circle" in refusal(said, tmp_path)
    assert re.match(rf"ddenv: {tmp_path}/f\d.sdf:1: /sdf/model\[@name='m'\]/include: ", said.err)


def test_a_world_that_includes_itself_is_refused(check):
    assert "circle" in refusal(*check(world(include("hostile.world"))))


def test_files_that_include_each_other_through_a_linked_folder_are_refused(tmp_path):
    (tmp_path / "again").symlink_to(tmp_path)
    (tmp_path / "f.sdf").write_text(sdf_model("m", include("again/f.sdf") + include("again/f.sdf", "<name>n</name>")))
    path = tmp_path / "hostile.world"
    path.write_bytes(world(include("f.sdf")))
    refusal(in_own_process(path), tmp_path)


@pytest.mark.parametrize("last", slow(pytest.mark.fuzz, [LINK, ""]), ids=["with a link", "with nothing"])
def test_includes_that_multiply_are_bounded(tmp_path, last):
    """Nine files, ten includes in each: a thousand million links."""
    for number in range(9):
        inside = "".join(include(f"f{number + 1}.sdf", f"<name>n{copy}</name>") for copy in range(10))
        (tmp_path / f"f{number}.sdf").write_text(sdf_model("m", inside))
    (tmp_path / "f9.sdf").write_text(sdf_model("m", last))
    path = tmp_path / "hostile.world"
    path.write_bytes(world(include("f0.sdf")))
    refusal(in_own_process(path), tmp_path)


def test_a_long_row_of_files_is_read_or_refused(tmp_path):
    for number in range(300):
        (tmp_path / f"f{number}.sdf").write_text(sdf_model("m", include(f"f{number + 1}.sdf")))
    (tmp_path / "f300.sdf").write_text(sdf_model("m", LINK))
    path = tmp_path / "hostile.world"
    path.write_bytes(world(include("f0.sdf")))
    read_or_refused(in_own_process(path), tmp_path)


COUNT = 100_000
ROW = "".join(attached(f"f{number}", f"f{number + 1}") for number in range(COUNT)) + attached(f"f{COUNT}", "l0")
MANY = {
    "models inside models": "<model name='m'>" * 5000 + "</model>" * 5000,
    "any elements inside each other": "<a>" * 200_000 + "</a>" * 200_000,
    "frames in a row": model(
        LINK + "".join(frame(f"f{i}", f"f{i + 1}") for i in range(2000)) + frame("f2000", "l") + "<link name='k'>"
        "<pose relative_to='f0'/></link>"
    ),
    "frames attached in a row": model(links(2) + ROW + joint(ends("l1", "f0"), "fixed")),
    "links in a row": model(
        links(3000) + "".join(joint(ends(f"l{i}", f"l{i + 1}"), "fixed", f"j{i}") for i in range(2999))
    ),
    "links on one": model(links(3000) + "".join(joint(ends("l0", f"l{i + 1}"), "fixed", f"j{i}") for i in range(2999))),
    "attributes": world("<model name='m'" + "".join(f" a{i}='0'" for i in range(100_000)) + f">{LINK}</model>"),
    "blanks in a tag": world(f"<model name='m'{' ' * 20_000_000}>{LINK}</model>"),
    "an attribute": world(f"<model name='m' a='{'&gt;' * 1_000_000}'>{LINK}</model>"),
    "names": model(LINK, "m" * 2_000_000),
    "models of one name": world(MODEL * 5000),
    "models of one name in the state": world(
        MODEL * 2000 + "<state>" + "<model name='m'><pose>0 0 1 0 0 0</pose></model>" * 5000 + "</state>"
    ),
    "elements that nobody knows": world(MODEL + "<what/>" * 50_000),
    "numbers": world(f"<model name='m'><pose>{'0 ' * 2_000_000}</pose>{LINK}</model>"),
    "digits": world(f"<model name='m'><pose>{'9' * 2_000_000} 0 0 0 0 0</pose>{LINK}</model>"),
    "points of a polyline": shape(
        "<polyline>" + "".join(f"<point>{i} {i * i % 997}</point>" for i in range(50_000)) + "</polyline>"
    ),
    "comments": world(MODEL + "<!-- -->" * 200_000),
    "namesakes of a frame that is nowhere": world(
        "".join(frame(f"frame number {number}", "") for number in range(5000))
        + f"<model name='m'><pose relative_to='frame number'/>{LINK}</model>"
    ),
    "namesakes that are long": world(
        frame("".join(chr(0x4E00 + i * i % 20_000) for i in range(60_000)), "")
        + f"<model name='m'><pose relative_to='{''.join(chr(0x4E00 + i * i % 19_997) for i in range(60_000))}'/>"
        + f"{LINK}</model>"
    ),
}


@pytest.mark.parametrize("name", slow(pytest.mark.fuzz, MANY, but=["frames in a row"]))
@pytest.mark.parametrize("json", slow(pytest.mark.fuzz, [(), ("--json",)], but=[()]), ids=["table", "json"])
def test_any_number_of_things_is_read_or_refused_soon(tmp_path, name, json):
    path = tmp_path / "hostile.world"
    text = MANY[name]
    path.write_bytes(text if isinstance(text, bytes) else world(text))
    read_or_refused(in_own_process(path, *json), path)


@pytest.mark.parametrize("encoding", slow(pytest.mark.fuzz, ["ascii", "latin-1"], but=["ascii"]))
@pytest.mark.parametrize("wrong", [False, True])
def test_a_terminal_without_unicode_gets_what_it_can_show(tmp_path, encoding, wrong):
    path = tmp_path / "hostile.world"
    path.write_bytes(model(LINK + ("<pose>nan</pose>" if wrong else ""), "木 Bäume"))
    said = in_own_process(path, PYTHONIOENCODING=encoding)
    assert "Traceback" not in said.err, said.err[-2000:]
    assert said.code == (2 if wrong else 0)
