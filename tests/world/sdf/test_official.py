"""What the official SDF checker says of our files and of those that we write, and what we foretell
of it.
"""

import os
import random
import re
import resource
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest
from docs.lessons.record import world_of
from docs.lessons.toys import TOYS

from ddenv.cli.world import world_lines, world_report
from ddenv.errors import UserError
from ddenv.learn.catalog import LESSONS
from ddenv.runfile.store import RunFile
from ddenv.world.access import MissingFiles
from ddenv.world.scenario import Reading
from ddenv.world.sdf.known_elements import known_children
from ddenv.world.sdf.official import refused
from ddenv.world.sdf.read import parse_world, read_world
from ddenv.world.write import convert, without, write_converted
from tests.conftest import DATA, ROOT

SHIPPED = sorted(
    path for folder in ("sdf", "scenarios", "docs") for path in (ROOT / folder).rglob("*.[sw]*[df]")
)
WORLDS = [path for path in SHIPPED if b"<world " in path.read_bytes()]
ACCEPTED = "Valid."


# For the checker, bytes: of a world of 3,000 models it takes more than 15 GB.
MEMORY = 3 << 30


def complaints(path, model_path=()):
    """What the official checker finds wrong with a file: how often each line. Skips where it needs
    too much memory.
    """
    said = subprocess.run(
        ["ign", "sdf", "-k", path],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "SDF_PATH": os.pathsep.join(map(str, model_path))},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    )
    if "bad_alloc" in said.stderr or "allocate memory" in said.stderr or said.returncode < 0:
        pytest.skip("the official checker needs more memory than it is given")
    if said.returncode == 0 and ACCEPTED in said.stdout:
        return Counter()
    # Lines move up where models before them go.
    lines = re.sub(r"(:L|Line number=)\d+", "", said.stdout + said.stderr).splitlines()
    return Counter(line for line in lines if "rror" in line and "backward" not in line)


@pytest.fixture
def official(tmp_path):
    """The checker's complaints of a file's text."""
    if shutil.which("ign") is None:
        pytest.skip(
            "needs the official SDF checker: apt-get install ignition-tools libsdformat-dev"
        )

    def ask(text):
        path = tmp_path / "asked.sdf"
        path.write_bytes(text)
        return complaints(path)

    # It is there, and says no.
    assert ask(b"<sdf version='1.9'><world/></sdf>")
    return ask


BOX = "<geometry><box><size>1 1 1</size></box></geometry>"


def model(name, parts, static=1):
    return f"<model name='{name}'><static>{static}</static><link name='l'>{parts}</link></model>"


def inertia(*moments):
    tags = "".join(
        f"<{tag}>{value}</{tag}>"
        for tag, value in zip(("ixx", "iyy", "izz", "ixy"), moments, strict=False)
    )
    return f"<inertial><mass>1</mass><inertia>{tags}</inertia></inertial>"


def test_what_the_official_checker_refuses_is_noted(tmp_path):
    same = f"<collision name='a'>{BOX}</collision><visual name='a'>{BOX}</visual>"
    inside = [
        model("first", same),
        model("second", same),
        model("plate", inertia(1, 1, 2.0001), static=0),
        model("turned", inertia(1, 1, 1, 2), static=0),
        model("huge", inertia("1e308", "1e308", "1e308", "1e307")),
        model("__odd__", ""),
        model("a::b", ""),
        "<light name='first' type='point'/><plugin name='second' filename='f'/>",
    ]
    world = parse_world(
        "\n".join(["<sdf version='1.9'><world name='w'>", *inside, "</world></sdf>"]).encode(),
        tmp_path / "w.sdf",
    )
    found = [
        (entry["why"], entry["place"].split(":")[1]) for entry in world_report(world)["refused"]
    ]
    twice = "a <{}> with two parts of the same name"
    assert Counter(found) == Counter(
        [
            *(
                (twice.format("link"), "2"),
                (twice.format("link"), "3"),
                (twice.format("world"), "9"),
            ),
            *(("an inertia that no body has", "4"), ("an inertia that no body has", "5")),
            *(("a name that is reserved", "7"), ("'::' in a name", "8")),
        ]
    )
    (line,) = (line for line in world_lines(world) if "refuses a <link>" in line)
    assert "w.sdf:2: " in line and line.endswith(", and 1 more")
    assert refused(parse_world(convert(world, "m")[0], tmp_path / "clean.sdf")) == []
    old = world.text.replace(b"1.9", b"1.6")
    assert not any("::" in why for why, _ in refused(parse_world(old, tmp_path / "old.sdf")))


