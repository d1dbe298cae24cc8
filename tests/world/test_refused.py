"""The user guide's table of what is refused: each of its rows is refused, with file, line and XPath."""

from itertools import takewhile

import pytest

from ddenv.errors import UserError
from ddenv.world.sdf.read import parse_world, read_world
from tests.conftest import ROOT

GUIDE = (ROOT / "docs" / "user-guide.md").read_text()


def sdf(inside, version="1.9"):
    return f"<sdf version='{version}'>\n<world name='w'>\n{inside}\n</world></sdf>"


def model(inside, name="m"):
    return sdf(f"<model name='{name}'>{inside}</model>")


def shape(geometry, more=""):
    return model(f"<link name='l'><collision name='c'><geometry>{geometry}</geometry>{more}</collision></link>")


def joints(*texts):
    return model(f"<link name='a'/><link name='b'/><link name='c'/>{''.join(texts)}")


def joint(kind="fixed", ends="<parent>a</parent><child>b</child>", inside="", name="j"):
    return f"<joint name='{name}' type='{kind}'>{ends}{inside}</joint>"


def include(inside, attributes=""):
    return sdf(f"<include {attributes}>{inside}</include>")


LINK = "<link name='l'/>"
# The first words of each row of the table, with files that it is about.
ROWS: dict[str, list[str]] = {
    "an empty file, a folder": [""],
    "XML that is not well-formed": [sdf("<model>"), sdf("\x01")],
    "a DOCTYPE, and": ["<!DOCTYPE a [<!ENTITY b 'c'>]>" + sdf("&b;")],
    "elements nested more than 100": [sdf("<a>" * 101 + "</a>" * 101)],
    "a root that is not `<sdf>`": ["<urdf/>", sdf("", "0.1"), "<sdf/>"],
    "no `<world>`": ["<sdf version='1.9'/>", "<sdf version='1.9'><world name='a'/><world name='b'/></sdf>"],
    "`<population>`": [sdf("<population name='p'/>")],
    "`<joint>` between models": [sdf("<joint name='j' type='fixed'/>")],
    "a second `<state>`": [
        sdf("<state/><state/>"),
        sdf("<state><insertions><model name='m'/></insertions></state>"),
        sdf("<state><deletions><name>m</name></deletions></state>"),
    ],
    "a model, link, joint": [
        model(LINK, ""),
        model("<link/>"),
        model(f"{LINK}<joint type='fixed'/>"),
        model("<link name='l'><visual/></link>"),
        model("<link name='l'><collision/></link>"),
    ],
    "two links or two": [model(LINK * 2), model(""), joints(joint(), joint()), model("<link name='world'/>")],
    "a pose that is not six": [
        model(f"<pose>1 2</pose>{LINK}"),
        model(f"<pose>nan 0 0 0 0 0</pose>{LINK}"),
        model(f"<pose>inf 0 0 0 0 0</pose>{LINK}"),
        model(f"<pose>2e6 0 0 0 0 0</pose>{LINK}"),
    ],
    "a quaternion without": [model(f"<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>{LINK}")],
    "a frame that does not exist": [model(f"<pose relative_to='x'/>{LINK}")],
    "frames in a cycle": [model("<link name='l'><pose relative_to='l'/></link>")],
    "true or false": [model(f"<static>maybe</static>{LINK}")],
    "`<include>` without a `<uri>`": [include("")],
    "`<include>` of a file that cannot be found": [include("<uri>model://nowhere</uri>")],
    "`<include merge='true'>`": [include("<uri>model://nowhere</uri>", "merge='true'")],
    "includes in a cycle": [include("<uri>refused.sdf</uri>")],
    "a URI that leaves its folder": [include("<uri>model://../../x</uri>"), include("<uri>ftp://x/y</uri>")],
    "a shape without its sizes": [
        shape("<box/>"),
        shape("<sphere><radius>0</radius></sphere>"),
        shape("<box><size>1 -1 1</size></box>"),
        shape("<box><size>1 1 1e7</size></box>"),
        shape("<cone/>"),
        shape(""),
    ],
    "a plane's normal": [shape("<plane><normal>0 0 0</normal></plane>")],
    "a polyline of fewer": [
        shape("<polyline><point>0 0</point><height>1</height></polyline>"),
        shape("<polyline><point>0 0</point><point>1 0</point><point>0 1</point><height>0</height></polyline>"),
    ],
    "a collision mesh": [
        shape("<mesh><uri>model://x/y.dae</uri></mesh>"),
        shape("<mesh><uri>refused.sdf</uri></mesh>"),
        shape("<mesh/>"),
    ],
    "a scale of zero": [
        shape("<mesh><uri>x.dae</uri><scale>0 1 1</scale></mesh>"),
        sdf("<state><model name='m'><scale>0 1 1</scale></model></state>"),
    ],
    "a collision `<heightmap>`": [shape("<heightmap><uri>x.png</uri></heightmap>")],
    "a collision `<image>`": [shape("<image><uri>x.png</uri></image>")],
    "friction or damping": [
        shape("<sphere><radius>1</radius></sphere>", "<surface><friction><ode><mu>-1</mu></ode></friction></surface>"),
        shape("<sphere><radius>1</radius></sphere>", "<density>-1</density>"),
        shape(
            "<sphere><radius>1</radius></sphere>",
            "<surface><contact><collide_bitmask>x</collide_bitmask></contact></surface>",
        ),
        joints(joint("revolute", inside="<axis><dynamics><damping>-1</damping></dynamics></axis>")),
    ],
    "joints of type screw": [joints(joint(kind)) for kind in ("screw", "gearbox", "revolute2", "")],
    "a joint whose end": [
        joints(joint(ends="<parent>a</parent>")),
        joints(joint(ends="<parent>a</parent><child>x</child>")),
        joints(joint(ends="<parent>a</parent><child>a</child>")),
    ],
    "joints that close a loop": [
        joints(joint(), joint(ends="<parent>b</parent><child>a</child>", name="k")),
        joints(joint(), joint(ends="<parent>c</parent><child>b</child>", name="k")),
    ],
    "a joint without its axis": [
        joints(joint("revolute")),
        joints(joint("prismatic", inside="<axis><xyz>0 0 0</xyz></axis>")),
        joints(joint("revolute", inside="<axis><limit><lower>1</lower><upper>0</upper></limit></axis>")),
    ],
    "a universal joint": [
        joints(joint("universal", inside="<axis><xyz>1 0 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>"))
    ],
}


def table():
    lines = GUIDE.split("| refused | remedy |\n|---|---|\n")[1].splitlines()
    return [line.strip("| ").split(" | ")[0] for line in takewhile(str.strip, lines)]


def test_every_row_of_the_table_is_tried():
    for row in table():
        assert any(row.startswith(start) for start in ROWS), row
    assert len(table()) == len(ROWS)


CASES = [(start, text) for start, texts in ROWS.items() for text in texts]


@pytest.mark.parametrize(("start", "text"), CASES, ids=[f"{start[:30]} {i}" for i, (start, _) in enumerate(CASES)])
def test_what_the_table_says_is_refused(tmp_path, start, text):
    path = tmp_path / "refused.sdf"
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        read_world(path)
    said = str(caught.value)
    assert said.startswith(str(path))
    assert "\n" not in said
    if "model" in text or "include" in text or "state" in text:
        assert ": /sdf/world" in said or "XML" in said or start.startswith("elements nested"), said


def test_a_world_that_is_read_is_not_refused():
    assert parse_world(model(LINK).encode(), ROOT / "x.sdf").models[0].name == "m"
