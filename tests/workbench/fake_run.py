"""A run without a robot: writes into a run file what an engine would, step by step."""

from __future__ import annotations

import json
import math
from array import array
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

from ddenv import __version__
from ddenv.evidence.certificate import Pairs
from ddenv.evidence.rates import anytime_interval
from ddenv.run_numbers import CERTIFICATES
from ddenv.runfile.events import Created
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.state import RunState
from ddenv.runfile.store import ROBOT, Live, Motions, RunFile, create
from ddenv.runs.engine_job import EngineOptions
from ddenv.settings import PRINTED
from ddenv.world.sdf.read import parse_world
from tests.shorthand import Writing

ROBOT_SDF = b"""<sdf version="1.9"><model name="robot"><link name="base">
<collision name="body"><geometry><box><size>0.6 0.4 0.2</size></box></geometry></collision></link></model></sdf>"""
SIZE = (1.2, 0.8, 0.3)
# Where runs end in f, and in another failure, m.
END, OTHER_END = (2.0, 0.4, 0.2), (3.0, 1.4, 0.2)


def attended(jobs: int, accept_mode: str = "automatic") -> EngineOptions:
    """How the workbench starts an engine."""
    return EngineOptions(jobs=jobs, accept_mode=accept_mode, attended=True)


def box(
    name: str, x: float, y: float, yaw: float = 0.0, size: tuple[float, float, float] = SIZE
) -> str:
    width, depth, height = size
    return (
        f'<model name="{name}"><static>true</static><pose>{x} {y} {height / 2} 0 0 '
        f'{yaw}</pose><link name="link">'
        f'<collision name="box"><geometry><box><size>{width} {depth} '
        f"{height}</size></box></geometry></collision>"
        f"</link></model>"
    )


GROUND = (
    '<model name="ground_plane"><static>true</static><link name="link"><collision '
    'name="plane"><geometry>'
    "<plane><normal>0 0 1</normal></plane></geometry></collision></link></model>"
)


def world_text(names: list[str] | None = None) -> bytes:
    """A floor, and eleven crates in a curve from the start at (-6, 0) to the goal at (6, 0)."""
    names = names or [f"crate_{number:02}" for number in range(11)]
    models = [GROUND, box("floor", 0, 0, size=(15, 8, 0.02))]
    for number, name in enumerate(names):
        x = -4.5 + 9 * number / max(1, len(names) - 1)
        models.append(box(name, x, 2.2 * math.sin(1.3 * number), 0.3 * number))
    return f'<sdf version="1.9"><world name="w">{"".join(models)}</world></sdf>'.encode()


def scenario(protected: tuple[str, ...] = ("floor",), name: str = "crates") -> dict:
    return {
        "name": name,
        "description": "A robot drives through crates and gets stuck on one of them.",
        "world": "crates.sdf",
        "robot": {"model": "robot.sdf", "spawn": {"x": -6.0, "y": 0.0, "z": 0.2, "yaw": 0.0}},
        "goal": {"x": 6.0, "y": 0.0},
        "reduction": {"pair": "model2model/failure-proximal", "iterations": 3, "baseline_runs": 4},
        "protected": list(protected),
    }


def as_printed() -> dict:
    """The same with the settings of the paper: the screens show its lines, and the rounds below are
    its rounds.
    """
    data = scenario()
    return data | {"reduction": data["reduction"] | PRINTED}


