"""The world on the stage: what is sent to browsers."""

from __future__ import annotations

import json

import numpy as np
import pytest
import umsgpack

from ddenv.errors import UserError
from ddenv.runfile.fold import fold
from ddenv.runfile.tested import Wanted
from ddenv.scene.camera import scale_of, view
from ddenv.scene.draw import MOST_LETTERS, Scenery, path_on_ground, safe_name
from ddenv.scene.mesh import box, outline, paint, sphere
from ddenv.scene.player import Player
from ddenv.scene.shot import Shot, shot
from ddenv.scene.stage import Stage
from ddenv.scene.wheels import Wheels
from ddenv.world.load import SDF
from ddenv.world.model import Box, Collision, Link, Model, Sphere, Visual, World
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import read_model, read_world
from tests.conftest import ROOT
from tests.scene.conftest import straight

ARM = ROOT / "docs/examples/arm"
ROBOT = read_model(SDF / "robots" / "husky.sdf")


class Screen:
    """A browser that keeps what it is told, as Meshcat's viewer does."""

    def __init__(self) -> None:
        self.things: dict[str, dict] = {}
        self.visible: dict[str, bool] = {}
        self.poses: dict[str, np.ndarray] = {}
        self.count = 0

    def take(self, message: bytes, _: bool = False) -> None:
        self.count += 1
        command = umsgpack.unpackb(
            message, ext_handlers={code: lambda ext: ext for code in range(0x11, 0x19)}
        )
        kind, path = command["type"], command["path"]
        if kind == "set_object":
            self.things[path] = command["object"]
        elif kind == "set_transform":
            self.poses[path] = np.array(command["matrix"]).reshape(4, 4).T
        elif kind == "delete":
            for kept in (self.things, self.visible, self.poses):
                for key in [key for key in kept if key == path or key.startswith(path + "/")]:
                    del kept[key]
        elif command["property"] == "visible":
            self.visible[path] = command["value"]

    def shown(self, folder: str) -> set[str]:
        return {
            path.rsplit("/", 1)[-1]
            for path, on in self.visible.items()
            if on and f"/{folder}/" in path
        }


@pytest.fixture
def screen() -> Screen:
    return Screen()


@pytest.fixture
def scenery(screen, small_world) -> Scenery:
    return Scenery(Stage(screen.take), small_world, Wheels(ROBOT), small_world.elements())


@pytest.fixture
def stage(screen) -> Stage:
    return Stage(screen.take)


@pytest.fixture
def words() -> dict:
    """The last caption."""
    return {}


@pytest.fixture
def player(writer, stage, words) -> Player:
    """The scene of a run after its baseline."""
    writer.baseline()
    made = Player(writer.run, stage, lambda **given: words.update(given))
    made.tick(10)
    return made


def test_a_link_without_visuals_shows_its_collisions():
    cube, ball = (
        Collision(name="c", shape=Box((1, 1, 1)), pose=Pose(), mu=1.0),
        Visual("v", Sphere(0.1), Pose(), (1, 0, 0, 1)),
    )
    links = (
        Link(name="seen", pose=Pose(), inertia=None, collisions=(cube,), visuals=(ball,)),
        Link(name="lost", pose=Pose(), inertia=None, collisions=(cube,), visuals=()),
    )
    (painted,) = paint(
        Model(name="m", pose=Pose(), static=True, links=links, joints=(), spans=(), line=1)
    )
    assert len(painted.faces) == len(sphere(0.1).faces) + 12
    # The robot is one mesh, too.
    assert np.isfinite(*[item.vertices for item in paint(ROBOT)]).all()


def test_names_are_safe_in_paths_and_pages():
    assert safe_name(3, "tile/é <b>1</b>") == "003 tile_é _b_1__b_"
    assert "/" not in safe_name(0, "/" * 100)


def test_outline_is_turned_as_the_model():
    class Turned:
        pose = Pose.from_rpy(1, 2, 3, 0, 0, 0.7)

    ends = outline(Turned, box((2, 1, 0.5)).at(Turned.pose))
    assert ends.shape == (24, 3)
    lengths = np.linalg.norm(ends[1::2] - ends[::2], axis=1)
    assert sorted(np.round(lengths, 6)) == [0.5] * 4 + [1] * 4 + [2] * 4


def test_a_change_of_environment_hides_what_moves_and_draws_the_rest_anew(writer, screen, scenery):
    writer.baseline()
    scenery.show(shot(fold(writer.run.events()), []))
    assert screen.shown("models") == {"003 board"}
    assert "/world/removed/all" not in screen.things and "/world/left-out/all" not in screen.things
    whole = screen.things["/world/models/still"]
    writer.round()
    writer.reduce()
    scenery.show(shot(fold(writer.run.events()), []))
    assert screen.shown("models") == set()
    assert "/world/removed/all" in screen.things and "/world/left-out/all" not in screen.things
    assert screen.things["/world/models/still"] != whole


