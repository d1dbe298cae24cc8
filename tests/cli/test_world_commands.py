"""`ddenv world`: what is told of a world, and the files it writes."""

import json
import re

import pytest

from ddenv.cli.world import world_lines as lines
from ddenv.cli.world import world_report as report
from ddenv.errors import UserError
from ddenv.text import width
from ddenv.world.sdf.read import parse_world, read_world
from tests.command import ddenv, in_process
from tests.conftest import DATA, ROOT

WORLD = b"""<sdf version='1.6'><world name='hall'>
<model name='ground'><static>1</static><link name='l'><collision name='c'><geometry><plane/></geometry></collision></link></model>
<model name='crate'><pose>1 2 3 0 0 0.5</pose><link name='l'><collision name='c'><geometry><box><size>1 2 4</size></box></geometry>
<surface><friction><ode><mu>1</mu><mu2>0.5</mu2></ode></friction></surface></collision></link></model>
<model name='crate'><static>1</static><link name='l'/></model>
<plugin name='p' filename='f'/>
<state world_name='hall'><model name='crate'><pose>4 2 3 0 0 0</pose></model></state>
</world></sdf>"""


@pytest.fixture
def world(tmp_path):
    return parse_world(WORLD, tmp_path / "hall.world")


def test_the_table_has_a_line_for_each_model_and_its_notes_by_number(world):
    told = lines(world)
    (row,) = (line for line in told if line.startswith("crate  "))
    assert (
        "dynamic" in row
        and "1 box" in row
        and "1.00 x 2.00 x 4.00" in row
        and "4.00, 2.00, 3.00" in row
    )
    notes = [line.split("  ", 1)[1].strip() for line in told[told.index("notes") + 1 : -3]]
    moved = next(number for number, note in enumerate(notes, 1) if "<state>" in note)
    assert f"{moved} (3.00 m)" in row
    assert any(line.startswith("crate #2") and "none" in line for line in told)
    assert told[-2] == "3 models, 2 can be removed; 4 replaced, 1 ignored"
    assert told[-1].startswith(
        "the official checker (ign sdf -k) refuses a <world> with two parts of the same name: "
    )


def box(name, pose="0 0 0 0 0 0", relative=""):
    return (
        f"<model name='{name}'><static>1</static><pose{relative}>{pose}</pose><link "
        "name='l'><collision name='c'><geometry>"
        "<box><size>1 1 1</size></box></geometry></collision></link></model>"
    )


def world_of(tmp_path, *models, more=""):
    text = f"<sdf version='1.9'><world name='w'>{''.join(models)}{more}</world></sdf>"
    return parse_world(text.encode(), tmp_path / "w.sdf")


def test_models_that_must_stay_are_named(tmp_path):
    def following(name):
        return box(f"on {name}", relative=f" relative_to='{name}'")

    assert lines(world_of(tmp_path, box("a")))[-1].startswith("1 model, 1 can be removed; ")
    one = lines(world_of(tmp_path, box("a"), following("a")))[-1]
    assert one.startswith("2 models, 1 can be removed; 1 stays because others depend on it: a; ")
    many = [part for name in "abcdefg" for part in (box(name), following(name))]
    told = lines(world_of(tmp_path, *many))[-1]
    assert "; 7 stay because others depend on them: a, b, c, d, e and 2 more; " in told


STATE = "".join(
    f"<model name='crate {name}'><pose>{number} 9 3 0 0 0</pose></model>"
    for number, name in enumerate("ab")
)
CROWD = (
    box("crate a"),
    box("crate b"),
    box("a model whose name is far longer than all of the others"),
    box("箱" * 12),
)


@pytest.fixture
def crowd(tmp_path):
    return world_of(tmp_path, *CROWD, more=f"<state>{STATE}</state>")


def rows_of(told):
    return told[told.index("") + 1 : len(told) - told[::-1].index("notes") - 2]


def test_at_80_columns_each_model_of_the_ditch_has_one_line():
    ditch = read_world(ROOT / "sdf/worlds/ditch.sdf")
    told = lines(ditch, 80)
    rows = told[told.index("") + 1 :]
    assert "centre x, y, z, m" in rows[0] and "links" not in rows[0]
    assert [row.split()[0] for row in rows[1 : rows.index("")]] == [
        model.name for model in ditch.models
    ]


