"""Makes the picture of the workbench in the middle of a reduction of the ditch again: docs/run.svg.

python docs/workbench_picture.py
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import tempfile
from pathlib import Path

from ddenv.launch.programs import start_engine
from ddenv.launch.runs import create_run
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.workbench.app import Workbench
from ddenv.world.load import find_scenario, load_scenario

SIZE = (120, 36)
# The picture is taken after so many tests (and re-runs), when a run is so far (simulated s).
TESTS, SECONDS = 60, 20.0
JOBS = 2
DOCS = Path(__file__).resolve().parent


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ditch.ddenv"
        create_run(load_scenario(find_scenario("ditch")), path)
        engine = start_engine(path, JOBS)
        try:
            asyncio.run(photograph(path))
        finally:
            os.killpg(engine.pid, signal.SIGTERM)
            engine.wait()


async def photograph(path: Path) -> None:
    app = Workbench(path)
    async with app.run_test(size=SIZE) as pilot:
        while not is_moment(path):
            await pilot.pause(0.05)
        await pilot.pause(0.1)
        app.save_screenshot("run.svg", str(DOCS))
    print(f"wrote {DOCS / 'run.svg'}", file=sys.stderr)


def is_moment(path: Path) -> bool:
    """Whether enough was tested, and a run is on its way."""
    with RunFile(path) as run:
        live = [row for row in run.live() if row.time >= SECONDS]
        return bool(live) and fold(run.events()).tests_done >= TESTS


if __name__ == "__main__":
    main()
