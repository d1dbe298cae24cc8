"""The cells of a study: each is one reduction of a scenario by an algorithm with a pair, from one
seed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any

from ddenv import schemas
from ddenv.errors import UserError
from ddenv.run_numbers import CERTIFICATES
from ddenv.runs.experiment import with_options
from ddenv.runs.folder import SUFFIX
from ddenv.text import Names
from ddenv.world.load import find_scenario, load_scenario
from ddenv.world.scenario import Scenario

# The scenarios and the pairs of the paper's Tables II to IV, in their order.
SCENARIOS = ("ditch", "rubble", "friction")
PAIRS = (
    "model2model/failure-proximal",
    "model2model/avg-trajectory-proximal",
    "timeseg/avg-trajectory-proximal",
)
# A seed is less.
MOST_SEED = 2**31
# Between the seeds of a scenario. Run i has seed + i: the search has few runs, certificates have
# those from `CERTIFICATES` on.
SEEDS_APART = 10 * CERTIFICATES.start
# The folder of the runs, in that of the study.
RUNS = "runs"
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
        """The partitioning and the prioritization, "" for a part that the algorithm does not
        use.
        """
        parts = dict(zip(schemas.BOTH, self.pair.split("/"), strict=True))
        partitioning, prioritization = (
            parts[k] if k in schemas.uses(self.algorithm) else "" for k in schemas.BOTH
        )
        return partitioning, prioritization

    @property
    def used(self) -> Names:
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
    """One reduction. `seed` is that of its first run; `scenario` has all settings, the seed and the
    method included.
    """

    scenario: Scenario
    method: Method
    seed: int

    @property
    def name(self) -> str:
        """The name of its run file, without the ending."""
        words = (
            self.method.algorithm,
            *self.method.used,
            f"seed-{self.seed}",
            *(["slices"] if self.slices else []),
        )
        return "_".join((file_name(self.scenario), *(NO_NAME.sub("-", word) for word in words)))

    @property
    def slices(self) -> bool:
        """Whether it removes, without a test, models that did not affect a run; the paper does
        not.
        """
        return self.scenario.reduction.slice

    @property
    def label(self) -> str:
        """Its name for people, without its seed."""
        return f"{self.scenario.name} {self.method.label}{' with slices' if self.slices else ''}"


def run_path(folder: Path, cell: Cell) -> Path:
    return folder / RUNS / f"{cell.name}{SUFFIX}"


def file_name(scenario: Scenario) -> str:
    """A scenario's name as a part of files' names: cut to what file systems allow."""
    return NO_NAME.sub("-", scenario.name.encode()[:LONGEST_NAME].decode(errors="ignore"))


@dataclass(frozen=True)
class Plan:
    """A whole study: `scenarios` as in their files, `methods` in the order of the tables, and how
    many `seeds` of each.
    """

    scenarios: tuple[Scenario, ...]
    methods: tuple[Method, ...]
    seeds: int

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """All cells in the order of the tables: without slices, and then with them if the scenario
        uses them.
        """
        return tuple(
            self._cell(scenario, method, number, slices)
            for scenario in self.scenarios
            for method in self.methods
            for number in range(self.seeds)
            for slices in (False, True)
            if scenario.reduction.slice or not slices
        )

    def _cell(self, scenario: Scenario, method: Method, number: int, slices: bool) -> Cell:
        """The seeds of a scenario are so far apart that two cells share either all runs or none."""
        seed = scenario.reduction.seed + number * SEEDS_APART
        if seed >= MOST_SEED:
            raise UserError(
                f"--seeds: the last seed of {scenario.name} would be {seed}; the maximum is "
                f"{MOST_SEED - 1}"
            )
        own = {"algorithm": method.algorithm, "pair": method.pair, "seed": seed, "slice": slices}
        reduction = scenario.reduction.model_copy(update=own)
        return Cell(scenario.model_copy(update={"reduction": reduction}), method, seed)


def make_plan(
    scenarios: Sequence[str] = (),
    pairs: str = "paper",
    algorithms: str = "ddenv",
    seeds: int = 1,
    **options: Any,
) -> Plan:
    """The study of these words; each may hold several names separated by commas. Raises UserError.

    `options` are those of `ddenv.runs.experiment.with_options` for all of it.
    """
    chosen_pairs = _chosen(
        "--pairs", pairs, schemas.split_pair, {"paper": PAIRS, "all": schemas.pairs()}
    )
    known = {"all": schemas.names("algorithm")}
    chosen_algorithms = _chosen(
        "--algorithms", algorithms, partial(schemas.check, "algorithm"), known
    )
    loaded = tuple(
        with_options(load_scenario(find_scenario(name)), **options)
        for name in scenario_names(scenarios)
    )
    # Methods that use the same parts are the same.
    methods: dict[Names, Method] = {}
    for method in (Method(*parts) for parts in product(chosen_algorithms, chosen_pairs)):
        methods.setdefault((method.algorithm, *method.used), method)
    plan = Plan(loaded, tuple(methods.values()), seeds)
    if len({cell.name for cell in plan.cells}) < len(plan.cells):
        raise UserError(
            "--scenarios: the names of two of them make the same file names; give each a name of "
            "its own"
        )
    return plan


def scenario_names(words: Sequence[str]) -> Names:
    """The names or files of the scenarios, each once; the paper's three if none is given. Raises
    UserError.
    """
    if words:
        return _names("--scenarios", ",".join(words))
    return SCENARIOS


def _names(option: str, words: str) -> Names:
    names = tuple(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    if not names:
        raise UserError(f"{option}: expected names separated by commas; found '{words}'")
    return names


def _chosen(
    option: str, words: str, check: Callable[[str], object], groups: Mapping[str, Sequence[str]]
) -> Names:
    """The names in `words`, each once; that of a group stands for all in it. Raises UserError."""
    names = tuple(
        dict.fromkeys(name for word in _names(option, words) for name in groups.get(word, (word,)))
    )
    for name in names:
        try:
            check(name)
        except UserError as error:
            raise UserError(
                f"{option}: {error}; or give {' or '.join(map(repr, groups))}"
            ) from None
    return names