@pytest.mark.parametrize("columns", [20, 40, 62, 80, 120])
def test_no_line_is_wider_than_the_terminal(crowd, columns):
    told = lines(crowd, columns)
    assert max(map(width, rows_of(told))) <= columns
    assert max(map(width, told)) <= columns


def test_notes_hang_below_their_number(crowd):
    told = lines(crowd, 40)
    notes = told[told.index("notes") + 1 : told.index("", told.index("notes"))]
    assert notes[0].startswith("   1  replaced: ")
    assert any(line.startswith("      ") and line.strip() for line in notes)


def test_wide_names_stay_in_their_column(crowd):
    rows = rows_of(lines(crowd))
    starts = {width(row[: row.index("static")]) for row in rows[1:]}
    assert starts == {width(rows[0][: rows[0].index("kind")])}


def test_the_object_has_everything(world):
    told = json.loads(json.dumps(report(world)))
    crate = next(model for model in told["models"] if model["name"] == "crate")
    assert (crate["kind"], crate["removable"], crate["line"]) == ("dynamic", True, 3)
    assert crate["pose"][:3] == [4, 2, 3]
    assert (crate["low"], crate["high"]) == ([3.5, 1, 1], [4.5, 3, 5])
    assert crate["friction"] == [0.5]
    assert crate["mass"] == 1.0
    assert {note["kind"] for note in crate["notes"]} == {"replaced"}
    assert told["notes"][0]["what"] == "<plugin>"
    assert ":6: /sdf/world/plugin" in told["notes"][0]["place"]


def test_names_never_steer_the_terminal(tmp_path):
    world = parse_world(WORLD.replace(b"'crate'", "'cr\u202eate'".encode()), tmp_path / "x.sdf")
    assert not any("\u202e" in line for line in lines(world))


def test_the_commands(tmp_path, command):
    wall = DATA / "wall.sdf"
    table = ddenv("world", "check", wall)
    assert table.returncode == 0
    unseen = (
        "models without a visual, which can be hit but not seen: far_box, post, ball and 1 more"
    )
    assert table.stdout.endswith(
        f"\n7 models, 6 can be removed; nothing was replaced or ignored\n{unseen}\n"
    )
    assert len(json.loads(command("world", "check", wall, "--json").stdout)["models"]) == 7
    drawn = command("world", "show", wall)
    assert drawn.returncode == 0 and "wall" in drawn.stdout and "\x1b" not in drawn.stdout
    assert (
        command("world", "show", wall, "--svg", tmp_path / "map.svg").stdout
        == f"wrote {tmp_path / 'map.svg'}\n"
    )
    assert (tmp_path / "map.svg").read_text().startswith("<svg") or "<svg" in (
        tmp_path / "map.svg"
    ).read_text()[:200]
    assert (
        command("world", "convert", wall, "-o", tmp_path / "out.sdf").stdout
        == f"wrote {tmp_path / 'out.sdf'}\n"
    )


def test_a_scenario_stands_for_its_world(command):
    for name in (str(DATA / "wall.yaml"), "friction"):
        done = command("world", "check", name)
        assert done.returncode == 0 and "can be removed" in done.stdout


CRATE = """<model name='{name}'><pose>3 {y} 0.9 0 0 0</pose><link name='l'>
<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision></link></model>
"""


def test_a_settled_world_is_written_with_nothing_else_changed(tmp_path, command):
    ground = WORLD[WORLD.index(b"<model name='ground'") : WORLD.index(b"<model name='crate'")]
    crates = CRATE.format(name="falls", y=1) + CRATE.format(name="leans", y=1.2)
    path, out = tmp_path / "hall.world", tmp_path / "settled.world"
    path.write_bytes(
        b"<sdf version='1.6'><world name='hall'>\n" + ground + crates.encode() + b"</world></sdf>"
    )
    said = command("world", "settle", path, "-o", out)
    assert said.returncode == 0, said.stderr
    assert f"wrote {out}: 2 models moved within " in said.stdout
    assert "settling 2 models that can move" in said.stderr
    assert "falls starts 0.80 m inside leans: they push each other apart" in said.stderr
    assert parse_world(out.read_bytes(), out).model("falls").pose.position[2] < 0.6
    before, after = (re.sub(rb"<pose>[^<]*</pose>", b"", each.read_bytes()) for each in (path, out))
    assert before == after
    # `check` says it, too.
    checked = command("world", "check", path)
    assert checked.stdout.splitlines()[-1].startswith("falls starts 0.80 m inside leans")
    refused = command("world", "settle", path, "-o", path)
    assert refused.returncode == 2 and "is the world itself; choose another file" in refused.stderr


