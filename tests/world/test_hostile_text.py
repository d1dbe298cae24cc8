"""Text that is no world, and elements that no thing has: one line, exit code 2, at the place."""

import re

import pytest

from tests.world.hostile import (
    BOX,
    LAUGHS,
    LINK,
    MODEL,
    attached,
    ends,
    frame,
    joint,
    links,
    model,
    read_or_refused,
    refusal,
    shape,
    world,
)

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


def test_a_name_reserved_for_the_world_never_becomes_a_link(check):
    """A joint's parent `world` would mean either of two things."""
    refusal(*check(model("<link name='a'/><link name='world'/>" + joint(ends("world", "a"), "fixed"))))


def test_a_byte_order_mark_is_no_harm(check):
    said, _ = check(b"\xef\xbb\xbf" + world(MODEL))
    assert (said.returncode, said.stderr) == (0, "")


@pytest.mark.parametrize("xml", ["1.1", "1.0", "2.0", ""])
def test_other_versions_of_xml_are_read_or_refused(check, xml):
    read_or_refused(*check(f"<?xml version='{xml}'?>".encode() + world(MODEL)))


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "ascii", "utf-8"])
def test_encodings_of_one_byte_are_read(check, encoding):
    name = "m" if encoding == "ascii" else "Bäume"
    text = f"<?xml version='1.0' encoding='{encoding}'?>".encode() + model(LINK, name).decode().encode(encoding)
    said, _ = check(text)
    assert said.returncode == 0
    assert name in said.stdout
