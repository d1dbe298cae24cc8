"""The machine: its processor's name, how many cores and how much memory this process may use, and
which packages it has.
"""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Iterator
from pathlib import Path

# The folder of the system's files.
ROOT = Path("/")


def name() -> str:
    """The processor's model; its architecture where the model is unknown."""
    for line in _text("proc/cpuinfo").splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model", "Hardware"):
            return " ".join(value.split())
    return platform.processor() or platform.machine()


def versions(*packages: str) -> str:
    """The versions of these packages; imports none of them."""
    from importlib.metadata import PackageNotFoundError, version

    found = []
    for name in packages:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"no {name}")
    return ", ".join(found)


def usable_cores() -> int:
    """How many cores this process may use at the same time, at least 1.

    The minimum of its CPU affinity and the limits of its control groups (version 1 and 2) and all
    groups around them, as in a container; a part of a core counts as one.
    """
    cores: float = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    for texts in _groups("cpu", ("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us")):
        # The quota of each period, both in microseconds.
        quota, period, *_ = (*map(_number, " ".join(texts).split()), math.inf, math.inf)
        cores = min(cores, quota / period if math.isfinite(quota + period) else math.inf)
    return max(1, math.ceil(cores))


def usable_memory() -> float:
    """How much memory all that runs here may use, bytes: the machine's, or less where a control
    group allows less. Infinite where that is not known.
    """
    return min([_meminfo("MemTotal"), *(limit for limit, _ in _memory_groups())])


def free_memory() -> float:
    """How much of that is free now, bytes; infinite where that is not known."""
    left = [limit - used for limit, used in _memory_groups() if math.isfinite(limit)]
    return max(0.0, min([_meminfo("MemAvailable"), *left]))


def _meminfo(key: str) -> float:
    rows = (line.split() for line in _text("proc/meminfo").splitlines())
    return 1024 * next(
        (_number(row[1]) for row in rows if len(row) > 1 and row[0] == f"{key}:"), math.inf
    )


def _memory_groups() -> Iterator[tuple[float, float]]:
    """The limit of each control group of this process, and what it uses, bytes."""
    old = ("memory.limit_in_bytes", "memory.usage_in_bytes")
    for limit, used in _groups("memory", ("memory.max", "memory.current"), old):
        yield _number(limit), float(used) if used.isdecimal() else 0.0


def _groups(controller: str, new: tuple[str, ...], old: tuple[str, ...]) -> Iterator[list[str]]:
    """What the files `new`, or in version 1 `old`, say of each control group that may limit this
    process: its own and those around it. In a container their paths may be those of the host: then
    the limits are at the top.
    """
    for line in _text("proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if controllers and controller not in controllers.split(","):
            continue
        folder = Path(path.lstrip("/"))
        for top in (controllers, controller) if controllers else ("",):
            for each in (folder, *folder.parents):
                if ".." not in each.parts:
                    files = old if controllers else new
                    yield [_text(Path("sys/fs/cgroup", top, each, name)) for name in files]


def _number(text: str) -> float:
    """Infinite for no limit."""
    if text.isdecimal() and int(text) > 0:
        return float(text)
    return math.inf


def _text(file: Path | str) -> str:
    try:
        return (ROOT / file).read_text(errors="replace").strip()
    except OSError:
        return ""
