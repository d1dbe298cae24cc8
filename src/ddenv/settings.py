"""Each setting of a run, once: type, default, unit, range, meaning, where it shows, and whether it
may change during a run.

The scenario's sections, the setup form, the command line and its help, the tables in the docs, and
the report come from here. A new setting is one line in a class below. Nothing heavy is imported:
the command line needs this file at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args, get_origin, get_type_hints

from ddenv.text import Data, plain

Value = int | float | str | bool | None

# Models and robots are at most this far from the origin, m, and a heading makes at most so many
# radians.
FARTHEST = 1e6
TURNS = 1e3

# Kinds of elements that the user can have skipped instead of refusing the world.
Ignorable = Literal["heightmap", "image", "mesh", "include", "joint", "population"]
IGNORABLE: tuple[str, ...] = get_args(Ignorable)
# What collides in place of a mesh that is not convex.
MeshReading = Literal["pieces", "hull"]
MESH_READINGS: tuple[str, ...] = get_args(MeshReading)

# Where a setting shows. "method" is chosen by schemas, "basic" and "more" are fields of the setup
# form, and all three are options of the command line, as "option" is. "scenario" is in scenario
# files (and in `ddenv.reduce`) alone.
Shown = Literal["method", "basic", "more", "option", "scenario"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A setting and all that is known about it.

    `meaning` is a short phrase without a full stop; `more` has further sentences, shown if they
    fit. `cost` is a sentence on the cost. A value is at least `least`, greater than `above`, at
    most `most`. `none` is the word for no value, if that is allowed. `printed` is the paper's
    value. `used_by` are the algorithms or partitionings that use it, if not all do. `stored` is
    False for a setting that only sets others. The last four come from the declaration.
    """

    default: Value
    meaning: str
    unit: str = ""
    least: float | None = None
    above: float | None = None
    most: float | None = None
    shown: Shown = "scenario"
    more: str = ""
    cost: str = ""
    none: str = ""
    may_change: bool = False
    used_by: tuple[str, ...] = ()
    printed: Value = None
    stored: bool = True
    section: str = ""
    name: str = ""
    kind: type = str
    choices: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Its place in a scenario, such as `reduction.iterations`; "" if it has none."""
        if self.section:
            return f"{self.section}.{self.name}"
        return ""

    @property
    def label(self) -> str:
        """Its name for people, with its unit."""
        return f"{self.name.replace('_', ' ')} {self.unit}".strip()

    @property
    def option(self) -> str:
        """Its option on the command line, "" where it has none."""
        if self.shown == "scenario":
            return ""
        return f"--{self.name.replace('_', '-')}"

    @property
    def summary(self) -> str:
        """The meaning with its unit."""
        if self.unit:
            return f"{self.meaning}, {self.unit}"
        return self.meaning

    @property
    def range(self) -> str:
        """The allowed numbers, in words; "" if it is no number."""
        if self.above is not None:
            return f"more than {self.above:g}, at most {self.most:g}"
        if self.least is None:
            return ""
        if self.most is None:
            return f"{self.least:g} or more"
        return f"{number_text(self.least)} to {number_text(self.most)}"

    @property
    def wanted(self) -> str:
        """What kind of number it is, and the allowed ones, in words."""
        kind = "a whole number" if self.kind is int else "a number"
        if " to " in self.range:
            return f"{kind} from {self.range}"
        return f"{kind}, {self.range}"

    def words(self, value: Value) -> list[str]:
        """The option with `value`, as typed on the command line."""
        if self.kind is bool:
            return [self.option if value else f"--no-{self.option[2:]}"]
        # No limit has no number of its own.
        return [self.option, number_text(0 if value is None else value)]

    def allows(self, value: Any) -> bool:
        """Whether `value` has the right type and is in range."""
        if value is None:
            return bool(self.none)
        if self.kind in (bool, str) or isinstance(value, bool):
            return isinstance(value, self.kind) and (not self.choices or value in self.choices)
        if not isinstance(value, int if self.kind is int else (int, float)):
            return False
        high = self.most is None or value <= self.most
        return high and (
            value > self.above
            if self.above is not None
            else self.least is None or value >= self.least
        )


def number_text(value: Value) -> str:
    """A value as short as it can be typed."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e9:
        return str(int(value))
    return str(value)


def setting(default: Value, meaning: str, **more: Any) -> Any:
    """Declares a setting in a class of settings; the annotation beside it is its type."""
    return Setting(default=default, meaning=meaning, **more)


