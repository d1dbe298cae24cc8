"""What an engine does with a run, and how. The engine's process gets all of it as one JSON text."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Literal

# Of a search for margins, runs.
MOST_RUNS = 300


@dataclass(frozen=True, kw_only=True)
class Reduce:
    """Searches on from where the run stands, or goes on with what another engine left open."""

    kind: Literal["reduce"] = "reduce"


@dataclass(frozen=True, kw_only=True)
class Certify:
    """Makes one more certificate, with at least so many runs of what is left.

    With a `certify_rate` the last certificate goes on until it shows this share of the rate.
    """

    kind: Literal["certify"] = "certify"
    at_least: int
    certify_rate: float | None = None


@dataclass(frozen=True, kw_only=True)
class Isolate:
    """Finds the nearest world that passes, and judges it by `at_least` fresh runs; None: by as many
    as usual.
    """

    kind: Literal["isolate"] = "isolate"
    at_least: int | None = None


@dataclass(frozen=True, kw_only=True)
class GiveUpIsolation:
    """Ends the search for the nearest world that passes; the run is as it was before."""

    kind: Literal["give_up_isolation"] = "give_up_isolation"


@dataclass(frozen=True, kw_only=True)
class FindMargins:
    """Finds the margins of the numbers that `globs` match, of all without one, in `most_runs`."""

    kind: Literal["find_margins"] = "find_margins"
    globs: tuple[str, ...] = ()
    most_runs: int = MOST_RUNS


Job = Reduce | Certify | Isolate | GiveUpIsolation | FindMargins


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """How an engine works: it makes up to `jobs` tests at the same time, on this machine or on a
    `cluster`, if that is not what the scenario says.

    A new `accept_mode` ("automatic" or "ask") replaces the run's. `attended`: it pauses where there
    is an offer to the user. `allow_other_machine`: results of other versions or of another
    processor may follow. `ignore_crashes`: it starts also after engines that died at once.
    `shared_folder` has other runs, whose tests are reused.
    """

    jobs: int
    cluster: str | None = None
    accept_mode: str | None = None
    attended: bool = False
    allow_other_machine: bool = False
    ignore_crashes: bool = False
    shared_folder: str | None = None


@dataclass(frozen=True, kw_only=True)
class Order:
    """A job with its options, for one engine. `last_command` was the run's last one before."""

    job: Job
    options: EngineOptions
    last_command: int

    def to_json(self) -> str:
        return json.dumps(asdict(self))
