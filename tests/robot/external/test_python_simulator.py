"""A simulator in Python: one object runs all tests, whatever it does wrong is one line, and nothing
of it is left.
"""

import numpy as np
import pytest

from ddenv.errors import UserError
from ddenv.robot.external import python_simulator
from ddenv.robot.external.python_simulator import PythonSimulator
from ddenv.runs.experiment import load_parts
from ddenv.world.load import load_scenario, load_simulator
from ddenv.world.scenario import Oracle, Spawn
from ddenv.world.sdf.read import read_world
from tests.conftest import DATA
from tests.wall import wall

LEFT = frozenset({"deck", "ball"})
HEAD = "import ddenv, math\nEND = ddenv.Ended(False)\nAT = (1, 0, 0, 0, 0, 0, 1)\n\n"
SOUND = "yield 0.0, AT\n        return END"


def written(folder, run=SOUND, begin="pass", head=HEAD):
    """The scenario of the small world with a class of these lines."""
    lines = [
        *("class Mine:", "    def __init__(self, setup):", f"        {begin}"),
        *("    def run(self, world, seed, timeout):", f"        {run}", ""),
    ]
    (folder / "mine.py").write_text(head + "\n".join(lines))
    return wall(oracle=Oracle(use="mine:Mine"), folder=folder, simulation={"wall_timeout": None})


@pytest.fixture
def made(tmp_path):
    """Makes the simulator of a scenario, or of these lines; closed in the end."""
    all_made = []

    def make(scenario=None, **lines):
        scenario = scenario or written(tmp_path, **lines)
        all_made.append(PythonSimulator(load_parts(scenario)[0], scenario))
        return all_made[-1]

    yield make
    for each in all_made:
        each.close()


SEES = """
class Mine:
    def __init__(self, setup):
        self.setup, self.runs = setup, 0

    def run(self, world, seed, timeout):
        self.runs += 1
        self.seen = world, world.path.read_text(), seed, timeout
        for step in range(41):
            t = step * 0.05
            ball = {"ball": (2, step, 0, 0, 0, 0, 2)} if step % 2 else {}
            yield t, [t, 0, 0.3, 0, 0, 1, 0], ball
        return ddenv.Ended(seed > 5, took_part=("ball",))
"""


JOINTED = """<sdf version="1.9"><world name="w"><model name="post"><static>true</static><link name="l">
<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link></model><model name="lever">
<link name="base"/><link name="bar"/><joint name="j" type="revolute"><parent>base</parent><child>bar</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></world></sdf>"""


def test_rows_may_have_the_poses_of_links_at_joints(tmp_path, made):
    (tmp_path / "world.sdf").write_text(JOINTED)
    at = {
        "world": tmp_path / "world.sdf",
        "robot": wall().robot.model_copy(update={"spawn": Spawn(x=9, y=9, z=1)}),
    }

    def run(name):
        rows = (
            f"yield 0.0, AT, {{'{name}': AT}}\n        yield 0.1, AT, {{'{name}': (2, 0, 0, 0, "
            "0, 0, 1)}\n        return END"
        )
        return made(written(tmp_path, rows).model_copy(update=at)).run(
            frozenset({"post", "lever"}), 1
        )

    assert run("lever::bar").motions["lever::bar"][:, 1].tolist() == [1, 2]
    # A part of a model without joints is none, and a link that is left out with its model neither.
    for name in ("post::l", "lever::rod"):
        with pytest.raises(UserError, match=f"there is no model '{name}'"):
            run(name)


def test_one_object_gets_the_world_of_each_test_and_its_rows_become_the_run(tmp_path, made):
    scenario, moments = written(tmp_path), []
    (tmp_path / "mine.py").write_text(HEAD + SEES)
    simulator = made(scenario)
    run = simulator.run(LEFT, 3, lambda *now: moments.append(now))
    assert (run.outcome, run.failure, run.seed, run.took_part) == (
        "failed",
        "out of time",
        3,
        frozenset({"ball"}),
    )
    assert run.trajectory[:, 0] == pytest.approx(np.arange(0, 2.01, 0.1))
    assert run.end_pose == (2.0, 0, 0.3, 0, 0, 0, 1)
    assert set(run.motions) == {"ball"} and run.motions["ball"][-1].tolist() == pytest.approx(
        [1.95, 2, 39, 0, 1, 0, 0, 0]
    )
    # It begins before the simulator does, and then has each row that is kept.
    assert moments[0] == (0.0, (0, 0, 0.45, 1, 0, 0, 0), {}) and len(moments) == 1 + len(
        run.trajectory
    )
    assert moments[-1][2] == {"ball": (2, 39, 0, 1, 0, 0, 0)}
    world, text, seed, timeout = simulator._simulator.seen
    assert world.models == ("ground_plane", "deck", "ball") and (seed, timeout) == (3, 5.0)
    assert "far_box" not in text and "deck" in text
    again = load_scenario(world.scenario)
    assert (again.world, again.oracle, again.robot) == (world.path, None, scenario.robot)
    assert [model.name for model in read_world(again.world).models] == list(world.models)
    assert simulator.run(LEFT | {"post"}, 6).outcome == "pass"
    assert simulator._simulator.runs == 2 and "post" in simulator._simulator.seen[0].models
    setup = simulator._simulator.setup
    assert (setup.world, setup.folder) == (DATA / "wall.sdf", tmp_path.resolve())
    assert setup.scenario["goal"]["x"] == 4 and setup.model_path == (DATA,)


