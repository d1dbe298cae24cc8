"""The connection to a Dask scheduler: in a thread of its own it looks who is there, and connects again when it is lost."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from distributed import Client, Security, SSHCluster

from ddenv.engine.worker import reason_of
from ddenv.errors import UserError
from ddenv.runs.trust import hosts_of
from ddenv.world.access import is_file

# The time between two looks at who is there, and between two attempts to connect, s.
PERIOD = 0.5
AGAIN = 2.0
# How long a scheduler may take to answer, and to say goodbye, s.
ANSWER = 10.0
GOODBYE = 2.0


class Link:
    """A connection to the scheduler of `cluster` that is made again when it is lost.

    In its thread it calls `attached` with each new connection, `there` with the addresses of all workers and how many tests each
    can make at a time, and `lost` with the reason.
    """

    def __init__(
        self,
        cluster: str,
        attached: Callable[[Client], None],
        there: Callable[[Mapping[str, int]], None],
        lost: Callable[[str], None],
    ) -> None:
        """Raises UserError if no scheduler answers."""
        self._cluster, self._attached, self._there, self._lost = cluster, attached, there, lost
        self._ssh: Any = None
        self._closed = threading.Event()
        try:
            self._client = self._connected()
        except Exception as error:
            self._end()
            raise UserError(
                f"{cluster}: no Dask scheduler can be used there ({reason_of(error)}); start it, or make the tests on this "
                "machine with --cluster here"
            ) from None
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def _connected(self) -> Client:
        hosts, how = hosts_of(self._cluster), {"timeout": ANSWER, "set_as_default": False, "name": "ddenv"}
        if hosts:
            # Dask makes the first one its scheduler.
            self._ssh = SSHCluster([hosts[0], *hosts])
            return Client(self._ssh, **how)
        if is_file(Path(self._cluster)):
            return Client(scheduler_file=self._cluster, **how)
        if self._cluster.startswith("tls:"):
            return Client(self._cluster, security=Security(require_encryption=True), **how)
        return Client(self._cluster, **how)

    def _follow(self) -> None:
        while not self._closed.is_set():
            self._attached(self._client)
            why = self._watch()
            if self._closed.is_set():
                return
            self._lost(why)
            self._end()
            self._connect_again()

    def _watch(self) -> str:
        """Tells who is there, as often as that changes, until the scheduler is lost; returns why."""
        before, comm = None, self._client.scheduler_comm
        while not self._closed.wait(PERIOD):
            # Dask connects again by itself, but has forgotten what it was asked.
            if self._client.status != "running" or self._client.scheduler_comm is not comm:
                return "the connection broke"
            try:
                threads = dict(self._client.ncores())
            except Exception as error:
                return reason_of(error)
            if threads != before:
                before = threads
                self._there(threads)
        return ""

    def _connect_again(self) -> None:
        while not self._closed.wait(AGAIN):
            try:
                self._client = self._connected()
                return
            except Exception:
                # It is not there yet.
                self._end()

    def _end(self) -> None:
        client, self._ssh, ssh = getattr(self, "_client", None), None, self._ssh
        for each in (client, ssh):
            if each is not None:
                # What is left of a broken connection may complain.
                with suppress(Exception):
                    each.close(timeout=GOODBYE)

    def close(self) -> None:
        """Ends the connection, and what was started over SSH."""
        self._closed.set()
        self._end()
        self._thread.join(ANSWER)