@pytest.mark.parametrize(
    "path", [path for path in WORLDS if path.name != "ditch.sdf"], ids=lambda path: path.stem
)
def test_our_worlds_have_nothing_to_note(path):
    assert refused(read_world(path)) == []


@pytest.mark.programs
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_we_ship_is_valid(path, official):
    assert complaints(path) == Counter()


@pytest.mark.programs
def test_the_worlds_of_lessons_are_valid(official):
    texts = {world_of(toy).encode() for toy in TOYS.values()}
    for path in LESSONS.glob("*.ddenv"):
        with RunFile(path) as run:
            documents = run.documents("")
        texts |= {documents["world"], documents["robot"]}
    for text in texts:
        assert official(text) == Counter(), text[:200]


@pytest.mark.programs
@pytest.mark.parametrize("path", [*WORLDS, *DATA.glob("*.world")], ids=lambda path: path.stem)
def test_converted_and_minimal_worlds_are_valid(path, official, tmp_path):
    world = read_world(path, Reading(model_path=(DATA / "models",)))
    write_converted(world, tmp_path / "clean.sdf")
    assert complaints(tmp_path / "clean.sdf") == Counter()
    whole, dice = official(world.text), random.Random(path.name)
    for share in (0.3, 0.9):
        removed = frozenset(name for name in world.elements() if dice.random() < share)
        # Of a world that is not valid the minimal one has no new complaints.
        assert official(without(world, removed)) <= whole


def generated(dice):
    """A world of boxes, frames, joints, nested models and lights; in two of three worlds some have
    odd names or moments.
    """
    odd, impossible = dice.choice(
        [([], 0), (["same", "same", "__odd__", "x::y"], 0), (["same"], 1)]
    )

    def name(kind):
        plain = f"{kind} {dice.randrange(10**6)}"
        return dice.choice([plain, f"Бочка {plain}"] * 12 + odd)

    def link(own):
        tensor = dice.choice(
            [(1, 1, 1), (0.1, 0.2, 0.25), (1, 1, 2), (1, 1, 1, 0.5)]
            + [(1, 1, 2.00001), (1, 1, 1, 2)] * impossible
        )
        parts = [
            f"<{kind} name='{name(kind)}'>{BOX}</{kind}>"
            for kind in ("collision", "visual", "visual")
        ]
        return f"<link name='{own}'>{inertia(*tensor)}{''.join(parts[: dice.randrange(4)])}</link>"

    def one(own, depth=0):
        joint = (
            f"<joint name='{name('joint')}' type='fixed'><parent>k</parent><child>l</child></joint>"
        )
        inner = one(name("inner"), depth + 1) if depth < 2 and dice.random() < 0.3 else ""
        more = (
            link("k") + joint
            if dice.random() < 0.5
            else f"<frame name='{name('frame')}' attached_to='l'/>"
        )
        place = (
            f" relative_to='{dice.choice(names)}'"
            if names and not depth and dice.random() < 0.3
            else ""
        )
        static = dice.randrange(2)
        return (
            f"<model name='{own}'><static>{static}</static><pose{place}>1 0 0 0 0 "
            f"0</pose>{link('l')}{more}{inner}</model>"
        )

    names, inside = [], []
    for number in range(8):
        inside.append(one(f"model_{number}"))
        names.append(f"model_{number}")
    inside.append(f"<model name='{name('model')}'><static>1</static><link name='l'/></model>")
    inside.append(
        f"<light name='{name('light')}' type='point'><pose relative_to='model_7'>0 0 1 0 0 "
        "0</pose></light>"
    )
    inside.append(f"<frame name='marked' attached_to='{dice.choice(names)}'/>")
    text = (
        f"<sdf version='{dice.choice(['1.7', '1.8', '1.9'])}'><world "
        f"name='w'>{''.join(inside)}</world></sdf>"
    )
    return text.encode()


@pytest.mark.programs
def test_generated_worlds_are_judged_as_foretold(official, tmp_path):
    valid = 0
    for seed in range(25):
        dice = random.Random(seed)
        world = parse_world(generated(dice), tmp_path / "made.sdf")
        removed = frozenset(name for name in world.elements() if dice.random() < 0.5)
        smaller = parse_world(without(world, removed), tmp_path / "smaller.sdf")
        for each in (world, smaller):
            said = official(each.text)
            assert bool(said) == bool(refused(each)), (seed, said, refused(each))
        valid += not refused(world)
        # The checker names only the first mistakes, so those of the smaller world are counted by
        # what we foretell.
        assert Counter(why for why, _ in refused(smaller)) <= Counter(
            why for why, _ in refused(world)
        ), seed
        assert official(convert(world, "meshes")[0]) == Counter(), seed
    assert 5 <= valid <= 15


