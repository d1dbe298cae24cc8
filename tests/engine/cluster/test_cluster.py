"""A run on a cluster ends as a run on this machine does, whatever happens to the cluster."""

import os
import signal
from pathlib import Path

import pytest

from tests.command import ddenv
from tests.conftest import DATA
from tests.engine.cluster.dask import Cluster, Held, said, start, until_said
from tests.engine.killing import finished_tests, story
from tests.engine.reading import state_of, told
from tests.waiting import PATIENCE, wait_until

OTHER_BITS = """
from ddenv.robot.result import Recording
ours = Recording.trajectory
Recording.trajectory = lambda self: ours(self) + 1e-12
"""

# Each waits a minute or more for Dask's programs.
LONG = pytest.mark.skipif(
    not os.environ.get("DDENV_CLUSTER"), reason="takes minutes; DDENV_CLUSTER=1 runs it"
)


@pytest.fixture
def cluster(tmp_path):
    folder = tmp_path / "cluster"
    folder.mkdir()
    made = Cluster(folder)
    yield made
    made.close()


@pytest.fixture
def held(tmp_path):
    folder = tmp_path / "held"
    folder.mkdir()
    return Held(folder)


def ended(program):
    """What a run printed that came to its end."""
    printed, complaints = program.communicate(timeout=PATIENCE)
    assert program.returncode == 0, complaints
    return printed


def check_same(run, other):
    """Two runs have the same end, and each test of the first was made once."""
    tests = [
        (test, state_of(run).tests[number].seed) for number, test in enumerate(finished_tests(run))
    ]
    assert story(state_of(run)) == story(state_of(other))
    assert state_of(run).certified == state_of(other).certified
    assert len(tests) == len(set(tests))
    # What only ran ahead when the search was over is not waited for.
    assert not any(state_of(run).tally[outcome] for outcome in ("running", "error", "timeout"))


def is_alive(simulator):
    try:
        return b"simulator" in Path(f"/proc/{simulator}/cmdline").read_bytes()
    except OSError:
        return False


def here(scenario, run):
    ended(start(scenario, run, "--jobs", 1))
    return run


@pytest.mark.programs
def test_two_workers_come_to_the_end_of_one_here(cluster, home):
    cluster.start_worker(), cluster.start_worker()
    run = home / "there.ddenv"
    ended(start(DATA / "wall.yaml", run, "--cluster", cluster.address))
    until_said(run, "2 workers of the cluster can run 2 tests")
    check_same(run, here(DATA / "wall.yaml", home / "here.ddenv"))


@LONG
@pytest.mark.programs
def test_a_test_whose_worker_is_killed_is_made_elsewhere(cluster, held, home):
    workers = cluster.start_worker(), cluster.start_worker()
    held.hold()
    run = home / "there.ddenv"
    program = start(held.file, run, "--cluster", cluster.address)
    wait_until(lambda: len(held.begun()) >= 2, lambda: said(run))
    cluster.kill(workers[0])
    until_said(run, "1 test repeated elsewhere")
    held.let_go()
    ended(program)
    check_same(run, here(held.file, home / "here.ddenv"))


@LONG
@pytest.mark.programs
def test_a_run_waits_for_a_lost_scheduler_and_goes_on_with_the_next_one(cluster, held, home):
    cluster.start_worker()
    held.hold()
    run = home / "there.ddenv"
    program = start(held.file, run, "--cluster", cluster.address)
    wait_until(held.begun, lambda: said(run))
    cluster.kill(cluster.scheduler)
    until_said(run, "is lost")
    assert program.poll() is None
    held.let_go()
    cluster.start_scheduler()
    cluster.start_worker()
    ended(program)
    assert said(run).count("attached to the Dask scheduler") == 2
    check_same(run, here(held.file, home / "here.ddenv"))


@LONG
@pytest.mark.programs
def test_the_tests_of_a_killed_engine_end_and_the_next_one_uses_the_same_workers(
    cluster, held, home
):
    cluster.start_worker(), cluster.start_worker()
    held.hold()
    run = home / "there.ddenv"
    program = start(held.file, run, "--cluster", cluster.address)
    wait_until(lambda: len(held.begun()) >= 2, lambda: said(run))
    engine = told(run, "engine_started")[0]["pid"]
    os.kill(engine, signal.SIGKILL)
    program.communicate(timeout=PATIENCE)
    wait_until(lambda: not any(map(is_alive, held.begun())))
    held.let_go()
    assert ddenv("resume", run).returncode == 0
    check_same(run, here(held.file, home / "here.ddenv"))


@LONG
@pytest.mark.programs
def test_a_worker_with_other_bits_is_left_out_by_name(cluster, home, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(OTHER_BITS)
    cluster.start_worker(PYTHONPATH=f"{tmp_path}:{os.environ.get('PYTHONPATH', 'src')}")
    run = home / "there.ddenv"
    program = start(DATA / "wall.yaml", run, "--cluster", cluster.address)
    until_said(run, "is not used: its first run of the whole world has different bits")
    # Nobody made a test so far.
    assert not state_of(run).tests
    cluster.start_worker()
    ended(program)
    assert "1 worker of the cluster can run 1 test" in said(run)
    check_same(run, here(DATA / "wall.yaml", home / "here.ddenv"))


@LONG
@pytest.mark.programs
def test_a_scheduler_may_ask_for_certificates(held, home, tmp_path, monkeypatch):
    from distributed import Security

    keys, files = Security.temporary(), {}
    for name, text in (
        ("ca-file", keys.tls_ca_file),
        ("cert", keys.tls_scheduler_cert),
        ("key", keys.tls_scheduler_key),
    ):
        files[name] = tmp_path / f"{name}.pem"
        files[name].write_text(text)
    # As the user guide says.
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TLS__CA_FILE", str(files["ca-file"]))
    for who in ("CLIENT", "SCHEDULER", "WORKER"):
        monkeypatch.setenv(f"DASK_DISTRIBUTED__COMM__TLS__{who}__CERT", str(files["cert"]))
        monkeypatch.setenv(f"DASK_DISTRIBUTED__COMM__TLS__{who}__KEY", str(files["key"]))
    cluster = Cluster(tmp_path, "tls")
    try:
        cluster.start_worker()
        run = home / "there.ddenv"
        ended(start(held.file, run, "--cluster", cluster.address))
        check_same(run, here(held.file, home / "here.ddenv"))
        # Without keys nobody is let in.
        monkeypatch.delenv("DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT")
        monkeypatch.delenv("DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY")
        refused = ddenv(
            "run", held.file, "--output", home / "no.ddenv", "--trust", "--cluster", cluster.address
        )
        assert refused.returncode == 2
        assert "no Dask scheduler can be used there" in refused.stderr
        assert "Traceback" not in refused.stderr
    finally:
        cluster.close()