def test_it_is_said_where_each_file_was_found_and_how_to_get_those_that_were_not(
    tmp_path, monkeypatch
):
    def include(uri):
        return f"<include><uri>{uri}</uri></include>"

    for folder in ("worlds", "models/crate", "gz/barrel"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("models/crate", "gz/barrel"):
        (tmp_path / name / "model.sdf").write_text(f"<sdf version='1.6'>{box(name[-3:])}</sdf>")
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", str(tmp_path / "gz"))
    tree = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Oak%20tree"
    text = f"""<sdf version='1.6'><world name='w'>{include("model://crate")}{include("model://barrel")}
    <model name='tree'><static>1</static><link name='l'><visual name='v'><geometry>
    <mesh><uri>{tree}/2/files/meshes/a.dae</uri></mesh></geometry></visual></link></model></world></sdf>"""
    world = parse_world(text.encode(), tmp_path / "worlds" / "w.sdf")
    told = lines(world)
    assert f"   1 in models beside worlds, {tmp_path / 'models'}: model://crate" in told
    assert f"   1 in GZ_SIM_RESOURCE_PATH, {tmp_path / 'gz'}: model://barrel" in told
    assert (
        f"--fetch downloads this model from Fuel, as does gz fuel download -u {tree}/2"
        in "\n".join(told)
    )
    assert report(world)["files"][1] == {
        "uri": "model://barrel",
        "path": str(tmp_path / "gz" / "barrel" / "model.sdf"),
        "from": "GZ_SIM_RESOURCE_PATH",
    }
    assert report(world)["absent"] == [f"{tree}/2/files/meshes/a.dae"]


NOT_YET = {
    "a.sdf": (
        "<sdf version='1.6'><model name='m'><link name='l'/></model></sdf>",
        "expected one <world> inside <sdf>, found no <world>; to use its model in a world, name "
        "it in one: "
        "<include><uri>file://{file}</uri></include>",
    ),
    "b.urdf": (
        "<robot name='r'><link name='l'/></robot>",
        (
            "is a robot in URDF, and no world; name it in one: "
            "<include><uri>file://{file}</uri></include>"
        ),
    ),
    "c.world.xacro": (
        (
            "<sdf version='1.6' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arg "
            "name='a'/><world name='w'/></sdf>"
        ),
        (
            "is xacro, not SDF; run 'xacro FILE > new.sdf' and name that file ('pip install xacro' "
            "brings the command)"
        ),
    ),
}


@pytest.mark.parametrize("name", NOT_YET)
def test_what_is_no_world_yet_says_how_it_becomes_one(tmp_path, monkeypatch, capsys, name):
    text, advice = NOT_YET[name]
    file = tmp_path / name
    file.write_text(text)
    for words in (("world", "check"), ("run",)):
        said = in_process(monkeypatch, capsys, *words, file)
        assert said.returncode == 2
        (line,) = said.stderr.splitlines()
        assert line.endswith(advice.format(file=file))


def test_a_model_is_included_as_the_refusal_says(tmp_path):
    (tmp_path / "a b.sdf").write_text(f"<sdf version='1.6'>{box('crate')}</sdf>")
    with pytest.raises(UserError) as refused:
        read_world(tmp_path / "a b.sdf")
    include = str(refused.value).rpartition("name it in one: ")[2]
    assert [model.name for model in world_of(tmp_path, include).models] == ["crate"]


def test_notes_of_one_kind_are_one_line_with_their_number(tmp_path):
    missing = "<visual name='v'><geometry><mesh><uri>model://{}</uri></mesh></geometry></visual>"
    visuals = [
        missing.format(name).replace("'v'", f"'v{at}'")
        for at, name in enumerate(["a", "b", "c", "a"])
    ]
    model = f"<model name='m'><static>1</static><link name='l'>{''.join(visuals)}</link></model>"
    told = lines(world_of(tmp_path, model, more="<plugin name='p' filename='f'/>"))
    (drawn,) = (line for line in told if "is not drawn" in line)
    assert drawn.lstrip().startswith("2  ignored: <mesh> 'model://a' is not drawn: ")
    assert drawn.endswith("; and 2 others like it (4 times)")
    assert "   1  ignored: <plugin> plugins are not run" in told
    assert told[-1].endswith("; 5 ignored")
