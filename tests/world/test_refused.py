"""What docs/worlds.md says is rejected: each in one line, with exit code 2, and where it stands."""

import re

import pytest

from tests.conftest import ROOT
from tests.world.hostile import (
    BOX,
    LAUGHS,
    LINK,
    MODEL,
    attached,
    ends,
    frame,
    include,
    joint,
    links,
    model,
    read_or_refused,
    refusal,
    shape,
    world,
)


def in_encoding(name: str) -> bytes:
    return f"<?xml version='1.0' encoding='{name}'?>".encode() + world(MODEL)


def with_dtd(inside: str, entities: str) -> bytes:
    return world(inside, before=f"<!DOCTYPE sdf {entities}>")


# The first words of each row of the guide's table, what is said, and of which files. These have no
# element to point at.
OF_THE_FILE: dict[str, dict[str, list[bytes]]] = {
    "an empty file, a folder": {": the file is empty; expected an SDF file": [b"", b" \n\t\n"]},
    "XML that TinyXML2": {
        ":2:1: not well-formed XML: the tag <world is not closed": [b"<sdf>\n<world"],
        r":1:\d+: not well-formed XML": [
            b"a world, please",
            # Cut in a tag, in an attribute, before the end.
            *(world(MODEL)[:end] for end in (60, 38, -6)),
            world(MODEL) + b"more",
            b"<sdf version='1.9'><world name='w'><a><b></a></b></world></sdf>",
            b"<sdf version='1.9' version='1.9'/>",
            b"<sdf version=1.9/>",
            # Bytes that are no UTF-8; a lone surrogate; control characters.
            *(model(LINK).replace(b"'m'", name) for name in (b"'\xff\xfe'", b"'\xed\xa0\x80'")),
            *(model(LINK, name) for name in ("&#xD800;", "&#0;", "\x01", "\x1b[31m")),
        ],
        ": is UTF-16, UTF-32 or not text; save it as UTF-8": [
            bytes(range(256)),
            b"\0" * 1000,
            model(LINK).replace(b"'m'", b"'\0'"),
            *(world(MODEL).decode().encode(name) for name in ("utf-16", "utf-16-be", "utf-32")),
        ],
        ": cannot be decoded: .*; save it as UTF-8": [
            in_encoding(name) for name in ("klingon", "zip", "shift_jis")
        ],
    },
    "a DOCTYPE, and": {
        (
            r":1:1: DOCTYPE is not allowed \(its entities can read other files and exhaust "
            r"memory\); "
            r"remove it"
        ): [
            with_dtd(MODEL, f"[<!ENTITY l0 'ha'>{LAUGHS}]") + b"&l9;",
            with_dtd("&a;" * 1000, f"[<!ENTITY a '{'a' * 10000}'>]"),
            *(
                with_dtd("&a;", f"[<!ENTITY a SYSTEM '{uri}'>]")
                for uri in ("file:///etc/passwd", "file:///dev/zero", "http://localhost:1/")
            ),
            with_dtd("", "[<!ENTITY % a SYSTEM 'file:///etc/passwd'> %a;]"),
            with_dtd("&a;", "SYSTEM 'file:///etc/passwd'"),
        ]
    },
    "elements nested more than 100": {
        r":1:\d+: elements are nested more than 100 deep": [world("<a>" * 101 + "</a>" * 101)]
    },
    "a root that is not `<sdf>`": {
        ":1: /html: expected <sdf> as the outermost element": [
            b"<html><body><p>404</p></body></html>"
        ],
        ":1: /sdf: has no version attribute; use SDF 1.4 to 1.12": [
            b"<sdf><world name='w'/></sdf>",
            *(world(MODEL, version) for version in ("", " ")),
        ],
        ":1: /sdf: version '.*' is not supported; use SDF 1.4 to 1.12": [
            world(MODEL, version)
            for version in (
                "0.1",
                "1",
                "1.3",
                "1.13",
                "1.99",
                "2.0",
                "-1.6",
                "nan",
                "1.6.0",
                "6",
                "9" * 5000,
            )
        ],
    },
    "no `<world>`": {
        ": expected one <world> inside <sdf>, found": [
            b"<sdf version='1.9'/>",
            b"<sdf version='1.9'>" + MODEL.encode() + b"</sdf>",
            b"<sdf version='1.9'><world name='a'/><world name='b'/></sdf>",
        ]
    },
    "macros of xacro": {
        r":1: /sdf/.*: is xacro, not SDF; run 'xacro FILE > new.sdf'": [
            (
                b"<sdf version='1.9' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arg "
                b"name='a'/><world name='w'/></sdf>"
            ),
            (
                b"<sdf version='1.9' xmlns:x='http://www.ros.org/wiki/xacro'><world "
                b"name='w'><x:include filename='a'/></world></sdf>"
            ),
        ]
    },
}


