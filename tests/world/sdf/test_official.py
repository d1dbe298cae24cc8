"""What the official SDF checker says of our files and of those that we write, and what we foretell of it."""

import random
import re
import shutil
import subprocess
from collections import Counter

import pytest
from docs.lessons.record import world_of
from docs.lessons.toys import TOYS

from ddenv.cli.world import world_lines, world_report
from ddenv.learn.shelf import LESSONS
from ddenv.runfile.store import RunFile
from ddenv.world.scenario import Reading
from ddenv.world.sdf.official import refused
from ddenv.world.sdf.read import parse_world, read_world
from ddenv.world.write import convert, without, write_converted
from tests.conftest import DATA, ROOT

SHIPPED = sorted(path for folder in ("sdf", "scenarios", "docs") for path in (ROOT / folder).rglob("*.[sw]*[df]"))
WORLDS = [path for path in SHIPPED if b"<world " in path.read_bytes()]
ACCEPTED = "Valid."


def complaints(path):
    """What the official checker finds wrong with a file: how often each line."""
    said = subprocess.run(["ign", "sdf", "-k", path], capture_output=True, text=True, check=False)
    if said.returncode == 0 and ACCEPTED in said.stdout:
        return Counter()
    # Lines move up where models before them go.
    lines = re.sub(r"(:L|Line number=)\d+", "", said.stdout + said.stderr).splitlines()
    return Counter(line for line in lines if "rror" in line and "backward" not in line)


@pytest.fixture
def official(tmp_path):
    """The checker's complaints of a file's text."""
    if shutil.which("ign") is None:
        pytest.skip("needs the official SDF checker: apt-get install ignition-tools libsdformat-dev")

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
    tags = "".join(f"<{tag}>{value}</{tag}>" for tag, value in zip(("ixx", "iyy", "izz", "ixy"), moments, strict=False))
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
        "\n".join(["<sdf version='1.9'><world name='w'>", *inside, "</world></sdf>"]).encode(), tmp_path / "w.sdf"
    )
    found = [(entry["why"], entry["place"].split(":")[1]) for entry in world_report(world)["refused"]]
    twice = "a <{}> with two parts of the same name"
    assert Counter(found) == Counter(
        [
            *((twice.format("link"), "2"), (twice.format("link"), "3"), (twice.format("world"), "9")),
            *(("an inertia that no body has", "4"), ("an inertia that no body has", "5")),
            *(("a name that is reserved", "7"), ("'::' in a name", "8")),
        ]
    )
    (line,) = (line for line in world_lines(world) if "refuses a <link>" in line)
    assert "w.sdf:2: " in line and line.endswith(", and 1 more")
    assert refused(parse_world(convert(world, "m")[0], tmp_path / "clean.sdf")) == []
    old = world.text.replace(b"1.9", b"1.6")
    assert not any("::" in why for why, _ in refused(parse_world(old, tmp_path / "old.sdf")))


@pytest.mark.parametrize("path", [path for path in WORLDS if path.name != "ditch.sdf"], ids=lambda path: path.stem)
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
    """A world of boxes, frames, joints, nested models and lights; in two of three worlds some have odd names or moments."""
    odd, impossible = dice.choice([([], 0), (["same", "same", "__odd__", "x::y"], 0), (["same"], 1)])

    def name(kind):
        plain = f"{kind} {dice.randrange(10**6)}"
        return dice.choice([plain, f"Бочка {plain}"] * 12 + odd)

    def link(own):
        tensor = dice.choice(
            [(1, 1, 1), (0.1, 0.2, 0.25), (1, 1, 2), (1, 1, 1, 0.5)] + [(1, 1, 2.00001), (1, 1, 1, 2)] * impossible
        )
        parts = [f"<{kind} name='{name(kind)}'>{BOX}</{kind}>" for kind in ("collision", "visual", "visual")]
        return f"<link name='{own}'>{inertia(*tensor)}{''.join(parts[: dice.randrange(4)])}</link>"

    def one(own, depth=0):
        joint = f"<joint name='{name('joint')}' type='fixed'><parent>k</parent><child>l</child></joint>"
        inner = one(name("inner"), depth + 1) if depth < 2 and dice.random() < 0.3 else ""
        more = link("k") + joint if dice.random() < 0.5 else f"<frame name='{name('frame')}' attached_to='l'/>"
        place = f" relative_to='{dice.choice(names)}'" if names and not depth and dice.random() < 0.3 else ""
        static = dice.randrange(2)
        return f"<model name='{own}'><static>{static}</static><pose{place}>1 0 0 0 0 0</pose>{link('l')}{more}{inner}</model>"

    names, inside = [], []
    for number in range(8):
        inside.append(one(f"model_{number}"))
        names.append(f"model_{number}")
    inside.append(f"<model name='{name('model')}'><static>1</static><link name='l'/></model>")
    inside.append(f"<light name='{name('light')}' type='point'><pose relative_to='model_7'>0 0 1 0 0 0</pose></light>")
    inside.append(f"<frame name='marked' attached_to='{dice.choice(names)}'/>")
    text = f"<sdf version='{dice.choice(['1.7', '1.8', '1.9'])}'><world name='w'>{''.join(inside)}</world></sdf>"
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
        # The checker names only the first mistakes, so those of the smaller world are counted by what we foretell.
        assert Counter(why for why, _ in refused(smaller)) <= Counter(why for why, _ in refused(world)), seed
        assert official(convert(world, "meshes")[0]) == Counter(), seed
    assert 5 <= valid <= 15
