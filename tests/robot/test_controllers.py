"""Controllers by name, and what becomes of those that do something wrong."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.robot.controllers import BadCode, controllers, load
from ddenv.robot.protocol import Estimate, Reading, Setup, Twist, WheelSpeeds
from ddenv.world.scenario import Controller

SETUP = Setup(
    goal=(5, 0),
    tolerance=0.5,
    start=(0, 0, 0),
    joints=("left", "right"),
    left=(True, False),
    radius=0.1,
    track=0.5,
    footprint=(0, 0, 0, 0),
    period=0.05,
    speed=1,
    acceleration=1,
    turn_rate=1,
)
READING = Reading(0.0, Estimate(0.0, 0.0, 0.0))


def own(folder: Path, body: str, setup: Setup = SETUP, seconds: float = 5.0):
    """The controller of a file whose class has these lines."""
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    (folder / "mine.py").write_text(f"import ddenv\nclass Mine:\n{lines}")
    return controllers(Controller(use="mine:Mine", answer_within=seconds), folder)(setup)


def stepping(*lines: str) -> str:
    """A class whose `step` has these lines."""
    return "\n".join(
        [
            "def __init__(self, setup): pass",
            "def step(self, reading):",
            *(f"    {line}" for line in lines),
        ]
    )


@pytest.mark.parametrize(
    ("answer", "command"),
    [
        ("ddenv.Twist(1, 0.5)", Twist(1.0, 0.5)),
        ("(1, 0.5)", Twist(1.0, 0.5)),
        ("ddenv.WheelSpeeds({'left': 2})", WheelSpeeds({"left": 2.0})),
        ("{'right': -2}", WheelSpeeds({"right": -2.0})),
        ("{}", WheelSpeeds({})),
    ],
)
def test_what_a_controller_may_answer(tmp_path, answer, command):
    assert own(tmp_path, stepping(f"return {answer}")).step(READING) == command


def test_numbers_of_numpy_become_plain_ones(tmp_path):
    answer = own(
        tmp_path, stepping("import numpy", "return numpy.float32(1), numpy.int64(0)")
    ).step(READING)
    assert answer == Twist(1.0, 0.0)
    assert {type(answer.speed), type(answer.turn_rate)} == {float}


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("return None", r"step returned None; expected Twist\(speed, turn_rate\) or WheelSpeeds"),
        ("return 'left'", "step returned a value of type str"),
        (
            "return ('1', 0.0)",
            "step returned a speed that is a value of type str; expected a number",
        ),
        ("return 0.0, float('nan')", "step returned a turn rate of nan"),
        ("return float('inf'), 0.0", "step returned a speed of inf"),
        ("return 1e9, 0.0", r"step returned a speed of 1e\+09; the maximum is 1000"),
        (
            "return {'lift': 1.0}",
            r"step returned a speed for 'lift' \(did you mean left\?\); wheels are left, right",
        ),
        ("return {'left': None}", "step returned 'left' that is None"),
        ("return 1 / 0", r"step raised ZeroDivisionError: division by zero \(mine.py:5\)$"),
        ("raise SystemExit(3)", r"step raised SystemExit: 3 \(mine.py:5\)"),
        ("raise KeyboardInterrupt", r"step raised KeyboardInterrupt \(mine.py:5\)"),
        ("return self.step(reading)", r"step raised RecursionError: .*\(mine.py:5\)"),
        ("raise MemoryError", "step raised MemoryError"),
        (
            "raise ValueError('a\\n\\x1b[31m' + 'b' * 1000)",
            r"step raised ValueError: a .\[31mb+\.\.\.$",
        ),
    ],
)
def test_a_mistake_is_reported_in_one_line(tmp_path, line, reason):
    with pytest.raises(BadCode, match=f"^controller Mine: {reason}"):
        own(tmp_path, stepping(line)).step(READING)


def test_an_exception_without_text_is_named(tmp_path):
    with pytest.raises(BadCode, match=r"step raised Evil \(mine.py:7\)$"):
        own(tmp_path, stepping("class Evil(Exception):", "    __str__ = None", "raise Evil")).step(
            READING
        )


def test_what_fails_when_it_is_made_fails_at_the_first_step(tmp_path):
    controller = own(
        tmp_path, "def __init__(self, setup): setup.nothing\ndef step(self, reading): pass"
    )
    with pytest.raises(
        BadCode, match=r"Mine: __init__ raised AttributeError: .*'nothing' \(mine.py:3\)"
    ):
        controller.step(READING)


@pytest.mark.parametrize(
    "lines",
    [
        ["while True: pass"],
        ["import time", "time.sleep(60)"],
        ["while True:", "    try:", "        time = 1", "    except Exception:", "        pass"],
        [
            "for _ in range(3):",
            "    try:",
            "        while True: pass",
            "    except BaseException:",
            "        pass",
        ],
    ],
    ids=["loop", "sleep", "stubborn", "swallows it"],
)
def test_what_never_returns_is_interrupted(tmp_path, lines):
    started = time.monotonic()
    with pytest.raises(BadCode, match=r"step took longer than 0.05 s \(controller.answer_within\)"):
        own(tmp_path, stepping(*lines), seconds=0.05).step(READING)
    assert time.monotonic() - started < 30


def test_time_in_which_the_process_is_stopped_does_not_count(tmp_path):
    # As in a stopped process, all alarms of that time come as one.
    lines = [
        "import signal, time",
        "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])",
        "time.sleep(0.1)",
        "signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGALRM])",
        "return 0.0, 0.0",
    ]
    assert own(tmp_path, stepping(*lines), seconds=0.05).step(READING) == Twist(0.0, 0.0)


def test_native_code_that_takes_too_long_is_noticed_when_it_ends(tmp_path):
    lines = ["sum(range(10_000_000))", "return 0.0, 0.0"]
    with pytest.raises(BadCode, match=r"step took longer than 0.01 s"):
        own(tmp_path, stepping(*lines), seconds=0.01).step(READING)


def test_it_also_works_in_another_thread(tmp_path):
    controller, answers = own(tmp_path, stepping("return 1.0, 0.0")), []
    thread = threading.Thread(target=lambda: answers.append(controller.step(READING)))
    thread.start()
    thread.join()
    assert answers == [Twist(1.0, 0.0)]


def test_its_random_numbers_are_those_of_its_seed(tmp_path):
    draws = stepping(
        "import random", "import numpy", "return random.random(), numpy.random.random()"
    )
    first, again, other = (
        own(tmp_path, draws, replace(SETUP, seed=seed)) for seed in (2**40, 2**40, 7)
    )
    answers = [controller.step(READING) for controller in (first, again, other)]
    assert answers[0] == answers[1] != answers[2]


def test_what_it_prints_goes_to_stderr(tmp_path, capsys):
    (tmp_path / "loud.py").write_text("print('imported')\nclass Loud:\n    def __init__(self, setup): print('made')\n"
                                      "    def step(self, reading): print('asked'); return 0.0, "
                                      "0.0\n")  # fmt: skip
    controllers(Controller(use="loud:Loud"), tmp_path)(SETUP).step(READING)
    assert capsys.readouterr() == ("", "imported\nmade\nasked\n")


def test_whether_it_has_arrived_and_its_setup(tmp_path):
    controller = own(
        tmp_path,
        "def __init__(self, setup): self.goal = setup.goal; setup.options['used'] = True\n"
        "def step(self, reading): self.arrived = reading.time > 1; return self.goal",
        setup := replace(SETUP, options={"gain": 2}),
    )
    assert controller.step(READING) == Twist(5.0, 0.0)
    assert not controller.arrived
    controller.step(Reading(2.0, READING.estimate))
    assert controller.arrived
    # The next run starts from the same options.
    assert setup.options == {"gain": 2}


def test_modules_of_one_name_in_two_folders(tmp_path):
    path = sys.path[:]
    for name in ("one", "two"):
        folder = tmp_path / name
        (folder / "mine").mkdir(parents=True)
        (folder / "speeds.py").write_text(f"SPEED = {len(name)} + {name == 'two'}")
        (folder / "mine" / "drive.py").write_text(
            "from speeds import SPEED\nclass Mine:\n    def __init__(self, setup): pass\n"
            "    def step(self, reading): return SPEED, 0.0\n"
        )
    use = Controller(use="mine.drive:Mine")
    first, second = (controllers(use, tmp_path / name)(SETUP) for name in ("one", "two"))
    assert [one.step(READING).speed for one in (first, second)] == [3.0, 4.0]
    assert sys.path == path


def test_modules_that_it_imports_later(tmp_path):
    path = sys.path[:]
    (tmp_path / "late_helper.py").write_text("SPEED = 2.0")
    (tmp_path / "later_helper.py").write_text("TURN = 3.0")
    body = (
        "def __init__(self, setup):\n    from late_helper import SPEED\n    self.speed = SPEED\n"
        "def step(self, reading):\n    import later_helper\n    return self.speed, "
        "later_helper.TURN"
    )
    assert own(tmp_path, body).step(READING) == Twist(2.0, 3.0)
    assert sys.path == path


def test_a_module_that_is_installed(tmp_path):
    assert load("ddenv.robot.navigation.navigate:Straight", tmp_path) is load("straight", tmp_path)


@pytest.mark.parametrize(
    ("use", "complaint"),
    [
        (
            "drives:Drive",
            r"there is no module 'drives' in .*, nor installed \(did you mean drive\?\)$",
        ),
        ("drive.deep:Drive", r"there is no module 'drive.deep' in .*, nor installed"),
        ("drive:Driver", r"module 'drive' has no class 'Driver' \(did you mean Drive\?\)$"),
        ("drive:NUMBER", "module 'drive' has no class 'NUMBER'"),
        ("drive:Still", r"class 'Still' of module 'drive' has no method step\(reading\)$"),
        (
            "broken:Drive",
            r"importing 'broken' raised ZeroDivisionError: division by zero \(broken.py:2\)$",
        ),
        (
            "unfinished:Drive",
            r"importing 'unfinished' raised SyntaxError: .*\(unfinished.py, line 1\)",
        ),
        ("leaving:Drive", r"importing 'leaving' raised SystemExit: 0 \(leaving.py:1\)"),
        (
            "needing:Drive",
            (
                r"importing 'needing' raised ModuleNotFoundError: No module named 'nowhere' "
                r"\(needing.py:1\)"
            ),
        ),
        ("json:Drive", "'json' in .* has the name of another module; rename it"),
    ],
)
def test_what_cannot_be_loaded_is_refused(tmp_path, use, complaint):
    files = {
        "drive": "NUMBER = 1\nclass Drive:\n    def step(self, reading): pass\nclass Still: pass",
        "broken": "\n1 / 0",
        "unfinished": "class Drive(",
        "leaving": "raise SystemExit(0)",
        "needing": "import nowhere",
        "json": "class Drive: pass",
    }
    for name, text in files.items():
        (tmp_path / f"{name}.py").write_text(text)
    with pytest.raises(UserError, match=f"^controller.use: {complaint}"):
        load(use, tmp_path)