def test_poses_may_be_returned_and_what_took_part_is_not_guessed(made):
    run = made(run="return ddenv.Ended(True, [(0, AT), (2, AT)])").run(LEFT, 0)
    assert (run.outcome, run.failure, run.simulated_seconds, run.took_part) == (
        "pass",
        "",
        2.0,
        None,
    )


ROW = "gave row 1: expected t,x,y,z,qx,qy,qz,qw (s, m, a quaternion), found "
NONSENSE = {
    "return None": "returned None; expected ddenv.Ended(reached), with True or False",
    "yield 0, AT": "returned None; expected ddenv.Ended(reached), with True or False",
    "return ddenv.Ended('yes', [(0, AT)])": "returned Ended(reached='yes', ",
    "return END": "gave no poses; expected at least one row: (time, pose) or (time, pose, poses by model)",
    "yield 3": "gave row 1: expected (time, pose) or (time, pose, poses by model), found 3",
    "yield 0, AT, 7": "gave row 1: expected (time, pose) or (time, pose, poses by model), found (0, (1, 0, ",
    "yield 0, (1, 0, math.nan, 0, 0, 0, 1)": f"{ROW}(0, (1, 0, nan, 0, 0, 0, 1))",
    "yield 0, (1, 2, 3)": f"{ROW}(0, (1, 2, 3))",
    "yield 0, 'words'": f"{ROW}(0, 'words')",
    "yield 0, (1, 0, 0, 0, 0, 0, 0)": "gave row 1: the quaternion 0,0,0,0 has no length",
    "yield 0, (1e300, 0, 0, 0, 0, 0, 1)": "gave row 1: a number is above 1e+09: times are in s, places in m",
    "yield 1, AT; yield 0, AT": "gave row 2: time goes back from 1 to 0 s",
    "yield 0, AT, {'bal': AT}": "gave row 1: there is no model 'bal' in this test's world (did you mean ball?)",
    "yield 0, AT, {'post': AT}": "gave row 1: there is no model 'post' in this test's world",
    "yield 0, AT, {'ball': (math.inf,) * 7}": f"{ROW}(0, (inf, ",
    "yield 0, AT, {7: AT}": "gave row 1: there is no model '7' in this test's world",
    "return ddenv.Ended(True, [(0, AT)], took_part=['x'])": "gave took_part: there is no model 'x' in this test's world",
    "return ddenv.Ended(True, [(0, AT)], took_part=7)": "raised TypeError: 'int' object is not iterable",
    "raise ValueError('one\\ntwo\\x1b[31m')": "raised ValueError: one two",
    "yield 0, AT; 1 / 0": "raised ZeroDivisionError: division by zero (mine.py:9)",
    "import sys; sys.exit(0)": "raised SystemExit: 0 (mine.py:9)",
    "raise KeyboardInterrupt": "raised KeyboardInterrupt (mine.py:9)",
    "return world.nothing": "raised AttributeError: 'SubWorld' object has no attribute 'nothing' (mine.py:9)",
}


@pytest.mark.parametrize("run", NONSENSE)
def test_nonsense_is_one_line(made, run):
    simulator = made(run=run)
    with pytest.raises(UserError) as caught:
        simulator.run(LEFT, 0)
    assert str(caught.value).startswith(f"simulator Mine: run {NONSENSE[run]}")
    assert str(caught.value).isprintable() and len(str(caught.value)) <= 300


def test_a_class_that_makes_no_object_is_one_line(tmp_path, monkeypatch, made):
    monkeypatch.setattr(python_simulator, "LONGEST_START", 0.2)
    scenario = written(tmp_path)
    for use, said in (
        ("mine:Min", "module 'mine' has no class 'Min' (did you mean Mine?)"),
        (
            "mime:Mine",
            (
                f"there is no module 'mime' in {tmp_path.resolve()}, nor installed (did you mean "
                "mine?)"
            ),
        ),
        (
            "json:JSONDecoder",
            "class 'JSONDecoder' of module 'json' has no method run(world, seed, timeout)",
        ),
    ):
        with pytest.raises(UserError) as caught:
            PythonSimulator(load_parts(scenario)[0], wall(oracle=Oracle(use=use), folder=tmp_path))
        assert str(caught.value) == f"oracle.use: {said}"
    with pytest.raises(
        UserError,
        match=r"^oracle\.use: importing 'mine' raised ZeroDivisionError: .* \(mine\.py:1\)$",
    ):
        made(head="1 / 0\n")
    for begin, said in (
        ("1 / 0", r"raised ZeroDivisionError: .* \(mine\.py:7\)"),
        ("while True: pass", "took longer than 0.2 s"),
    ):
        with pytest.raises(UserError, match=rf"^simulator Mine: __init__ {said}$"):
            made(begin=begin)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: both\ncommand: ./x\nuse: a:B\n", "needs either command, or use: a class in Python"),
        ("name: none\n", "needs either command, or use: a class in Python"),
        ("use: no class\n", "use"),
    ],
)
def test_a_simulator_is_a_command_or_a_class(tmp_path, text, said):
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(UserError) as caught:
        load_simulator(tmp_path / "s.yaml")
    assert said in str(caught.value) and str(tmp_path / "s.yaml") in str(caught.value)
