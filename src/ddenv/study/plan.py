"""The cells of a study: each is one reduction of a scenario by an algorithm with a pair, from one seed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

from ddenv import schemas
from ddenv.errors import UserError
from ddenv.runfile.state import FIRST_FRESH_RUN
from ddenv.runs.subject import load_parts, with_options
from ddenv.world.load import find_scenario, load_scenario
from ddenv.world.scenario import Scenario

# The scenarios and the pairs of the paper's Tables II to IV, in their order.
SCENARIOS = ("ditch", "rubble", "friction")
PAIRS = ("model2model/failure-proximal", "model2model/avg-trajectory-proximal", "timeseg/avg-trajectory-proximal")
# A seed is less.
MOST_SEED = 2**31
# Between the seeds of a scenario. Run i has seed + i: the search has few runs, certificates have those from `FIRST_FRESH_RUN` on.
SEEDS_APART = 10 * FIRST_FRESH_RUN
# Characters that must not stand in the name of a file.
NO_NAME = re.compile(r"[^\w-]+")
# Bytes of a scenario's name in the names of files.
LONGEST_NAME = 80


@dataclass(frozen=True, slots=True)
class Method:
    """An algorithm with the parts of the pair that it uses."""

    algorithm: str
    pair: str

    @property
    def parts(self) -> tuple[str, str]:
        """The partitioning and the prioritization, "" for a part that the algorithm does not use."""
        parts = dict(zip(schemas.BOTH, self.pair.split("/"), strict=True))
        partitioning, prioritization = (parts[k] if k in schemas.uses(self.algorithm) else "" for k in schemas.BOTH)
        return partitioning, prioritization

    @property
    def used(self) -> tuple[str, ...]:
        """The names of the parts that it uses."""
        return tuple(filter(None, self.parts))

    @property
    def label(self) -> str:
        """In short: the pair of `ddenv`, or the algorithm's name with the parts that it uses."""
        words = "/".join(self.used)
        if self.algorithm == "ddenv":
            return words
        return f"{self.algorithm} {words}".strip()


@dataclass(frozen=True, slots=True)
class Cell:
    """One reduction. `seed` is that of its first run; `scenario` has all settings, the seed and the method included."""

    scenario: Scenario
    method: Method
    seed: int

    @property
    def name(self) -> str:
        """The name of its run file, without the ending."""
        words = (self.method.algorithm, *self.method.used, f"seed-{self.seed}", *(["slices"] if self.slices else []))
        return "_".join((file_name(self.scenario), *(NO_NAME.sub("-", word) for word in words)))

    @property
    def slices(self) -> bool:
        """Whether it removes what took no part without a test; the paper's way is without."""
        return self.scenario.reduction.slice

    @property
    def label(self) -> str:
        """Its name for people, without its seed."""
        return f"{self.scenario.name} {self.method.label}{' with slices' if self.slices else ''}"


def file_name(scenario: Scenario) -> str:
    """A scenario's name as a part of files' names: cut to what file systems allow."""
    return NO_NAME.sub("-", scenario.name.encode()[:LONGEST_NAME].decode(errors="ignore"))


@dataclass(frozen=True)
class Plan:
    """A whole study: `scenarios` as in their files, `methods` in the order of the tables, and how many `seeds` of each."""

    scenarios: tuple[Scenario, ...]
    methods: tuple[Method, ...]
    seeds: int

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """All cells in the order of the tables: without slices, and then with them if the scenario uses them."""
        return tuple(
            _cell(scenario, method, number, slices)
            for scenario in self.scenarios
            for method in self.methods
            for number in range(self.seeds)
            for slices in (False, True)
            if scenario.reduction.slice or not slices
        )