class FakeRun:
    """A run file and the events an engine would write. `with run.engine():` holds the lock as an
    engine does.
    """

    def __init__(self, path: Path, data: dict | None = None, world: bytes | None = None) -> None:
        data = data or as_printed()
        self.path, self.data = path, data
        self.world = world or world_text()
        documents = {"scenario": json.dumps(data).encode(), "world": self.world, "robot": ROBOT_SDF}
        self.elements = list(
            parse_world(self.world, path).elements(frozenset(data.get("protected", ())))
        )
        create(path, documents, Created(scenario=data, elements=tuple(self.elements)))
        self.file = RunFile(path)
        self.file.own()
        self._writing = Writing(self.file)
        # What each removal leaves, from number 1 on.
        self.removals: list[list[int]] = []
        self.tests = 0
        self.round = 0
        self.trials = 0
        self.certificates = 0
        self.fresh = self.first_fresh = CERTIFICATES.start
        # What takes part in each run from now on.
        self.met: list[str] | None = None
        self._stack = ExitStack()

    @property
    def state(self) -> RunState:
        """What all its events add up to."""
        return fold(self.file.events())

    def engine(self):
        return engine_lock(self.path)

    def hold(self) -> None:
        """An engine is at work until `let_go`."""
        self._stack.enter_context(self.engine())

    def let_go(self) -> None:
        self._stack.close()

    def close(self) -> None:
        self.let_go()
        self.file.close()

    def write(self, kind: str, motions: Motions | None = None, **data) -> None:
        """An event in short, see `tests.shorthand`; a `removal` stands for its environment."""
        if "removal" in data:
            removal = data.pop("removal")
            data["environment"] = None if removal is None else self.removals[removal - 1]
        self._writing.write(kind, data, motions)

    def created(self) -> FakeRun:
        self.write("created", scenario=self.data, elements=self.elements)
        self.write("engine_started", pid=1, jobs=2, version=__version__, simulator="none")
        return self

    def start(self, candidate: int | None = None, run: int = 0) -> int:
        """A test starts; in the baseline without a candidate."""
        self.tests += 1
        phase = "baseline" if candidate is None else "round"
        number = None if candidate is None else self.round
        self.write(
            "test_started",
            test=self.tests,
            phase=phase,
            round=number,
            candidate=candidate,
            run=run,
            seed=run,
        )
        return self.tests

    def finish(
        self,
        test: int,
        outcome: str,
        distance: float | None = None,
        wall: float = 2.0,
        failure: str = "",
        end: tuple[float, float, float] = END,
        aside: float = 0.0,
    ) -> None:
        event = {
            "test": test,
            "outcome": outcome,
            "failure": failure,
            "distance": distance,
            "cut": False,
        }
        event |= {
            "end_pose": [*end, 1.0, 0.0, 0.0, 0.0],
            "simulated_seconds": 45.0,
            "wall_seconds": wall,
        }
        event |= {"first_sensed": [], "first_touched": []}
        if self.met is not None:
            event["took_part"] = self.numbers(self.met)
        way = path_samples()
        # It turns aside in the middle of its way.
        for row in range(len(way) // 16, len(way) // 8):
            way[8 * row + 2] += aside
        self.write("test_finished", {ROBOT: way.tobytes()}, **event)

    def test(
        self,
        candidate: int | None,
        outcome: str,
        distance: float | None = None,
        run: int = 0,
        failure: str = "",
    ) -> int:
        number = self.start(candidate, run)
        self.finish(number, outcome, distance, failure=failure)
        return number

    def put_motion(self, test: int, samples: array, model: str = ROBOT) -> None:
        """Another way of a model in a test."""
        self.file._db.execute(
            "INSERT OR REPLACE INTO motion VALUES (?, ?, ?)", (test, model, samples.tobytes())
        )

    def imply(self, candidate: int, by: int) -> int:
        """The first test of a candidate follows from the test `by`."""
        self.tests += 1
        place = {"phase": "round", "round": self.round, "candidate": candidate, "run": 0, "seed": 0}
        self.write("implied", {ROBOT: by}, test=self.tests, by=by, **place)
        return self.tests

    def start_certificate(self) -> None:
        self.certificates += 1
        self.first_fresh = self.fresh
        terms = {"rate": 0.7, "keep_rate": 0.8, "error": 0.03, "at_least": 4, "certify_rate": 2 / 3}
        self.write("certificate_started", certificate=self.certificates, run=self.fresh, **terms)

    def certify(self, node: int, without: str | None = None, run: int = 0) -> int:
        """A run with a fresh seed starts, of the environment of `node`."""
        self.tests += 1
        place = {"phase": "certify", "round": None, "candidate": None, "node": node}
        if without is not None:
            place["without"] = self.elements.index(without)
        number = self.first_fresh + run
        self.write("test_started", test=self.tests, **place, run=number, seed=number)
        self.fresh = max(self.fresh, number + 1)
        return self.tests

    def certify_all(self, node: int, without: str | None, outcomes: str) -> None:
        """A run for each letter: s similar, p pass, o another failure, e broken; none where there
        is a point.
        """
        words = {
            "s": ("similar", 0.12, "stuck"),
            "p": ("pass", None, ""),
            "o": ("other", 2.3, "tipped over"),
        }
        for run, letter in enumerate(outcomes):
            if letter == ".":
                continue
            outcome, distance, failure = words.get(letter, ("error", None, "the simulation broke"))
            self.finish(self.certify(node, without, run), outcome, distance, failure=failure)

    def finish_certificate(self, *claims: tuple[str | None, str, str]) -> None:
        """Each claim as (without, verdict, outcomes as in `certify_all`)."""
        tests = [test.id for test in self.state.confirm_tests]
        self.write(
            "certificate_finished", claims=[self._claim(*each) for each in claims], tests=tests
        )

    def _claim(self, without: str | None, verdict: str, outcomes: str) -> dict:
        shown, runs = outcomes.count("s"), len(outcomes.replace("e", ""))
        low, high = anytime_interval(shown, runs)
        pairs = Pairs(both=shown, second=runs - shown)
        bound = pairs.keeps_at_least(0.015) if without is None else pairs.at_most(0.015)
        names = {"s": "similar", "p": "pass", "o": "other", "e": "error"}
        counts = {
            name: outcomes.count(letter) for letter, name in names.items() if letter in outcomes
        }
        claim = {
            "without": None if without is None else self.elements.index(without),
            "verdict": verdict,
        }
        claim |= {
            "shown": shown,
            "runs": runs,
            "low": low,
            "high": high,
            "outcomes": counts,
            "bound": bound,
        }
        return claim

    def start_isolation(self, size: int) -> None:
        """Isolation starts; the `size` first models are what the reduction left."""
        self.write("engine_started", pid=2, jobs=2, version=__version__, simulator="none")
        rule = {
            "wanted": 0.9,
            "rather_than": 0.45,
            "keep_rate": 0.8,
            "error": 0.05,
            "at_least": 20,
            "block": 1000,
        }
        suspects, before = list(range(len(self.elements))), self.state.reason or "it ended"
        self.write(
            "isolation_started",
            isolation=1,
            run=100_000,
            **rule,
            suspects=suspects,
            size=size,
            before=before,
        )

    def remove(self, *names: str) -> int:
        """The number of a removal that is tried now."""
        self.removals.append(
            [number for number, name in enumerate(self.elements) if name not in names]
        )
        return len(self.removals)

    def isolate(self, removal: int, run: int) -> int:
        """A run of the whole world after a removal starts."""
        self.tests += 1
        place = {"phase": "isolate", "round": None, "candidate": None, "removal": removal}
        self.write("test_started", test=self.tests, **place, run=run, seed=run)
        return self.tests

    def isolate_all(self, removal: int, outcomes: str, first: int = 0) -> list[int]:
        """A run for each letter as in `certify_all`; one that reaches the goal goes 1 m further to
        the side.
        """
        words = {
            "s": ("similar", 0.12, "stuck"),
            "p": ("pass", None, ""),
            "e": ("error", None, "it broke"),
        }
        tests = []
        for run, letter in enumerate(outcomes, first):
            outcome, distance, failure = words[letter]
            tests.append(self.isolate(removal, run))
            self.finish(tests[-1], outcome, distance, failure=failure, aside=float(letter == "p"))
        return tests

    def live(self, *tests: tuple[int, float]) -> None:
        """Tests run now: each (test, part of the way from 0 to 1)."""
        rows = []
        for slot, (test, part) in enumerate(tests):
            t, x, y, z, *quaternion = path_samples()[8 * int(79 * part) :][:8]
            rows.append(Live(slot=slot, test=test, time=t, pose=(x, y, z, *quaternion)))
        self.file.set_live(rows)

    def baseline(self, failures: int = 3, runs: int = 4, others: int = 0) -> FakeRun:
        """`others` more runs show another failure."""
        runs += others
        ways = ["similar"] * failures + ["other"] * others + ["pass"] * (runs - failures - others)
        tests = []
        for run, way in enumerate(ways):
            tests.append(self.start(run=run))
            kind = {"similar": "stuck", "other": "fell"}.get(way, "")
            self.finish(
                tests[-1],
                "failed" if kind else "pass",
                failure=kind,
                end=OTHER_END if way == "other" else END,
            )
        outcomes = dict(zip(tests, ways, strict=True))
        seen = [{"test": tests[0], "runs": failures, "kinds": ["stuck"], "position": END}]
        if others:
            seen.append(
                {"test": tests[failures], "runs": others, "kinds": ["fell"], "position": OTHER_END}
            )
        rate = failures / runs
        rates = {
            "rate": rate,
            "low": 0.3,
            "high": 0.95,
            "miss_chance": (1 - rate) ** 4,
            "iterations_95": 2,
        }
        found = {
            "failure_test": tests[0],
            "position": END,
            "seen": seen,
            "outcomes": outcomes,
            **rates,
        }
        distances = dict.fromkeys(tests[:failures], 0.1)
        self.write("baseline_finished", runs=runs, failures=failures, distances=distances, **found)
        return self

    def start_round(
        self, parts: int, environment: list[str] | None = None, pinned: tuple[str, ...] = ()
    ) -> None:
        """A round of `parts` partitions of neighbours, each with its complement; `pinned` models
        are in all of them.
        """
        self.round += 1
        whole = self.numbers(environment or self.elements)
        kept = [number for number in whole if self.elements[number] not in pinned]
        cuts = [round(len(kept) * index / parts) for index in range(parts + 1)]
        partitions = [kept[a:b] for a, b in pairwise(cuts)]
        kinds = ("partition", "complement") if parts > 2 else ("partition",)
        candidates = [[kind, index, 0.4 + 1.7 * index] for index in range(parts) for kind in kinds]
        split = {"n_partitions": parts, "partitions": partitions, "candidates": candidates}
        begun = {"round": self.round, "environment": whole, "pinned": self.numbers(list(pinned))}
        self.write("round_started", **begun, **split)
        self.write("forecast", round=self.round, tests=[12, 51, 72], tests_done=self.tests)

    def supports(self, *pairs: tuple[str, str]) -> None:
        """The first model of each pair rests on the second."""
        self.write("supports", pairs=[self.numbers(list(pair)) for pair in pairs])

    def judge(self, candidate: int, verdict: str, tests: list[int], known: int = 0) -> None:
        self.write(
            "candidate_judged", candidate=candidate, verdict=verdict, tests=tests, known=known
        )

    def dissimilar(self, candidate: int) -> None:
        words = [("pass", "") if run % 2 else ("other", "tipped over") for run in range(4)]
        tests = [
            self.test(candidate, outcome, 2.3, run, how) for run, (outcome, how) in enumerate(words)
        ]
        self.judge(candidate, "dissimilar", tests)

    def similar(self, candidate: int) -> int:
        test = self.test(candidate, "similar", 0.12, failure="stuck")
        self.judge(candidate, "similar", [test])
        return test

    def numbers(self, names: list[str]) -> list[int]:
        return [self.elements.index(name) for name in names]

    def pin(self, *names: str) -> None:
        self.write("pinned", models=self.numbers(list(names)))

    def try_out(self, kept: list[str]) -> int:
        """A selection by hand; returns its number."""
        self.trials += 1
        self.write("trial_started", trial=self.trials, models=self.numbers(kept))
        return self.trials

    def start_hand(self, trial: int, run: int = 0) -> int:
        """A test of a trial starts."""
        self.tests += 1
        place = {"phase": "hand", "round": None, "candidate": None, "trial": trial}
        self.write("test_started", test=self.tests, **place, run=run, seed=run)
        return self.tests

    def judge_trial(self, trial: int, verdict: str, tests: list[int], known: int = 0) -> None:
        self.write("trial_judged", trial=trial, verdict=verdict, tests=tests, known=known)

    def adopt(self, trial: int, kept: list[str], test: int) -> None:
        self.write("adopted", trial=trial, environment=self.numbers(kept), evidence_test=test)
        self.write("leg_started", round=self.round + 1, n_partitions=2)

    def go_back(self, node: int, rejected: int | None = None) -> None:
        self.write("went_back", node=node, rejected=rejected)
        self.write("leg_started", round=self.round + 1, n_partitions=2)

    def reduce(self, candidate: int, environment: list[str], test: int) -> None:
        numbers = [self.elements.index(name) for name in environment]
        self.write("reduced", candidate=candidate, environment=numbers, evidence_test=test)
        self.write("round_finished")


def path_samples() -> array:
    """The robot's way from the start to where it gets stuck, 80 samples in 45 s."""
    rows = array("d")
    for number in range(80):
        part = number / 79
        x, y = -6 + 8 * part, 1.2 * math.sin(3 * part) + 0.25 * part
        yaw = math.atan2(3.6 * math.cos(3 * part) + 0.25, 8)
        rows.extend((45 * part, x, y, 0.2, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))
    return rows