def test_a_finished_test_is_played_by_the_browser(writer, screen, player):
    writer.round()
    writer.reduce()
    player.tick(20)
    play = player.play(1)
    assert (play["test"], play["title"], play["models"]) == (1, "baseline · test 1 · similar", 4)
    assert play["robot"][0] == [0, 0, 0, 0.132, 0, 0, 0, 1] and play["robot"][-1][:2] == [8, 3]
    # The board begins at (1, -1.5, 0.1): the browser moves what is drawn there.
    (moved,) = play["moving"].items()
    assert (moved[0], moved[1][-1][:4]) == ("003 board", [8, -0.5, 1.5, 0.032])
    assert (play["there"], play["gone"]) == (["003 board"], [])
    assert (player.play(2)["there"], player.play(2)["gone"]) == ([], ["003 board"])
    assert json.loads(json.dumps(play)) == play
    assert player.pairs() == {"tests": 2, "pairs": []}
    for number in (0, 3, 10**9):
        with pytest.raises(UserError):
            player.play(number)
    before = set(screen.things)
    for message in (
        *player.drawings("way", 1),
        *player.drawings("ghost-way", 2),
        *player.drawings("still", 1),
    ):
        screen.take(message)
    # Nothing is removed in it any more.
    ways = {"/world/trail", "/world/ghost-trail"}
    assert screen.things.keys() == (before - {"/world/removed/all"}) | ways
    # The path of the evidence is there already.
    screen.take(*player.drawings("way", 2))
    assert "/world/trail" not in screen.things


def test_a_run_with_a_moved_model_is_the_ghost_of_one_without(writer, screen, player):
    """The model stands where it was, and as a ghost where it is in that run; of a friction there is
    no such ghost.
    """
    writer.round()
    writer.reduce()
    number = {"now": 1.5, "low": -1.5, "high": 4.5, "scale": 3.0, "resolution": 0.01, "unit": "m"}
    numbers = [number | {"name": name} for name in ("left wall.y", "left wall.friction")]
    began = {
        "environment": 1,
        "rate": 1.0,
        "error": 0.01,
        "budget": 50,
        "certified": False,
        "status": "stopped",
    }
    writer.append("margins_started", {"numbers": numbers, "before": "stopped", **began})
    ended = {"failure": "", "distance": None, "end_pose": None, "wall_seconds": 0.1}
    for one in numbers:
        for run in range(6):
            ran = {
                "name": one["name"],
                "value": 2.5,
                "run": run,
                "seed": run,
                "outcome": "pass",
            } | ended
            writer.append("margin_ran", ran, {"": straight(6.0).tobytes()})
    writer.append("margins_finished", {})
    player.tick(20)
    pairs = player.pairs()["pairs"]
    assert [(pair["test"], pair["ghost"], round(pair["apart"], 3)) for pair in pairs] == [
        (2, -1, 0.3),
        (2, -7, 0.3),
    ]
    assert pairs[0]["title"] == "now and with left wall.y = 2.5 (test 2, seed 0)"
    play = player.play(-1)
    assert (play["title"], play["robot"][-1][:2]) == ("left wall.y = 2.5 · pass", [8, 6])
    screen.take(*player.drawings("ghost-way", -7))
    assert "/world/ghost-trail/model" not in screen.things
    for message in player.drawings("ghost-way", -1):
        screen.take(message)
    assert {"/world/ghost-trail", "/world/ghost-trail/model"} <= screen.things.keys()
    with pytest.raises(UserError, match="there is no run 13 with a changed number"):
        player.play(-13)


def test_partitions_have_the_colours_and_letters_of_the_map(writer, screen, player, words):
    assert words["parts"] == []
    writer.round()
    player.tick(20)
    assert [letter for letter, *_ in words["parts"]] == ["A", "A", "B", "B"]
    assert {color for _, color, *_ in words["parts"]} == {"#56b4e9", "#f0a028"}
    assert words["parts"][1][2:5] == pytest.approx((3, 0, 0.1))
    assert {path for path in screen.things if path.startswith("/world/parts")} == {
        "/world/parts/0",
        "/world/parts/1",
        "/world/parts/003 board",
    }
    # The board can move, and its letter with it.
    assert [each[5] for each in words["parts"]] == ["", "", "003 board", ""]
    writer.reduce()
    player.tick(30)
    assert words["parts"] == [] and not any(
        path.startswith("/world/parts") for path in screen.things
    )


def test_a_large_world_is_a_few_objects(screen):
    still = [
        Model(
            name=f"m{number}",
            pose=Pose((number, 0, 0)),
            static=True,
            links=(_boxed(number),),
            joints=(),
            spans=(),
            line=1,
        )
        for number in range(400)
    ]
    world = World(path=ROOT, name="large", text=b"", gravity=(0, 0, -9.8), models=tuple(still))
    scenery = Scenery(Stage(screen.take), world, Wheels(ROBOT), world.elements())
    half = frozenset(f"m{number}" for number in range(200))
    scenery.show(
        Shot(
            kind="start",
            test=None,
            models=half,
            left_out=frozenset(),
            removed=frozenset(world.elements()) - half,
            title="",
        )
    )
    assert len(screen.things) < 20
    assert {
        "/world/models/still",
        "/world/removed/all",
    } < screen.things.keys() and "/world/left-out/all" not in screen.things
    scenery.show(
        Shot(
            kind="start",
            test=None,
            models=frozenset(),
            left_out=half,
            removed=frozenset(),
            title="",
        )
    )
    assert "/world/models/still" not in screen.things and "/world/left-out/all" in screen.things
    for message in scenery.still(
        Shot(
            kind="start",
            test=None,
            models=half,
            left_out=frozenset(),
            removed=frozenset(),
            title="",
        )
    ):
        screen.take(message)
    assert "/world/models/still" in screen.things and "/world/left-out/all" not in screen.things
    hues = ((1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0))
    places = scenery.parts((str(number), hues[number % 3], [f"m{number}"]) for number in range(400))
    assert (
        len(places) == MOST_LETTERS
        and sum(path.startswith("/world/parts") for path in screen.things) == 3
    )