def make_plan(
    scenarios: Sequence[str] = (), pairs: str = "paper", algorithms: str = "ddenv", seeds: int = 1, **options: Any
) -> Plan:
    """The study of these words; each may hold several names separated by commas. Raises UserError.

    `options` are those of `ddenv.runs.subject.with_options` for all of it.
    """
    names = scenario_names(scenarios)
    chosen_pairs = _chosen("--pairs", pairs, schemas.split_pair, {"paper": PAIRS, "all": schemas.pairs()})
    known = {"all": schemas.names("algorithm")}
    chosen_algorithms = _chosen("--algorithms", algorithms, partial(schemas.check, "algorithm"), known)
    loaded = tuple(with_options(load_scenario(find_scenario(name)), **options) for name in names)
    for number, scenario in enumerate(loaded):
        if scenario.name in (other.name for other in loaded[:number]):
            raise UserError(f"--scenarios: two of them are called '{scenario.name}'; give each a name of its own")
    plan = Plan(loaded, tuple(_methods(chosen_algorithms, chosen_pairs)), seeds)
    if len({cell.name for cell in plan.cells}) < len(plan.cells):
        raise UserError("--scenarios: the names of two of them make the same file names; give each a name of its own")
    return plan


def scenario_names(words: Sequence[str]) -> tuple[str, ...]:
    """The names or files of the scenarios, each once; the paper's three if none is given. Raises UserError."""
    return _names("--scenarios", ",".join(words)) if words else SCENARIOS


def _names(option: str, words: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    if not names:
        raise UserError(f"{option}: expected names separated by commas; found '{words}'")
    return names


def _chosen(
    option: str, words: str, check: Callable[[str], object], groups: Mapping[str, Sequence[str]]
) -> tuple[str, ...]:
    """The names in `words`, each once; that of a group stands for all in it. Raises UserError."""
    names = tuple(dict.fromkeys(name for each in _names(option, words) for name in groups.get(each, (each,))))
    for name in names:
        try:
            check(name)
        except UserError as error:
            raise UserError(f"{option}: {error}; or give {' or '.join(map(repr, groups))}") from None
    return names


def _methods(algorithms: Iterable[str], pairs: Sequence[str]) -> Iterator[Method]:
    """Each method once: those that use the same parts are the same."""
    seen = set()
    for algorithm in algorithms:
        for pair in pairs:
            method = Method(algorithm, pair)
            if (algorithm, method.used) not in seen:
                seen.add((algorithm, method.used))
                yield method


def _cell(scenario: Scenario, method: Method, number: int, slices: bool) -> Cell:
    """The seeds of a scenario are so far apart that two cells share either all runs or none."""
    reduction = scenario.reduction
    seed = reduction.seed + number * SEEDS_APART
    if seed >= MOST_SEED:
        raise UserError(f"--seeds: the last seed of {scenario.name} would be {seed}; the maximum is {MOST_SEED - 1}")
    of_cell = {"algorithm": method.algorithm, "pair": method.pair, "seed": seed, "slice": slices}
    asked = reduction.model_copy(update=of_cell)
    return Cell(scenario.model_copy(update={"reduction": asked}), method, seed)


# The cost of a dynamic model in a test, relative to a static one: about what piles of boards cost when measured.
MOVES = 4
# Equal spans of time put most of a world into one part, which takes many rounds to split.
SLOW = ("timeseg/", "trajectoryseg/")


@dataclass(frozen=True, slots=True)
class Size:
    """A scenario's world: how many models can be removed, and the cost of a test, in static models."""

    models: int
    cost: int


def sizes(plan: Plan) -> dict[str, Size]:
    """The sizes of the scenarios' worlds by the scenarios' names. Raises UserError for a world or a robot that cannot be read."""
    return {scenario.name: _size(scenario) for scenario in plan.scenarios}


def _size(scenario: Scenario) -> Size:
    world, _ = load_parts(scenario)
    elements = set(world.elements(frozenset(scenario.protected)))
    moving = sum(not model.static for model in world.models if model.name in elements)
    return Size(len(elements), len(elements) + MOVES * moving)


def longest_first(cells: Sequence[Cell], worlds: dict[str, Size]) -> list[Cell]:
    """The cells as they are to be made."""
    return sorted(cells, key=lambda cell: (-worlds[cell.scenario.name].cost, not cell.method.pair.startswith(SLOW)))