class Reduction:
    """How the world is reduced."""

    pair: str = setting(
        "model2model/avg-trajectory-proximal",
        (
            "how the environment is split and in which order its parts are tried: "
            "partitioning/prioritization"
        ),
        shown="method",
        may_change=True,
        more="'ddenv schemas' explains each.",
    )
    algorithm: str = setting(
        "ddenv",
        "how the environment is searched",
        shown="method",
        may_change=True,
        more="'ddenv schemas' explains each.",
    )
    iterations: int = setting(
        3,
        "maximum re-runs of a candidate that did not show the failure",
        least=0,
        most=1000,
        shown="basic",
        may_change=True,
    )
    budget: int | None = setting(
        None,
        "maximum number of simulated tests, including the baseline",
        least=1,
        most=10_000_000,
        shown="basic",
        may_change=True,
        none="none",
        more="The run then stops with what is left, and can continue with a larger budget.",
    )
    seed: int = setting(
        0,
        "number from which all seeds are derived; run i has the same seed in every candidate",
        least=0,
        most=2**31 - 1,
        shown="basic",
        more="The same seed repeats the same runs.",
        cost="Costs nothing.",
    )
    seeds: Literal["hashed", "consecutive"] = setting(
        "hashed",
        "the seed of run i: a hash of the seed and i (hashed), or seed + i (consecutive)",
        more=(
            "Consecutive is for simulators that use the seed as an index; poor generators draw "
            "similar numbers from them."
        ),
    )
    baseline_runs: int = setting(
        10, "runs of the whole world before the first round", least=1, most=1000, shown="more"
    )
    failure: int = setting(
        1,
        "which failure of the whole world is reduced; 1 is the most frequent one",
        least=1,
        most=1000,
        shown="more",
        may_change=True,
        more="The baseline lists them with their numbers.",
        cost="A rarer failure needs more re-runs.",
    )
    as_printed: bool = setting(
        False,
        "follow the paper's algorithm to the letter, not the variant that needs fewer tests",
        shown="more",
        stored=False,
        used_by=("ddenv",),
        cost="On needs many more tests for an equally minimal result.",
    )
    accept_rate: Literal["first", "kept", "exact"] = setting(
        "kept",
        "when a candidate is accepted: at its first run with f (first), at a run with f if all "
        "its runs fit the rate of f (kept), or if a failing run of the baseline, replayed with "
        "its seed, still shows f (exact)",
        printed="first",
        shown="more",
        may_change=True,
        more=(
            "The paper's rule is first. With first and exact, what is left may fail far more "
            "rarely than the whole world."
        ),
        cost="Where f is rare, kept takes thousands of tests and exact about a hundred.",
    )
    exact_seeds: int = setting(
        4,
        (
            "how many failing runs of the baseline 'accept_rate: exact' replays; a candidate is "
            "accepted if one of them shows f"
        ),
        least=1,
        most=1000,
        shown="option",
        may_change=True,
        cost=(
            "With more, fewer candidates are lost by chance, but each candidate without f takes "
            "more tests."
        ),
    )
    keep_rate: float = setting(
        0.8,
        "share of the whole world's failure rate that the search keeps",
        above=0,
        most=0.95,
        shown="more",
        cost="A lower share removes more and leaves a rarer failure.",
    )
    certify_rate: float = setting(
        2 / 3,
        "share of the whole world's failure rate that the certificate has to show",
        above=0,
        most=0.95,
        shown="more",
        more=(
            "Fresh runs are made until they show that what is left keeps this share; 'ddenv "
            "certify' can raise it."
        ),
        cost="0.8 takes about twice as many fresh runs.",
    )
    keep_supports: bool = setting(
        False,
        "keep each model together with what it rests on: a stack is removed as a whole",
        shown="more",
        cost="On needs fewer tests, but may leave models that could be removed.",
    )
    early_stop: bool = setting(
        True,
        (
            "end a test once its controller has stopped and it rests well inside or outside "
            "epsilon; "
            "certificate runs never end early"
        ),
        printed=False,
        shown="option",
        cost="On saves the rest of each test in which the controller has stopped.",
    )
    slice: bool = setting(
        True,
        (
            "remove without testing what cannot have affected a run, and skip tests whose result "
            "follows from another one"
        ),
        printed=False,
        shown="option",
        cost="On saves most tests; off simulates all of them.",
    )
    audit: int = setting(
        20,
        (
            "one in this many tests whose result follows from another one is simulated anyway and "
            "compared bit for bit"
        ),
        least=1,
        most=1_000_000,
        shown="option",
        cost="Lower is safer but simulates more.",
    )
    cluster: str = setting(
        "here",
        "where the tests run: here, or on the workers of a Dask cluster",
        shown="more",
        more=(
            "tcp://HOST:PORT or tls://HOST:PORT of a scheduler, the path of its file, or "
            "ssh:HOST1,HOST2 to start one."
        ),
        cost="Costs no tests: the results are the same as on this machine.",
    )
    growth: Literal["paper", "steady"] = setting(
        "steady",
        "when n grows: after every round (paper), or only after a round without success (steady)",
        printed="paper",
        used_by=("ddenv",),
    )
    skip: Literal["known", "implied"] = setting(
        "implied",
        (
            "which candidates are skipped: sets judged before (known), or also sets without a "
            "group that was needed before (implied)"
        ),
        printed="known",
        used_by=("ddenv",),
    )
    candidates: Literal["both", "partitions", "complements"] = setting(
        "both",
        "what is tried in a round: each part, its complement (the world without the part), or both",
        printed="both",
        used_by=("ddenv",),
    )
    complement_order: Literal["paper", "far-first"] = setting(
        "paper",
        (
            "each complement after its part (paper), or first those without the models farthest "
            "away (far-first)"
        ),
        printed="paper",
        used_by=("ddenv",),
    )
    n_partitions: int = setting(
        2, "partitions in the first round", least=2, most=100_000, used_by=("ddenv",)
    )
    delta: float = setting(
        0.5,
        "change of angular velocity at which trajectoryseg cuts",
        unit="rad/s",
        above=0,
        most=1000,
        used_by=("trajectoryseg",),
    )
    prior: Literal["spatial", "uniform"] = setting(
        "spatial", "initial probabilities of probdd and splitting", used_by=("probdd", "splitting")
    )