# What stands in a world, and what is said of it; an empty text is said of what the checker accepts.
JUDGED = {
    "<light name='s' type='point'><attenuation><range>far</range></attenuation></light>": "a <range> that is not a number",
    "<light name='s' type='point'><attenuation><range/></attenuation></light>": "an empty <range>",
    "<light name='s' type='point'><attenuation><range>12 m</range></attenuation></light>": "",
    "<light name='s' type='point'><attenuation><range>1e400</range></attenuation></light>": "a <range> that is not a number",
    "<light name='s' type='point'><cast_shadows>yes</cast_shadows></light>": "a <cast_shadows> that is not true or false",
    "<light name='s' type='point'><cast_shadows>True</cast_shadows></light>": "",
    "<light name='s' type='point'><direction>0 0</direction></light>": "a <direction> that is not 3 numbers",
    "<light name='s' type='point'><direction>0 0 nan</direction></light>": "a <direction> that is not 3 numbers",
    "<light name='s' type='point'><direction>0 0 1 5</direction></light>": "",
    "<light name='s' type='point'><diffuse>255 0 0</diffuse></light>": "a <diffuse> that is not 3 or 4 numbers from 0 to 1",
    "<light name='s' type='point'><diffuse>1 0 .5</diffuse></light>": "",
    "<light name='s' type='point'><pose>0 0 1</pose></light>": "a <pose> that is not 6 numbers",
    "<light name='s' type='glow'/>": "a <light> of an unknown type",
    "<light type='point'/>": "a <light> without its name",
    "<light name='s'/>": "a <light> without its type",
    "<state world_name='w'><sim_time>0</sim_time></state>": "a <sim_time> that is not seconds and nanoseconds",
    "<state world_name='w'><sim_time>0 0</sim_time></state>": "",
    "<state><sim_time>0 0</sim_time></state>": "a <state> without its world_name",
    "<frame name='f' attached_to='nothing'/>": "a <frame> that is attached to nothing",
    "<frame name='f' attached_to='f'/>": "a <frame> that is attached to nothing",
    "<frame name='f' attached_to='world'/>": "",
    "<frame name='f'><pose relative_to='nothing'>0 0 0 0 0 0</pose></frame>": "a <frame> whose pose is relative to nothing",
    "<model name='m'><link name='l'/></model><frame name='f' attached_to='m::l'/>": "",
    "<model name='m'><link name='l'/></model><frame name='f' attached_to='m::k'/>": "a <frame> that is attached to nothing",
    "<model name='m'><link name='l'/><frame name='f' attached_to='k'/></model>": "a <frame> that is attached to nothing",
    "<model name='m'><link name='l'/><frame name='f' attached_to='__model__'/></model>": "",
    "<model name='m'><link name='l'><sensor name='s' type='nose'/></link></model>": "a <sensor> of an unknown type",
    "<physics name='p' type='ode'><max_step_size>x</max_step_size></physics>": "a <max_step_size> that is not a number",
    "<t:x><a name='b'/><a name='b'/></t:x>": "",
    "<t:x name='a'/><model name='a'><link name='l'/></model>": "a <world> with two parts of the same name",
    "<foo><pose>x</pose></foo><plugin name='p' filename='f'><pose>x</pose></plugin>": "",
    "<plugin filename='f'/>": "a <plugin> without its name",
    "<include><uri>crate</uri></include>": "",
    "<include><uri>crate</uri><name>a</name></include><include><uri>crate</uri><name>b</name></include>": "",
    "<include><uri>crate</uri></include><include><uri>crate</uri></include>": "a <world> with two parts of the same name",
    "<model name='box'><link name='l'/></model><include><uri>crate</uri></include>": "a <world> with two parts of the same name",
    "<include><uri>crate</uri></include><frame name='f' attached_to='box::l'/>": "",
    "<include><uri>crate</uri></include><frame name='f' attached_to='box::k'/>": "a <frame> that is attached to nothing",
    "<include><uri>twice</uri></include>": "a <link> with two parts of the same name",
    "<include><uri>heavy</uri></include>": "an inertia that no body has",
}


