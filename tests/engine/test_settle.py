"""Which models rest on which: found once before the first test, known to views, and kept together
where the user asks for it.
"""

import pytest

from ddenv.engine import scheduler
from ddenv.engine.journal import Journal
from ddenv.engine.notes import note_start
from ddenv.engine.worker import Broken
from ddenv.errors import UserError
from ddenv.robot.settled import Settled, notes_on
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runfile.supports import stacks
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import read_parts
from ddenv.words.news import news
from ddenv.world.load import load_scenario
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import read_world
from tests.conftest import DATA
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.guided import Guided, numbers, until
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import needs
from tests.engine.reading import events, state_of
from tests.engine.test_certify import claims

PAIRS = [("ball", "post"), ("beam", "far_box")]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """The small world, where the ball can move."""
    text = (DATA / "wall.sdf").read_text()
    before, after = text.split('<model name="ball">')
    static = '<static>true</static>\n      <pose>4 4 0.3 0 0 0</pose>\n      <link name="link">'
    assert static in after
    inertial = "<inertial><mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>"
    path = tmp_path_factory.mktemp("world") / "moving.sdf"
    free = after.replace(
        static, f'<pose>4 4 0.3 0 0 0</pose>\n      <link name="link">{inertial}', 1
    )
    path.write_text(f'{before}<model name="ball">{free}')
    return path


def pool(oracle, jobs=2, seed=0, supports=PAIRS):
    made = FakePool(oracle, jobs, seed)
    made.supports = supports
    return made


def test_what_is_wrong_with_the_start_is_told_once_each_before_the_first_test(tmp_path, world):
    path = new_run(tmp_path, world=world, budget=1)
    made = pool(needs("wall"))
    made.settled = Settled(
        seconds=3.0, places={"ball": (Pose((4.0, 4.0, 1.3)),)}, restless=("ball",)
    )
    # The engine is killed after the first line.
    with pytest.raises(Killed):
        drive(path, made, prepare=lambda file: kill_after(file, 1))
    with pytest.raises(Exception, match="budget"):
        drive(path, made)
    kinds = [event.kind for event in events(path)]
    assert kinds.index("supports") < kinds.index("test_started")
    notes = state_of(path).notes
    assert notes == tuple(notes_on(read_world(world), made.settled))
    assert [about for about, _ in notes] == ["unrest", "restless"]


def test_what_the_files_show_of_the_start_is_noted(tmp_path, world):
    path = new_run(tmp_path, world=world)
    with RunFile(path) as file:
        scenario, seen, robot = read_parts(file)
        journal = Journal(file)
        high = scenario.robot.spawn.model_copy(update={"z": 3.0})
        scenario = scenario.model_copy(
            update={"robot": scenario.robot.model_copy(update={"spawn": high})}
        )
        for _ in range(2):
            note_start(scenario, seen, robot, journal)
        assert [about for about, _ in journal.state.notes] == ["drop"]


def test_it_is_found_before_the_first_test_and_once(tmp_path, world):
    path = new_run(tmp_path, world=world, budget=1)
    for _ in range(2):
        made = pool(needs("wall"))
        made.ties = [("ball", "post")]
        with pytest.raises(Exception, match="budget"):
            drive(path, made)
    kinds = [event.kind for event in events(path)]
    assert kinds.count("supports") == 1
    assert kinds.index("supports") < kinds.index("test_started")
    assert "supports_started" not in kinds
    state = state_of(path)
    assert state.supports == (("ball", "post"), ("beam", "far_box"))
    assert state.ties == (("ball", "post"),)


def test_a_world_where_nothing_moves_needs_none(tmp_path):
    path = new_run(tmp_path)
    drive(path, pool(needs("wall")))
    assert "supports" not in {event.kind for event in events(path)}


def test_it_shows_that_it_takes_long(tmp_path, world, monkeypatch):
    monkeypatch.setattr(scheduler, "PATIENCE", 0.0)
    path, slow = new_run(tmp_path, world=world), pool(needs("wall"))
    slow.settling = 3
    assert not drive(path, slow).settling
    said, state = [], fold([])
    for event in events(path):
        before, state = state, fold([event], state)
        said.append(news(event.kind, before, state))
        assert state.settling == (event.kind == "supports_started")
    first = said.index("finding models that support others")
    assert said[first + 1] == "2 models of the world rest on others"


def test_what_cannot_be_found_is_said_and_stops_only_who_needs_it(tmp_path, world):
    broken = Broken("timeout", "took longer than 1 s of wall clock")
    state = drive(new_run(tmp_path, world=world), pool(needs("wall"), supports=broken))
    assert state.minimal
    assert (state.supports, state.unsettled) == ((), broken.failure)
    with pytest.raises(
        UserError,
        match=r"keep_supports: it is not known which models rest on which: took longer than 1 s",
    ):
        drive(
            new_run(tmp_path, world=world, keep_supports=True), pool(needs("wall"), supports=broken)
        )


def test_another_simulator_does_not_know_it(tmp_path, world):
    scenario = load_scenario(DATA / "wall.yaml")
    other = {"world": world, "oracle": {"command": "true"}, "reduction": {"keep_supports": True}}
    path = tmp_path / "other.ddenv"
    create_run(type(scenario).model_validate(scenario.model_dump() | other), path)
    with pytest.raises(UserError, match="only ddenv's own simulator"):
        drive(path, pool(needs("wall")))


@pytest.mark.parametrize(
    "method", [{}, {"algorithm": "splitting"}, {"pair": "learner/timestep"}], ids=str
)
def test_stacks_stay_whole_in_all_tests_of_a_run(tmp_path, world, method):
    asked = {"keep_supports": True, "accept_rate": "kept", **method}
    made = pool(needs("wall", "ball"))
    state = drive(new_run(tmp_path, world=world, **asked), made)
    assert state.minimal
    assert set(state.environment) == {"wall", "post", "ball"}
    assert state.reason.startswith("no stack can be removed: f in ")
    assert state.reason.endswith("; stacks were kept together (2 stacks)")
    for stack in stacks(ELEMENTS, state.supports):
        assert all(keep.issuperset(stack) or keep.isdisjoint(stack) for keep, _ in made.made)
    # A stack is left out as a whole in the certificate, too.
    assert set(claims(state)) == {None, "wall", "post"}
    assert (frozenset({"wall"}) in {keep for keep, _ in made.made}) and claims(state)[
        "post"
    ].verdict == "needed"


def test_a_pinned_model_holds_its_whole_stack(tmp_path, world):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": numbers("far_box")}

    path = new_run(tmp_path, world=world, keep_supports=True)
    guided = Guided(path, needs("wall"), guide())
    guided.supports = PAIRS
    state = drive(path, guided)
    assert set(state.environment) == {"wall", "far_box", "beam"}
    assert set(claims(state)) == {None, "wall"}