POSES = {
    r"/pose: expected 6 finite numbers, found '": (
        *(
            "nan 0 0 0 0 0",
            "0 inf 0 0 0 0",
            "0 0 -inf 0 0 0",
            "0 0 0 nan 0 0",
            "1e400 0 0 0 0 0",
            "1 2",
            "0 0 0",
        ),
        *(
            "0 0 0 0 0 0 0",
            "a b c d e f",
            "0,0,0,0,0,0",
            "0x1 0 0 0 0 0",
            "1_0 0 0 0 0 0",
            "0 " * 100_000,
        ),
    ),
}
STATE = f"{MODEL}<state world_name='w'><model name='m'>%s</model></state>"
WITH_A_POSE = (
    f"<model name='m'>%s{LINK}</model>",
    "<model name='m'><link name='l'>%s</link></model>",
    f"<model name='m'><link name='l'><collision name='c'>%s{BOX}</collision></link></model>",
    f"<model name='m'><link name='l'><visual name='v'>%s{BOX}</visual></link></model>",
    STATE,
    STATE % "<link name='l'>%s</link>",
)
THREE = "<point>0 0</point><point>1 0</point><point>0 1</point>"
SIZES = {
    "size": "<box><size>1 1 {}</size></box>",
    "radius": "<sphere><radius>{}</radius></sphere>",
    "length": "<cylinder><radius>1</radius><length>{}</length></cylinder>",
    "radii": "<ellipsoid><radii>1 {} 1</radii></ellipsoid>",
    "height": f"<polyline><height>{{}}</height>{THREE}</polyline>",
}
NO_SIZES = ("0", "-1", "nan", "inf", "-inf", "1e7", "1e308", "", "large", "1e-320")
NO_SIZE = r"(expected .* finite number|.* must be from 1e-06 to 1e\+06 m, found)"
COLLISION = r"/link\[@name='l'\]/collision\[@name='c'\]"
TWO = "<link name='a'/><link name='b'/>"
AB = ends("a", "b")
UNIVERSAL = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>{}</xyz></axis2>"
CUBE = "<box><size>1 1 1</size></box>"


def surface(inside: str, more: str = "") -> bytes:
    return shape(f"{CUBE}</geometry><surface>{inside}</surface>{more}<geometry>").replace(
        b"<geometry></geometry>", b""
    )


def two(*joints: str) -> bytes:
    return model(TWO + "".join(joints))


def hinge(inside: str, kind: str = "revolute") -> bytes:
    return two(joint(f"{AB}<axis><xyz>0 0 1</xyz>{inside}</axis>", kind))


def nameless(text: str) -> list[bytes]:
    """The element without its name, and with names that are none."""
    return [
        world(text.replace(" name=''", given, 1))
        for given in ("", " name=''", " name='  '", " name='&#10;'")
    ]


def on_frame_a(*others: str) -> bytes:
    return world(
        f"{''.join(others)}<model name='m'><pose relative_to='a'>0 0 0 0 0 0</pose>{LINK}</model>"
    )


