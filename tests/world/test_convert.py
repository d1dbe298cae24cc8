"""A converted world is one that Drake's own parser loads, with everything where it was."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from ddenv.errors import UserError
from ddenv.world.load import SDF
from ddenv.world.sdf.read import parse_world, read_world
from ddenv.world.write import convert, write_converted
from tests.conftest import DATA
from tests.tiers import slow
from tests.world.sdf.test_joints import LINKS, joint


def loaded(path):
    """The plant that Drake makes of a file, and its context."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.001)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = builder.Build().CreateDefaultContext()
    return plant, scene_graph, plant.GetMyContextFromRoot(context)


def assert_same_in_drake(world, path):
    """Every link of `world` is in the plant of `path`, at its place, with its shapes and its
    mass.
    """
    plant, _, context = loaded(path)
    again = read_world(path)
    assert len(again.elements()) == len(world.elements())
    for model, copy in zip(world.models, again.models, strict=True):
        instance = plant.GetModelInstanceByName(copy.name)
        for link, twin in zip(model.links, copy.links, strict=True):
            body = plant.GetBodyByName(twin.name, instance)
            there = plant.EvalBodyPoseInWorld(context, body)
            assert there.translation() == pytest.approx(np.array(link.pose.position), abs=1e-9)
            assert there.rotation().matrix() == pytest.approx(link.pose.rotation(), abs=1e-9)
            if link.inertia is not None:
                assert body.default_mass() == pytest.approx(link.inertia.mass)
            assert len(plant.GetCollisionGeometriesForBody(body)) == len(link.collisions)
        assert len(plant.GetJointIndices(instance)) >= len(model.joints)


OWN = [DATA / "wall.sdf", SDF / "worlds" / "ditch.sdf"]


@pytest.mark.parametrize(
    "path", slow(pytest.mark.rates, OWN, but=OWN[:1]), ids=lambda path: path.stem
)
def test_our_own_worlds(path, tmp_path):
    world = read_world(path)
    assert write_converted(world, tmp_path / "clean.sdf") == [tmp_path / "clean.sdf"]
    assert_same_in_drake(world, tmp_path / "clean.sdf")


def of_text(inside, tmp_path, version="1.6"):
    text = f"<sdf version='{version}'><world name='w'>{inside}</world></sdf>"
    return parse_world(text.encode(), tmp_path / "in.sdf")


AXES = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"
JOINTS = (
    joint(
        "prismatic", "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis>"
    )
    + joint("ball", child="c", name="k")
    + "<link name='d'/>"
    + joint("universal", f"<pose>0 0 0 0.3 0.2 0.5</pose>{AXES}", "c", "d", "l")
)


def test_what_drake_refuses_in_the_original_is_written_so_that_it_loads(tmp_path):
    points = "<point>0 0</point><point>1 0</point><point>0 1</point>"
    shapes = (
        "<collision "
        f"name='c'><geometry><polyline><height>1</height>{points}</polyline></geometry></collision>"
        "<collision "
        "name='c'><geometry><capsule><radius>1</radius><length>1</length></capsule></geometry></collision>"
        "<collision name='d'><geometry><ellipsoid><radii>1 2 "
        "3</radii></ellipsoid></geometry></collision>"
        "<visual name='v'><geometry><sphere><radius>1</radius></sphere></geometry></visual>"
    )
    nested = f"<model name='in'><pose>0 0 1 1 0 0</pose><link name='a'>{shapes}</link></model>"
    state = "<state><model name='a b'><pose>3 2 1 0.1 0.2 0.3</pose></model></state>"
    world = of_text(
        f"<model name='a b'><pose frame=''>1 2 3 0 0 0</pose>{LINKS}{JOINTS}{nested}</model>"
        f"<model name='a b'><static>1</static><link name='l'>{shapes}</link></model>"
        "<model name='Häuser [2]'><link name='l'><gravity>0</gravity></link></model>" + state,
        tmp_path,
    )
    written = write_converted(world, tmp_path / "clean.sdf")
    assert written[0] == tmp_path / "clean_meshes" / "mesh_1.obj"
    assert_same_in_drake(world, tmp_path / "clean.sdf")


def test_reading_what_was_written_gives_the_same_world(tmp_path):
    world = of_text(
        f"<model name='m'><pose>1 2 3 0.1 0.2 0.3</pose>{LINKS}{JOINTS}</model>", tmp_path
    )
    again = parse_world(convert(world, "meshes")[0], tmp_path / "clean.sdf")
    assert again.notes == ()
    for link, twin in zip(world.models[0].links, again.models[0].links, strict=True):
        assert twin.pose.position == pytest.approx(link.pose.position, abs=1e-9)
    for one, twin in zip(world.models[0].joints, again.models[0].joints, strict=True):
        assert twin.pose.position == pytest.approx(one.pose.position, abs=1e-9)
        assert one.kind == "ball" or twin.axis == pytest.approx(one.axis, abs=1e-9)
        assert (twin.kind, twin.lower, twin.upper) == (one.kind, one.lower, one.upper)


def test_the_world_itself_is_never_overwritten(tmp_path):
    path = tmp_path / "w.sdf"
    path.write_bytes((DATA / "wall.sdf").read_bytes())
    with pytest.raises(UserError, match="is the world itself"):
        write_converted(read_world(path), tmp_path / "." / "w.sdf")
    assert path.read_bytes() == (DATA / "wall.sdf").read_bytes()
