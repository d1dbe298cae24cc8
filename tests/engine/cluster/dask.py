"""A Dask cluster of real programs on 127.0.0.1, and a simulator whose tests wait until they may
end.
"""

import os
import socket
import subprocess
import sys
from pathlib import Path

import yaml

from tests.command import DDENV
from tests.conftest import DATA, ROOT
from tests.engine.reading import told
from tests.waiting import wait_until

# Passes unless both the deck and the wall are there; leaves a file for each test that began, and
# waits while there is `hold`.
SIMULATOR = """
import os, pathlib, sys, time, uuid
here = pathlib.Path(__file__).parent
world = pathlib.Path(sys.argv[1]).read_text()
(here / "begun" / uuid.uuid4().hex).write_text(str(os.getpid()))
print("t,x,y,z,qx,qy,qz,qw", flush=True)
while (here / "hold").exists():
    time.sleep(0.02)
fails = all(f'name="{name}"' in world for name in ("deck", "wall"))
print("0,0,0,0,0,0,0,1")
print(f"1,{1 if fails else 4},0,0,0,0,0,1")
sys.exit(fails)
"""


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


class Cluster:
    """A scheduler and workers, started and killed as a user or a night does it."""

    def __init__(self, folder: Path, scheme: str = "tcp", options: tuple[str, ...] = ()) -> None:
        self.address, self.options = f"{scheme}://127.0.0.1:{free_port()}", options
        self.folder, self.workers, self.scheduler = folder, [], None
        self.start_scheduler()

    def start_scheduler(self) -> None:
        words = ("--host", self.address, "--no-dashboard", "--no-jupyter")
        self.scheduler = self._start("scheduler", *words[:3])

    def start_worker(self, **environment: str) -> subprocess.Popen[bytes]:
        words = (
            self.address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
            "--local-directory",
            str(self.folder),
        )
        self.workers.append(self._start("worker", *words, **environment))
        return self.workers[-1]

    def _start(self, what: str, *words: str, **environment: str) -> subprocess.Popen[bytes]:
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "dask", what, *words, *self.options],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=os.environ | {"PYTHONPATH": str(ROOT / "src")} | environment,
            )

    def kill(self, program: subprocess.Popen[bytes]) -> None:
        program.kill()
        program.wait()

    def close(self) -> None:
        for program in (*self.workers, self.scheduler):
            self.kill(program)


class Held:
    """A scenario of the small world whose tests begin, and end only once `let_go` is called."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.file = folder, folder / "held.yaml"
        (folder / "begun").mkdir()
        (folder / "simulator.py").write_text(SIMULATOR)
        scenario = yaml.safe_load((DATA / "wall.yaml").read_text())
        scenario["oracle"] = {"command": f"{sys.executable} simulator.py {{world}}"}
        scenario["world"], scenario["robot"]["model"] = (
            str(DATA / "wall.sdf"),
            str(ROOT / "sdf" / "robots" / "husky.sdf"),
        )
        self.file.write_text(yaml.safe_dump(scenario))

    def hold(self) -> None:
        (self.folder / "hold").touch()

    def let_go(self) -> None:
        (self.folder / "hold").unlink()

    def begun(self) -> list[int]:
        """The processes of all tests that ever began."""
        return [int(each.read_text() or 0) for each in (self.folder / "begun").iterdir()]


def start(scenario: Path, run: Path, *words: object) -> subprocess.Popen[bytes]:
    """`ddenv run`, going on."""
    command = [*DDENV, "run", str(scenario), "--output", str(run), "--trust", *map(str, words)]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def said(run: Path) -> str:
    """All that a run says of its cluster."""
    if not run.exists():
        return ""
    return "\n".join(data["words"] for data in told(run, "cluster"))


def until_said(run: Path, words: str) -> None:
    wait_until(lambda: words in said(run), lambda: said(run))