def _boxed(number):
    shape = Collision(name="c", shape=Box((0.5, 0.5, 0.5)), pose=Pose((number, 0, 0)), mu=1.0)
    return Link(name="l", pose=Pose((number, 0, 0)), inertia=None, collisions=(shape,), visuals=())


def test_heights_of_surfaces(scenery):
    assert scenery.height(6, 0) == pytest.approx(0.5)
    assert scenery.height(-5, 0) == 0


def test_trail_sends_only_its_last_piece_again(screen, scenery):
    rows = np.zeros((100, 8))
    rows[:, 1], rows[:, 4] = np.arange(100) * 0.1, 1.0
    scenery.trail(rows[:80])
    before = dict(screen.things)
    scenery.trail(rows)
    changed = {path for path in screen.things if screen.things[path] != before.get(path)}
    assert changed == {"/world/trail/3", "/world/trail/4"}
    scenery.trail(rows[:1])
    assert not any(path.startswith("/world/trail") for path in screen.things)


def test_each_link_at_a_joint_goes_its_own_way(screen, stage):
    scenery = Scenery(stage, read_world(ARM / "world.dmd.yaml"), Wheels(ROBOT), [])
    forearm = scenery.movers["arm::forearm"]
    start = scenery._first["arm::forearm"]
    assert f"/world/models/{forearm}/0" in screen.things
    scenery.place_models({"arm::forearm": Pose((0, 0, 1)) @ start})
    assert screen.poses[f"/world/models/{forearm}"][:3, 3] == pytest.approx((0, 0, 1))
    assert f"/world/models/{scenery.movers['arm::wrist']}" not in screen.poses
    scenery.place_models({})
    assert screen.poses[f"/world/models/{forearm}"] == pytest.approx(np.eye(4))


def test_path_on_ground_is_below_a_tilted_robot():
    upright = np.array([[0, 0, 0, 1, 1, 0, 0, 0.0]])
    on_its_side = np.array([[0, 0, 0, 1, 0.5**0.5, 0.5**0.5, 0, 0]])
    assert path_on_ground(upright, -0.5)[0] == pytest.approx((0, 0, 0.55))
    assert path_on_ground(on_its_side, -0.5)[0] == pytest.approx((0, 0.45, 1))


def test_a_late_browser_gets_the_same_and_the_stage_does_not_grow(
    writer, screen, stage, player, words
):
    writer.round()
    writer.reduce()
    player.tick(15)
    count = len(stage.messages())
    for step in range(200):
        player.tick(20 + 0.2 * step)
    assert len(stage.messages()) <= count + 1
    late = Screen()
    for message in stage.messages():
        late.take(message)
    assert late.things.keys() == screen.things.keys()
    assert late.visible == screen.visible
    assert late.poses.keys() == screen.poses.keys()
    assert words["title"].startswith("the failure in what is left · test 2 · similar")
    assert words["models"] == "2 of 4 models"


def test_an_earlier_moment_and_a_row_of_it_are_shown_until_the_present_is_wanted_again(
    writer, player, words
):
    writer.round()
    begun = writer.run.events()[-1].id
    writer.reduce()
    for wanted, title in (
        (Wanted(begun, 1, 1), "part B · not tested yet"),
        (Wanted(begun), "the failure f · test 1"),
        (Wanted(), "the failure in what is left · test 2"),
    ):
        player.show(wanted)
        player.tick(20)
        assert words["title"].startswith(title)


def test_the_camera_sees_the_robot_go_to_the_right():
    seen = view((0.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    assert seen.center == (5, 0, 0)
    assert seen.camera[1] < 0 < seen.camera[2]
    assert view((1.0, 1.0, 0.0), (1.0, 1.0, 0.0)).radius > 0
    # Over a wall that would hide the robot, but not for the sake of one behind it.
    wall = box((12.0, 0.2, 3.0))
    before, behind = (view((0, 0, 0), (10, 0, 0), wall.at(Pose((5, y, 1.5)))) for y in (-1.5, 1.5))
    assert behind.camera == seen.camera
    assert before.camera[2] > 1.4 * seen.camera[2]
    # What is drawn around a small robot is small.
    assert scale_of((0, 0, 0), (0.5, 0, 0)) < 0.5 < scale_of((0, 0, 0), (6, 0, 0)) == 1
    assert view((0, 0, 0), (0.5, 0, 0)).radius < 1
