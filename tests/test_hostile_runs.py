"""Whatever values a stored run has, it opens in every viewer, or says in a line that it is
damaged.
"""

import json
import os
import shutil
from contextlib import contextmanager, suppress

import pytest
from rich.cells import cell_len
from textual.worker import WorkerCancelled

from ddenv.errors import UserError
from ddenv.page.html import html
from ddenv.page.markdown import markdown
from ddenv.report.report import content
from ddenv.report.run_data import read_run
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import RunFile
from ddenv.scene.player import Player
from ddenv.scene.stage import Stage
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.race_screen import race_of_runs
from ddenv.workbench.shared.messages import ShowRun
from tests.hostile_runs import hostile_run, templates
from tests.tiers import slow

# A batch of runs is one test.
SIZE = 5
BATCHES = slow(pytest.mark.fuzz, range(int(os.environ.get("DDENV_HOSTILE_BATCHES", "8"))), but=[0])
KEYS = (
    "1",
    "4",
    "h",
    "escape",
    "e",
    "escape",
    "E",
    "escape",
    "W",
    "down",
    "enter",
    "escape",
    "escape",
    "P",
    "right",
)


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    return templates(tmp_path_factory.mktemp("scenes"))


@pytest.fixture
def hostile(scenes, home):
    """The runs of a batch, with their seeds."""
    (home / "runs").mkdir()

    def made(batch):
        seeds = range(SIZE * batch, SIZE * batch + SIZE)
        return [
            (seed, hostile_run(scenes, home / "runs" / f"run-{seed}.ddenv", seed)) for seed in seeds
        ]

    return made


@contextmanager
def of_run(seed):
    """What is damaged is said in a line; any other error is told with the number of the run."""
    try:
        yield
    except UserError as error:
        assert "\n" not in str(error)
    except Exception as error:
        raise AssertionError(f"run {seed}") from error


def lines_are_whole(app, columns):
    lines = [
        "".join(each.text for each in strip) for strip in app.screen._compositor.render_strips()
    ]
    return all(cell_len(line) == columns for line in lines)


@pytest.mark.parametrize("batch", BATCHES)
def test_the_report_is_written_or_says_what_is_damaged(hostile, batch):
    for seed, path in hostile(batch):
        with of_run(seed):
            report = content(read_run(path))
            assert html(report) and markdown(report, "report")


@pytest.mark.parametrize("batch", BATCHES)
def test_the_scene_is_drawn_or_says_what_is_damaged(hostile, batch):
    for seed, path in hostile(batch):
        sent = []
        with of_run(seed), RunFile(path) as run, engine_lock(path):
            player = Player(
                run, Stage(lambda message, _, to=sent: to.append(message)), lambda **_: None
            )
            for now in (0.0, 0.5, 2.0, 9.0):
                player.tick(now)
            assert sent
            assert json.dumps(player.pairs(), allow_nan=False)
            for test in range(1, 4):
                with suppress(UserError):
                    assert json.dumps(player.play(test), allow_nan=False) and player.drawings(
                        "way", test
                    )


@pytest.mark.fuzz
@pytest.mark.parametrize("batch", BATCHES)
async def test_the_workbench_stands(hostile, batch):
    size = (120, 36) if batch % 2 else (80, 24)
    now = 0
    app = Workbench()
    try:
        async with app.run_test(size=size) as pilot:
            for seed, path in hostile(batch):
                now = seed
                with engine_lock(path):
                    app.post_message(ShowRun(path, watch=bool(seed % 2)))
                    await pilot.pause()
                    await app.workers.wait_for_complete()
                    await pilot.press(*KEYS, "escape")
                    assert app.is_running
                    assert lines_are_whole(app, size[0])
    except Exception as error:
        raise AssertionError(f"run {now}") from error


@pytest.mark.fuzz
@pytest.mark.parametrize("batch", BATCHES)
async def test_races_stand(hostile, batch):
    size = (120, 36) if batch % 2 else (80, 24)
    app = Workbench()
    async with app.run_test(size=size) as pilot:
        for seed, path in hostile(batch):
            copy = path.with_name(f"[b]{path.name}")
            shutil.copy(path, copy)
            race = None
            with of_run(seed):
                race = race_of_runs([path, copy])
            if race is None:
                continue
            app.push_screen(race)
            await pilot.pause()
            # The setup screen below replaces its workers while it reads.
            with suppress(WorkerCancelled):
                await app.workers.wait_for_complete()
            await pilot.press("right", "end", "home")
            assert lines_are_whole(app, size[0]), seed
            await pilot.press("escape")
            assert app.is_running, seed