class Failure:
    """What counts as the same failure: still short of the goal at `timeout`, within `epsilon` of
    where f ended.
    """

    timeout: float = setting(
        45.0, "simulated time the robot has", unit="s", least=0.01, most=100_000, shown="basic"
    )
    epsilon: float = setting(
        0.33,
        "maximum distance between the ends of two similar failures",
        unit="m",
        least=0.001,
        most=1000,
        shown="basic",
        may_change=True,
        cost="Wider accepts more failures as the same one; narrower misses f more often.",
    )
    similarity: Literal["end-pose", "trajectory"] = setting(
        "end-pose",
        (
            "what similar failures share: where they end (end-pose), or also how they got there "
            "(trajectory)"
        ),
        shown="more",
        cost="Costs no tests by itself; trajectory is stricter, so less may be removed.",
    )


class Simulation:
    """How Drake simulates. `wall_timeout` bounds one test in real time; None for a limit that
    follows the speed. `memory_limit` bounds the memory of one worker; None for its share of what
    the machine allows.
    """

    time_step: float = setting(
        0.005, "time step of the simulation", unit="s", least=0.0001, most=0.05
    )
    contact: Literal["lagged", "sap", "similar"] = setting(
        "lagged", "Drake's approximation of contact"
    )
    wall_timeout: float | None = setting(
        None,
        (
            "maximum real time of one test without its preparation; by default 1800 in the "
            "baseline, then set by its speed"
        ),
        unit="s",
        least=0.01,
        most=1_000_000,
        none="by speed",
    )
    memory_limit: float | None = setting(
        None,
        (
            "maximum memory of one worker; by default its share of 90 % of the memory that the "
            "machine or container allows"
        ),
        unit="GB",
        least=0.01,
        most=1_000_000,
        none="by machine",
    )


def declared(section: str, declaration: type) -> Iterator[Setting]:
    """The settings of a class, with their names and types."""
    for name, hint in get_type_hints(declaration).items():
        choices = get_args(hint) if get_origin(hint) is Literal else ()
        # The first type of a union with None is that of a value.
        kind = str if choices else (*get_args(hint), hint)[0]
        yield replace(
            vars(declaration)[name], section=section, name=name, kind=kind, choices=choices
        )


SECTIONS: dict[str, type] = {"reduction": Reduction, "failure": Failure, "simulation": Simulation}
SETTINGS: dict[str, Setting] = {
    each.name: each
    for section, declaration in SECTIONS.items()
    for each in declared(section, declaration)
}
OPTIONS = tuple(each for each in SETTINGS.values() if each.option)
CHANGEABLE = tuple(each.name for each in SETTINGS.values() if each.may_change)
PRINTED: dict[str, Value] = {
    each.name: each.printed for each in SETTINGS.values() if each.printed is not None
}
# Not in a scenario, since it does not change the result.
JOBS = Setting(
    default=None,
    meaning="tests at the same time",
    least=1,
    most=1024,
    shown="basic",
    name="jobs",
    kind=int,
)


def is_printed(reduction: Mapping[str, Any]) -> bool:
    """Whether a scenario's section `reduction` asks for the paper's algorithm to the letter."""
    return all(
        reduction.get(name, SETTINGS[name].default) == value for name, value in PRINTED.items()
    )


def read(scenario: Mapping[str, Any], one: Setting) -> Value:
    """The value of a setting in a scenario as plain data; its default where it is missing or
    damaged.
    """
    section = scenario.get(one.section)
    if not isinstance(section, Mapping):
        return one.default
    value = section.get(one.name, one.default) if one.stored else is_printed(section)
    if not one.allows(value):
        return one.default
    if isinstance(value, str):
        return plain(value)
    return value


def put(scenario: Mapping[str, Data], one: Setting, value: Value) -> None:
    """Writes a setting to a scenario as plain data, unchecked: the scenario's model checks it."""
    section = scenario[one.section]
    if one.stored:
        section[one.name] = value
    elif bool(value) != is_printed(section):
        section.update(PRINTED if value else {name: SETTINGS[name].default for name in PRINTED})
