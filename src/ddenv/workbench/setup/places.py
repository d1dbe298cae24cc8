"""What the form remembers: start and goal in worlds without a scenario, by the world's file; and the number of jobs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ddenv.runs import processor
from ddenv.runs.remembered import read_state, write_state
from ddenv.settings import JOBS
from ddenv.workbench.setup import form

PLACES, JOBS_FILE = "places.json", "jobs.json"
KEPT = 200  # worlds


def places_of(world: Path) -> dict[str, str] | None:
    """The texts of the fields for start and goal as they were the last time; None for another world, or if one is wrong."""
    known = _known().get(str(world.absolute()))
    if not isinstance(known, dict):
        return None
    texts = {field.id: str(known.get(field.id, "")) for field in form.PLACES}
    return None if any(form.problem(field, texts[field.id]) for field in form.PLACES) else texts


def remember_places(world: Path, texts: Mapping[str, str]) -> None:
    """Remembers the start and the goal in `texts`."""
    name = str(world.absolute())
    others = {key: each for key, each in _known().items() if key != name}
    now = {name: {field.id: texts[field.id] for field in form.PLACES}}
    write_state(PLACES, dict(list((others | now).items())[-KEPT:]))


def remembered_jobs() -> int | None:
    """The number of jobs of the last run that was started here; None if it was the usual one."""
    found = read_state(JOBS_FILE)
    return found if type(found) is int and JOBS.allows(found) else None


def remember_jobs(jobs: int) -> None:
    """Remembers it, unless it is as many as this machine has cores for."""
    write_state(JOBS_FILE, None if jobs == processor.usable_cores() else jobs)


def _known() -> dict[str, object]:
    found = read_state(PLACES)
    return found if isinstance(found, dict) else {}
