"""The recorded moments whose sentences on why the robot fails are kept as golden files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.conftest import ROOT
from tests.engine.fake import FakePool, drive, new_run
from tests.workbench import fake_moments
from tests.workbench.fake_run import FakeRun, as_printed

LESSONS = ROOT / "src/ddenv/learn/lessons"


def fake(moment: Callable[[FakeRun], object]) -> Callable[[Path], Path]:
    """Writes a run up to this moment, and returns its file."""

    def made(folder: Path) -> Path:
        run = FakeRun(folder / "crates-1.ddenv")
        moment(run)
        run.close()
        return run.path

    return made


def lesson(name: str) -> Callable[[Path], Path]:
    return lambda folder: LESSONS / f"{name}.ddenv"


def exact(folder: Path) -> Path:
    """Chosen runs were reduced exactly: the wall alone stops the robot."""
    path = new_run(folder, accept_rate="exact")
    drive(path, FakePool(lambda keep, seed: "similar" if "wall" in keep else "pass", 1))
    return path


def nothing_left_out(run: FakeRun) -> None:
    fake_moments._rounds(run).start_certificate()
    run.certify_all(2, None, 6 * "s")
    run.finish_certificate((None, "kept", 6 * "s"))


def rate_lost(run: FakeRun) -> None:
    fake_moments._rounds(run).start_certificate()
    run.certify_all(2, None, 6 * "so")
    run.finish_certificate((None, "lost", 6 * "so"))


def damaged(run: FakeRun) -> None:
    fake_moments.isolated(run).file._db.execute("DELETE FROM motion")


def doubtful_shape(run: FakeRun) -> None:
    """A model whose shape is only nearly its mesh."""
    fake_moments.isolated(run)
    run.write("noted", about="pieces", words="crate_00: its 3 hulls differ by 4 cm from its mesh")


def no_passing_world(run: FakeRun) -> None:
    fake_moments.finished(run).start_isolation(2)
    run.isolate_all(run.remove("crate_00", "crate_01", "crate_02"), "e")
    run.write("isolation_finished", removal=None)


def piled(folder: Path) -> Path:
    """A certificate in a world where crate_01 rests on crate_00 and goes with it."""
    data = as_printed()
    data["reduction"]["keep_supports"] = True
    run = FakeRun(folder / "crates-1.ddenv", data)
    run.created().supports(("crate_01", "crate_00"))
    fake_moments.finished(run)
    run.close()
    return run.path


MOMENTS: dict[str, Callable[[Path], Path]] = {
    "mid-round": fake(fake_moments.mid_round),
    "certifying": fake(fake_moments.certifying),
    "uncertified": fake(fake_moments.uncertified),
    "nothing-left-out": fake(nothing_left_out),
    "rate-lost": fake(rate_lost),
    "certified": fake(fake_moments.finished),
    "not-shown": fake(fake_moments.not_shown),
    "helped": fake(fake_moments.helped),
    "faster-without": fake(fake_moments.faster_without),
    "piled": piled,
    "isolating": fake(fake_moments.isolating),
    "isolated": fake(fake_moments.isolated),
    "no-passing-world": fake(no_passing_world),
    "doubtful-shape": fake(doubtful_shape),
    "damaged": fake(damaged),
    "margins": fake(fake_moments.with_margins),
    "exact": exact,
    "ditch": lesson("ditch"),
    "quay": lesson("quay-kept"),
}