def populated(distribution: str, more: str = "") -> bytes:
    inside = f"<model name='k'>{LINK}</model><distribution>{distribution}</distribution>{more}"
    return world(f"<population>{inside}</population>")


# These point at the element.
AT_A_PLACE: dict[str, dict[str, list[bytes]]] = {
    "a `<population>` whose": {
        "only Gazebo Classic knows the places of a 'uniform' distribution; .* --ignore population": [
            populated("<type>uniform</type>")
        ],
        "/population: has no distribution/step": [
            populated("<type>grid</type><rows>1</rows><cols>1</cols>")
        ],
        r"/step: must be between -1e\+06 and 1e\+06 m": [
            populated("<type>grid</type><rows>3</rows><cols>3</cols><step>1e308 1e308 1</step>")
        ],
        r"/size: must be between 0 and 1e\+06 m": [
            populated(
                "<type>linear-x</type>",
                "<model_count>2</model_count><box><size>1 -1 1</size></box>",
            )
        ],
        "/population: must stand for 1 to 50000 models; see its rows and cols, or model_count": [
            populated(f"<type>grid</type><rows>1</rows>{cols}")
            for cols in ("", "<cols>0</cols>", "<cols>1e9</cols>")
        ],
    },
    "`<joint>` between models": {
        "joints between models are not supported": [world("<joint name='j' type='fixed'/>")]
    },
    "a second `<state>`": {
        "/state: a second <state>; a world may have only one": [world("<state/><state/>")],
        "/state/insertions: <insertions> in <state>": [
            world("<state><insertions><model name='m'/></insertions></state>")
        ],
        "/state/deletions: <deletions> in <state>": [
            world("<state><deletions><name>m</name></deletions></state>")
        ],
    },
    "a model, link, joint": {
        r"/model(\[@name='\s*'\])?: has no name": nameless(f"<model name=''>{LINK}</model>"),
        r"/link(\[@name='\s*'\])?: has no name": nameless(
            "<model name='m'><link name=''/></model>"
        ),
        r"/collision(\[@name='\s*'\])?: has no name": nameless(
            f"<model name='m'><link name='l'><collision name=''>{BOX}</collision></link></model>"
        ),
        r"/visual(\[@name='\s*'\])?: has no name": nameless(
            f"<model name='m'><link name='l'><visual name=''>{BOX}</visual></link></model>"
        ),
        r"/joint(\[@name='\s*'\])?: has no name": nameless(
            f"<model name='m'>{TWO}<joint name='' type='fixed'>{AB}</joint></model>"
        ),
        r"/frame(\[@name='\s*'\])?: has no name": nameless(
            f"<model name='m'>{LINK}<frame name=''/><link name='k'><pose "
            "relative_to='l'/></link></model>"
        ),
        r"/state/model: has no name": [world("<state><model/></state>")],
    },
    "two links or two": {
        "this link name is used twice": [model(LINK * 2)],
        "this joint name is used twice": [two(*2 * [joint(AB, "fixed")])],
        r"/model\[@name='m'\]: has no <link>": [model("")],
        r"/model\[@name='m'\]/model\[@name='i'\]: has no <link>": [
            model("<model name='i'/>"),
            model("<static>1</static><model name='i'/>"),
            model("<link name='l'/><model name='i'/>"),
        ],
        # A joint's parent `world` would mean either of two things.
        "the name 'world' is reserved by SDF": [
            model("<link name='world'/>"),
            model("<link name='a'/><link name='world'/>" + joint(ends("world", "a"), "fixed")),
        ],
    },
    "a pose that is not six": {
        words: [
            world(text.replace("%s", f"<pose>{pose}</pose>"))
            for text in WITH_A_POSE
            for pose in poses
        ]
        for words, poses in POSES.items()
    },
    "a quaternion without": {
        "the quaternion has no usable length": [
            model(f"<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>{LINK}")
        ],
        "rotation_format 'rpy' is unknown": [
            model(f"<pose rotation_format='rpy'>0 0 0 0 0 0</pose>{LINK}")
        ],
    },
    "a frame that does not exist": {
        "there is no frame '[ao]' here": [
            on_frame_a(),
            world(
                f"<model name='m'>{LINK}<link name='k'><pose "
                "relative_to='o'/></link></model><model name='o'/>"
            ),
            world(f"<model name='m' placement_frame='a'>{LINK}</model>"),
        ],
        r"no frame 'chasis' here \(did you mean chassis\?\)": [
            model("<link name='chassis'/><link name='b'><pose relative_to='chasis'/></link>")
        ],
    },
    "frames in a cycle": {
        "/pose: the frames form a cycle: a -> a$": [
            on_frame_a(frame("a", "a")),
            world(f"<model name='a'><pose relative_to='a'/>{LINK}</model>"),
            model("<link name='a'><pose relative_to='a'/></link>"),
        ],
        "/pose: the frames form a cycle: a -> b -> a$": [
            on_frame_a(frame("a", "b"), frame("b", "a")),
            on_frame_a(attached("a", "b"), attached("b", "a")),
        ],
        "/pose: the frames form a cycle: a -> b -> c -> a$": [
            on_frame_a(frame("a", "b"), frame("b", "c"), frame("c", "a"))
        ],
        "/pose: the frames form a cycle: b -> a -> b$": [
            world(
                "".join(
                    f"<model name='{a}'><pose relative_to='{b}'/>{LINK}</model>"
                    for a, b in ("ab", "ba")
                )
            ),
            model(
                "".join(
                    f"<link name='{a}'><pose relative_to='{b}'/></link>" for a, b in ("ab", "ba")
                )
            ),
        ],
        "/pose: the frames form a cycle: j -> a -> j$": [
            model(
                "<link name='p'/><link name='a'><pose relative_to='j'/></link>"
                + joint(ends("p", "a"), "fixed")
            )
        ],
        "the attachments of frames form a cycle": [
            two(joint(ends("a", "j"), "fixed")),
            two(attached("f", "g"), attached("g", "f"), joint(ends("f", "a"), "fixed")),
        ],
    },
    "true or false": {
        "/static: expected true or false, found 'maybe'": [model(f"<static>maybe</static>{LINK}")]
    },
    "`<include>` without a `<uri>`": {"/include: has no <uri>": [world("<include/>")]},
    "`<include>` of a file that cannot be found": {
        "'model://nowhere' was not found": [world(include("model://nowhere"))]
    },
    "`<include merge='true'>` in a world": {
        (
            "merge='true' puts the links of a model into the model around it; here is none; leave "
            "it out with --ignore"
        ): [world("<include merge='true'><uri>model://nowhere</uri></include>")]
    },
    "includes in a cycle": {"form a cycle": [world(include("hostile.world"))]},
    "a URI that leaves its folder": {
        r"/include: '.*' cannot be included: leaves its folder with '\.\.'": [
            world(include("model://../../x")),
            world(include("model://%2e%2e/%2e%2e/secret")),
        ],
        "/include: 'ftp://x/y' cannot be included: scheme 'ftp:' is not supported": [
            world(include("ftp://x/y"))
        ],
        r"/mesh: .* leaves its folder": [shape("<mesh><uri>../../etc/passwd</uri></mesh>")],
    },
    "a shape with sizes": {
        **{
            rf"{COLLISION}/geometry/\w+/{tag}: {NO_SIZE}": [
                shape(text.format(size)) for size in NO_SIZES
            ]
            for tag, text in SIZES.items()
        },
        "<torus> is not a known shape; use one of box": [
            shape("<torus><radius>1</radius></torus>")
        ],
    },
    "a plane's normal": {
        "/normal: the normal has no usable length": [shape("<plane><normal>0 0 0</normal></plane>")]
    },
    "a polyline of fewer": {
        "needs at least three <point>s that are not on one line": [
            shape("<polyline><point>0 0</point><height>1</height></polyline>"),
            shape("<polyline><point>0 0</point><point>1 1</point><point>2 2</point></polyline>"),
        ],
        "/point: expected 2 finite numbers, found 'nan 1'": [
            shape("<polyline><point>0 0</point><point>nan 1</point><point>2 2</point></polyline>")
        ],
    },
    "a collision mesh": {
        "/mesh: mesh 'model://x/y.dae' is not available": [
            shape("<mesh><uri>model://x/y.dae</uri></mesh>")
        ],
        r"/mesh: .*'\.world' are not supported": [shape("<mesh><uri>hostile.world</uri></mesh>")],
        "/mesh: has no <uri>": [shape("<mesh/>")],
    },
    "a scale of zero": {
        r"/mesh/scale: a scale must be from 1e-09 to 1e\+06": [
            shape(f"<mesh><uri>a.obj</uri><scale>{scale}</scale></mesh>")
            for scale in ("0 0 0", "0 1 1", "1 0 1")
        ],
        r"/state/model\[@name='m'\]/scale: a scale must be from 1e-06": [
            world(STATE % f"<scale>{scale}</scale>")
            for scale in ("0 1 1", "1 0 1", "-1 1 1", "1e-320 1 1", "1e-200 1e-200 1e-200")
        ],
        r"/state/model\[@name='m'\]/scale: expected 3 finite numbers": [
            world(STATE % f"<scale>{scale}</scale>") for scale in ("nan 1 1", "1 1")
        ],
    },
    "a collision `<heightmap>`": {
        "/geometry/heightmap: heightmap 'h.png' is not available: .*--ignore heightmap": [
            shape("<heightmap><uri>h.png</uri></heightmap>")
        ],
        "/heightmap: has no <uri>": [shape("<heightmap/>")],
        r"/heightmap/size: sizes must be from 1e-06 to 1e\+06 m, found '9 0 1'": [
            shape("<heightmap><uri>h.png</uri><size>9 0 1</size></heightmap>")
        ],
    },
    "a collision `<image>`": {
        "/geometry/image: an image is not supported.*--ignore image": [
            shape("<image><uri>x.png</uri></image>")
        ]
    },
    "friction or damping": {
        "/mu: friction must not be negative, found -1": [
            surface("<friction><ode><mu>-1</mu></ode></friction>")
        ],
        "/density: a density must be from 0.001": [surface("", "<density>-1</density>")],
        "/collide_bitmask: expected a whole number, found 'x'": [
            surface("<contact><collide_bitmask>x</collide_bitmask></contact>")
        ],
        "/dynamics: damping must not be negative, found -1": [
            hinge("<dynamics><damping>-1</damping></dynamics>")
        ],
    },
    "joints of type screw": {
        r"/joint\[@name='j'\]: joint type '\w*' is not supported .*--ignore joint": [
            *(two(joint(AB, kind)) for kind in ("screw", "gearbox", "revolute2", "telepathic", "")),
            two(f"<joint name='j'>{AB}</joint>"),
        ]
    },
    "a joint whose end": {
        "<child> is not a link of this model: '(c|world|)'$": [
            *(two(joint(ends("a", child), "fixed")) for child in ("c", "world")),
            two(joint("<parent>a</parent>", "fixed")),
        ],
        "<parent> is not a link of this model: '(c|)'$": [
            two(joint(ends("c", "a"), "fixed")),
            two(joint("", "fixed")),
        ],
        "joins 'a' to itself": [two(joint(ends("a", "a"), "fixed"))],
    },
    "joints that close a loop": {
        r"/model\[@name='m'\]: joints close a loop: \w+ -> ": [
            two(joint(AB, "fixed", "j"), joint(ends("b", "a"), "fixed", "k")),
            model(
                links(3)
                + "".join(
                    joint(ends(f"l{i}", f"l{(i + 1) % 3}"), "fixed", f"j{i}") for i in range(3)
                )
            ),
        ],
        "link 'l2' is the child of two joints": [
            model(
                links(3)
                + joint(ends("l0", "l2"), "fixed", "j")
                + joint(ends("l1", "l2"), "fixed", "k")
            )
        ],
    },
    "a joint whose axis": {
        "/axis/xyz: the axis has no usable length": [
            two(joint(f"{AB}<axis><xyz>0 0 0</xyz></axis>", kind))
            for kind in ("revolute", "prismatic")
        ],
        "/axis/xyz: expected 3 finite numbers, found 'nan 0 0'": [
            two(joint(f"{AB}<axis><xyz>nan 0 0</xyz></axis>"))
        ],
        "/axis/limit: the lower limit (1|-?inf) is above the upper limit (0|-?inf)": [
            hinge(f"<limit>{limits}</limit>")
            for limits in (
                "<lower>1</lower><upper>0</upper>",
                "<lower>1e20</lower>",
                "<upper>-1e20</upper>",
            )
        ],
        "/limit/lower: expected one finite number, found 'nan'": [
            hinge("<limit><lower>nan</lower></limit>")
        ],
    },
    "a universal joint": {
        "/axis2: the two axes of a universal joint must be perpendicular": [
            two(joint(AB + UNIVERSAL.format(axis), "universal")) for axis in ("1 0 0", "1 1 0")
        ],
        "a universal joint needs an <axis2>": [hinge("", "universal")],
    },
}


