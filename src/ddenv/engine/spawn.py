"""How worker processes are started: with an environment of their own, whenever that is."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess

# A simulated step makes a thousand small allocations: glibc is to keep more of them at hand (a step takes 59 us, not 75).
# And a worker has one core: libraries that compute in threads would only take it from other workers.
FOR_DRAKE = {
    "GLIBC_TUNABLES": "glibc.malloc.tcache_count=127",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}

_one_at_a_time = threading.Lock()


class _DrakeProcess(SpawnProcess):
    """Is started with `FOR_DRAKE`: libraries read such variables before a line of Python runs."""

    @staticmethod
    def _Popen(process: SpawnProcess) -> object:
        with _environment(FOR_DRAKE):
            return SpawnProcess._Popen(process)


class DrakeContext(SpawnContext):
    """Starts processes for the simulation with Drake, at first and in the place of those that died."""

    Process = _DrakeProcess


@contextmanager
def _environment(more: Mapping[str, str]) -> Iterator[None]:
    """`more` in our own environment for a moment, as far as the user has not set it: it is what a new process is given."""
    with _one_at_a_time:
        added = [name for name in more if name not in os.environ]
        os.environ.update({name: more[name] for name in added})
        try:
            yield
        finally:
            for name in added:
                del os.environ[name]
