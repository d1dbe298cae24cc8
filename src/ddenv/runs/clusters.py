"""Where tests are made: on this machine, or by a Dask cluster that the user names."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runs.programs import how_to_install
from ddenv.world.access import is_file
from ddenv.world.scenario import Scenario

HERE = "here"
SSH = "ssh:"
# A scheduler's address; a bracket holds the colons of IPv6.
SCHEDULER = re.compile(r"(tcp|tls)://(\[[\w:.%]+\]|[\w.-]+):\d{1,5}")


def check_cluster(cluster: str) -> None:
    """Raises UserError for what is neither `here` nor a cluster that can be asked, and where Dask is not installed."""
    if cluster == HERE:
        return
    if not (SCHEDULER.fullmatch(cluster) or hosts_of(cluster) or is_file(Path(cluster))):
        raise UserError(
            f"options: reduction.cluster: expected here, tcp://HOST:PORT, tls://HOST:PORT, ssh:HOST1,HOST2 or the path of a "
            f"scheduler file that is there, found '{cluster}'"
        )
    if find_spec("distributed") is None:
        raise UserError(f"options: reduction.cluster: Dask is not installed here: {how_to_install('cluster')}")


def made_here(scenario: Scenario) -> Scenario:
    """`scenario` with its tests on this machine."""
    return scenario.model_copy(update={"reduction": scenario.reduction.model_copy(update={"cluster": HERE})})


def hosts_of(cluster: str) -> list[str]:
    """The hosts of `ssh:HOST1,HOST2`; none for any other cluster."""
    hosts = cluster.removeprefix(SSH).split(",") if cluster.startswith(SSH) else []
    return hosts if all(re.fullmatch(r"\w[\w.-]*", host) for host in hosts) else []
