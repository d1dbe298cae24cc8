"""Which clusters can be asked, and that none is asked which the user has not named."""

import pytest

from ddenv.errors import UserError
from ddenv.runs import trust
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import with_options
from ddenv.runs.programs import how_to_install
from ddenv.runs.trust import check_trusted, trust_cluster
from ddenv.world.load import load_scenario
from tests.conftest import DATA


def at(cluster):
    return with_options(load_scenario(DATA / "wall.yaml"), cluster=cluster)


@pytest.mark.parametrize(
    "cluster",
    ["here", "tcp://head:8786", "tls://10.0.0.1:1", "tcp://[::1]:8786", "ssh:a,b.org", __file__],
)
def test_a_cluster_is_an_address_a_file_or_hosts(cluster):
    trust.check_cluster(cluster)


@pytest.mark.parametrize(
    "cluster",
    [
        "",
        "head",
        "http://head:1",
        "tcp://head",
        "ssh:",
        "ssh:-oProxyCommand=x",
        "ssh:a b",
        "x" * 9999,
    ],
)
def test_anything_else_is_refused_in_a_line_and_nothing_is_written(cluster, tmp_path):
    with pytest.raises(UserError, match=r"reduction.cluster: expected here, tcp://"):
        create_run(at(cluster), tmp_path / "run.ddenv")
    assert not list(tmp_path.iterdir())


def test_without_dask_a_line_says_what_to_install(monkeypatch, home, command):
    monkeypatch.setattr(trust, "find_spec", lambda name: None)
    said = command("run", DATA / "wall.yaml", "--cluster", "tcp://head:8786")
    assert said.returncode == 2
    assert said.stderr.splitlines()[-1].endswith(
        f"Dask is not installed here: {how_to_install('cluster')}"
    )


def test_a_cluster_that_a_run_names_is_asked_only_if_the_user_trusts_it(home):
    with pytest.raises(
        UserError,
        match=r"tests on the cluster tcp://evil:1; whoever controls that can start any program here",
    ):
        check_trusted(at("tcp://evil:1"), "mailed.ddenv")
    trust_cluster(at("tcp://head:1"))
    check_trusted(at("tcp://head:1"), "mailed.ddenv")
    with pytest.raises(UserError):
        check_trusted(at("tcp://evil:1"), "mailed.ddenv")