@pytest.fixture(scope="module")
def included(tmp_path_factory):
    """A folder of models to include."""
    folder = tmp_path_factory.mktemp("models")
    same = f"<collision name='a'>{BOX}</collision><visual name='a'>{BOX}</visual>"
    models = {"crate": ("box", ""), "twice": ("twice", same), "heavy": ("heavy", inertia(1, 1, 3))}
    for name, (own, parts) in models.items():
        (folder / name).mkdir()
        (folder / name / "model.config").write_text(
            "<model><sdf version='1.9'>model.sdf</sdf></model>"
        )
        (folder / name / "model.sdf").write_text(
            f"<sdf version='1.9'>{model(own, parts, static=0)}</sdf>"
        )
    return folder


def made(inside, folder):
    text = f"<sdf version='1.9'><world name='w'>{inside}</world></sdf>".replace(
        "<uri>", "<uri>model://"
    )
    return parse_world(text.encode(), folder / "made.sdf", Reading(model_path=(folder,)))


@pytest.mark.parametrize("inside", JUDGED)
def test_what_is_said_of_a_part(inside, included):
    assert [why for why, _ in refused(made(inside, included))] == [JUDGED[inside]][
        : bool(JUDGED[inside])
    ]


def test_what_is_said_of_an_included_file_points_into_it_once(included):
    twice = "".join(
        f"<include><uri>twice</uri><name>n{number}</name></include>" for number in range(3)
    )
    ((_, where),) = refused(made(twice, included))
    assert where.startswith(f"{included / 'twice' / 'model.sdf'}:1: /sdf/model[@name='twice']/link")


@pytest.mark.parametrize(
    "text", [b"<sdf version='1.9'><world/></sdf>", b"<sdf version='1.9'><world name=''/></sdf>"]
)
def test_a_world_without_a_name_is_noted(text, tmp_path):
    assert [why for why, _ in refused(parse_world(text, tmp_path / "w.sdf"))] == [
        "a <world> without its name"
    ]


@pytest.mark.programs
@pytest.mark.parametrize("inside", JUDGED)
def test_the_checker_says_so_too(inside, included, official):
    path = included / "made.sdf"
    path.write_bytes(made(inside, included).text)
    assert bool(complaints(path, [included])) == bool(JUDGED[inside])


@pytest.mark.programs
def test_the_table_of_known_elements_is_the_checker_s_own():
    folder = Path("/usr/share/sdformat12/1.9")
    if not folder.is_dir():
        pytest.skip("needs the description of SDF: apt-get install libsdformat-dev")
    described = {}
    for path in folder.glob("*.sdf"):
        for parent in ElementTree.parse(path).getroot().iter("element"):
            for child in parent.findall("element[@type]"):
                described.setdefault((parent.get("name"), child.get("name")), set()).add(
                    child.get("type")
                )
    same = {"unsigned int": "unsigned", "vector2d": "vector2", "string": ""}
    for (parent, tag), kinds in described.items():
        kind = known_children()[parent][tag].kind.replace("string", "")
        assert kind in {same.get(each, each) for each in kinds}, (parent, tag)
    assert len(described) > 300


PUBLIC = [
    ROOT.parent / "shared" / "repros" / "worlds",
    ROOT.parent / "shared" / "worlds" / "public" / "gz_examples",
]
WITH_A_WORLD = [
    path
    for folder in PUBLIC
    for path in sorted([*folder.rglob("*.sdf"), *folder.rglob("*.world")])
    if b"<world" in path.read_bytes()
] or [None]


@pytest.mark.programs
@pytest.mark.parametrize(
    "path", WITH_A_WORLD, ids=lambda path: f"{path.parent.name}-{path.stem}" if path else "none"
)
def test_public_worlds_are_judged_as_by_the_checker(path, official):
    if path is None:
        pytest.skip(
            "needs the folders repros/worlds and worlds/public/gz_examples in a folder shared "
            "beside the checkout"
        )
    model_path = [path.parent / "models"] if (path.parent / "models").is_dir() else []
    wrong = complaints(path, model_path)
    try:
        said = refused(read_world(path, Reading(model_path=tuple(model_path))))
    except MissingFiles as missing:
        # The checker does not look for meshes.
        said = [str(missing)] if wrong else []
    except UserError as error:
        if wrong:
            return
        pytest.skip(f"the checker accepts what is not supported: {error}")
    assert bool(said) == bool(wrong), (said, wrong)
