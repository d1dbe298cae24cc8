"""A simulator in Python in a worker: one object until a test breaks, then a new worker, and no file
is left.
"""

from pathlib import Path

import pytest

from ddenv.engine.pool import Pool
from ddenv.engine.worker import Broken, Run
from ddenv.runs.experiment import load_parts
from ddenv.world.scenario import Oracle
from tests.engine.test_pool import result
from tests.waiting import wait_until
from tests.wall import wall

LEFT = frozenset({"deck", "ball"})
BREAKS = """
import os, pathlib, signal, time
import ddenv

class Mine:
    def __init__(self, setup):
        self.runs = 0

    def run(self, world, seed, timeout):
        self.runs += 1
        with open(pathlib.Path(__file__).with_name("places"), "a") as places:
            print(world.path.parent, file=places)
        yield 0.0, (os.getpid(), self.runs, 0, 0, 0, 0, 1)
        if seed == 1:
            raise ValueError("no more")
        if seed == 2:
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM, signal.SIGTERM})
            time.sleep(1000)
        if seed == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return ddenv.Ended(False)
"""


@pytest.fixture
def pool(tmp_path):
    (tmp_path / "mine.py").write_text(BREAKS)
    scenario = wall(oracle=Oracle(use="mine:Mine"), folder=tmp_path)
    made = Pool(scenario, *load_parts(scenario), 1)
    yield made
    made.close()


@pytest.mark.programs
def test_a_worker_keeps_its_object_until_a_test_breaks_and_leaves_no_file(pool, tmp_path):
    made = {}
    for test, seed in enumerate((0, 4, 1, 5, 2, 6, 3, 7)):
        # That of a test which hangs is short.
        pool.submit(test, Run(keep=LEFT, seed=seed, limit=1.0 if seed == 2 else None))
        made[seed] = result(pool)[1]
    broken = {seed: one for seed, one in made.items() if isinstance(one, Broken)}
    assert broken == {
        1: Broken("error", "simulator Mine: run raised ValueError: no more (mine.py:15)"),
        2: Broken("timeout", "took longer than 1 s of wall clock"),
        3: Broken("error", "the simulator's process died (SIGKILL, perhaps out of memory)"),
    }
    places = [one.end_pose[:2] for seed, one in made.items() if seed not in broken]
    assert [runs for _, runs in places] == [1, 2, 1, 1, 1]
    assert len({process for process, _ in places}) == 4
    pool.close()
    files = set((tmp_path / "places").read_text().split())
    assert len(files) == 4
    wait_until(lambda: not any(Path(file).exists() for file in files))