def cases(rows: dict[str, dict[str, list[bytes]]]) -> list:
    return [
        pytest.param(words, text, id=f"{start[:30]} {number}")
        for start, said in rows.items()
        for number, (words, text) in enumerate(
            (words, text) for words, texts in said.items() for text in texts
        )
    ]


@pytest.mark.parametrize(("words", "text"), cases(OF_THE_FILE))
def test_what_is_no_world_is_refused_in_one_line(check, words, text):
    line = refusal(*check(text))
    assert re.match(words, line), line


@pytest.mark.parametrize(("words", "text"), cases(AT_A_PLACE))
def test_what_no_thing_has_is_refused_where_it_stands(check, words, text):
    line = refusal(*check(b"\n" + text))
    place = r"model\[@name='m'\]" if b"<model name='m'>" in text and b"<state" not in text else ""
    assert re.match(rf":2: /sdf/world/{place}", line) and re.search(words, line), line


def test_everything_that_the_page_lists_is_tried():
    page = (ROOT / "docs" / "worlds.md").read_text().split("## What is rejected\n")[1]
    groups = re.findall(r"^- \*\*[\w ]+:\*\* (.+(?:\n  .+)*)", page, re.MULTILINE)
    listed = [each for group in groups for each in re.sub(r"\n +", " ", group).split(" · ")]
    tried = [*OF_THE_FILE, *AT_A_PLACE]
    assert all(any(each.startswith(start) for start in tried) for each in listed), listed
    assert len(listed) == len(tried)


def test_a_byte_order_mark_is_no_harm(check):
    said, _ = check(b"\xef\xbb\xbf" + world(MODEL))
    assert (said.returncode, said.stderr) == (0, "")


@pytest.mark.parametrize("xml", ["1.1", "1.0", "2.0", ""])
def test_other_versions_of_xml_are_read_or_refused(check, xml):
    read_or_refused(*check(f"<?xml version='{xml}'?>".encode() + world(MODEL)))


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "ascii", "utf-8"])
def test_encodings_of_one_byte_are_read(check, encoding):
    name = "m" if encoding == "ascii" else "Bäume"
    text = f"<?xml version='1.0' encoding='{encoding}'?>".encode() + model(
        LINK, name
    ).decode().encode(encoding)
    said, _ = check(text)
    assert said.returncode == 0
    assert name in said.stdout
