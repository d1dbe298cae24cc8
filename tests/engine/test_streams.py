"""What a run's streams say, as any reader of MCAP gets it back."""

import math
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from ddenv.engine.mcap_file import (
    KINDS,
    Streams,
    _chosen,
    definition,
    header,
    marker,
    messages,
    nanoseconds,
)
from ddenv.robot.protocol import Estimate, Imu, Reading, Scan, Twist, WheelSpeeds
from ddenv.world import scenario
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Link,
    Mesh,
    Model,
    Plane,
    Sphere,
)
from ddenv.world.pose import Pose
from tests.workbench import fake_moments, fake_run

COLOR = (0.5, 0.5, 0.5, 1.0)
SHAPES = [
    Box((1.0, 2.0, 3.0)),
    Sphere(0.5),
    Ellipsoid((1.0, 2.0, 3.0)),
    Cylinder(0.5, 2.0),
    Capsule(0.5, 2.0),
    Mesh("m", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])),
]


def read_back(rows):
    """Decoded messages by topic."""
    output = BytesIO()
    writer = Writer(output)
    schemas = {kind: writer.register_msgdef(kind, definition(kind)) for kind in KINDS}
    for topic, kind, seconds, message in rows:
        writer.write_message(topic, schemas[kind], message, nanoseconds(seconds))
    writer.finish()
    output.seek(0)
    found = {}
    for _, channel, _, decoded in make_reader(
        output, decoder_factories=[DecoderFactory()]
    ).iter_decoded_messages():
        found.setdefault(channel.topic, []).append(decoded)
    return found


def model(name, shape):
    link = Link(
        name="link",
        pose=Pose((1.0, 2.0, 0.0)),
        inertia=None,
        collisions=(Collision(name="c", shape=shape, pose=Pose((1.0, 2.0, 0.5)), mu=1.0),),
        visuals=(),
    )
    return Model(name=name, pose=Pose(), static=True, links=(link,), joints=(), spans=(), line=1)


@pytest.fixture
def found():
    """A short run among a box that stays, one that moves, and one that is left out."""
    world = SimpleNamespace(models=[model(name, SHAPES[0]) for name in ("stays", "moves", "gone")])
    lidar = scenario.Lidar(beams=3, range=8.0)
    settings = SimpleNamespace(
        goal=SimpleNamespace(x=3.0, y=4.0), sensors=SimpleNamespace(lidar=lidar)
    )
    subject = SimpleNamespace(
        world=world,
        robot=model("robot", SHAPES[3]),
        scenario=settings,
        elements=("stays", "moves", "gone"),
    )
    rows = np.array([[0.0, 1, 2, 3, 1, 0, 0, 0], [1.25, 2, 2, 3, 0, 0, 0, 1]])
    result = SimpleNamespace(
        trajectory=rows, motions={"moves": rows[:1]}, first_touched={"moves": 0.5}
    )
    streams = Streams(SimpleNamespace(joints=("left", "right")))
    scan = Scan(0.1, np.array([-1.0, 0.0, 1.0]), np.array([2.0, np.inf, 3.0]), (0.3, 0.0, 0.4))
    guess = Estimate(1.0, 2.0, math.pi / 2, 0.4, 0.1, (0.1, 0.2, 0.3))
    streams.hear(Reading(0.1, guess, (1.0, 2.0), Imu(0.5, 0.0, 0.0), None, scan), Twist(0.6, -0.2))
    streams.hear(Reading(0.2, guess), WheelSpeeds({"right": 2.0}))
    return read_back(messages("left", frozenset({"stays", "moves"}), result, streams, subject))


def test_models_that_move_have_a_frame_of_their_own_and_what_was_left_out_is_not_there(found):
    (drawn,) = found["models"]
    assert [(each.ns, each.header.frame_id) for each in drawn.markers] == [
        ("stays", "map"),
        ("moves", "left/moves"),
    ]
    stays, moves = (each.pose.position for each in drawn.markers)
    assert (stays.x, stays.y, stays.z) == (1.0, 2.0, 0.5)
    # In the frame of its first link.
    assert (moves.x, moves.y, moves.z) == (0.0, 0.0, 0.5)


def test_transforms_are_the_trajectories(found):
    moved = [
        (each.child_frame_id, each.transform)
        for message in found["/tf"]
        for each in message.transforms
    ]
    assert [name for name, _ in moved] == [
        "left/base_link",
        "left/moves",
        "left/base_link/lidar",
        "left/base_link",
    ]
    assert (moved[3][1].translation.x, moved[3][1].rotation.z, moved[3][1].rotation.w) == (
        2.0,
        1.0,
        0.0,
    )
    assert found["/tf"][3].transforms[0].header.stamp.nanosec == 250_000_000
    assert found["touched"][0].data == "moves"


def test_sensors_estimate_and_commands_are_what_the_controller_had(found):
    assert list(found["scan"][0].ranges) == [2.0, math.inf, 3.0]
    assert found["scan"][0].angle_increment == pytest.approx(1.0)
    assert found["scan"][0].range_max == 8.0
    assert len(found["odom"]) == 2
    assert found["odom"][0].pose.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert [found["odom"][0].pose.covariance[place] for place in (0, 7, 35)] == pytest.approx(
        [0.01, 0.04, 0.09]
    )
    assert (list(found["joint_states"][0].name), list(found["joint_states"][0].velocity)) == (
        ["left", "right"],
        [1.0, 2.0],
    )
    assert found["imu"][0].angular_velocity.z == 0.5
    assert (found["cmd_vel"][0].twist.linear.x, found["cmd_vel"][0].twist.angular.z) == (0.6, -0.2)
    assert list(found["cmd_wheels"][0].name) == ["right"]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_every_shape_with_an_end_has_a_marker(shape):
    drawn = marker(3, "map", "one", Pose((1.0, 0.0, 0.0)), shape, COLOR)
    (read,) = read_back(
        [("markers", "visualization_msgs/msg/MarkerArray", 0.0, {"markers": [drawn]})]
    )["markers"]
    assert (read.markers[0].id, read.markers[0].pose.position.x) == (3, 1.0)
    assert len(read.markers[0].points) == (3 if isinstance(shape, Mesh) else 0)


def test_a_plane_has_none():
    assert marker(0, "map", "one", Pose(), Plane((1.0, 1.0)), COLOR) is None


@given(st.floats(0.0, 1e5))
def test_stamps_are_right_to_the_nanosecond(seconds):
    stamp = header(seconds, "map")["stamp"]
    assert 0 <= stamp["nanosec"] < 1_000_000_000
    assert stamp["sec"] + 1e-9 * stamp["nanosec"] == pytest.approx(
        seconds, abs=1e-9 + 1e-15 * seconds
    )


def test_the_run_that_passes_is_one_in_the_nearest_world_that_does(tmp_path):
    for moment, removal in ((fake_moments.finished, None), (fake_moments.isolated, 2)):
        run = moment(fake_run.FakeRun(tmp_path / f"{moment.__name__}.ddenv"))
        chosen = dict(_chosen(run.file, run.state))
        assert list(chosen) == ["whole", "left", "passing"]
        test = run.state.tests[chosen["passing"] - 1]
        assert (test.outcome, test.removal) == ("pass", removal)
        if removal is not None:
            assert run.state.tests[chosen["whole"] - 1].seed == test.seed
        run.close()
