"""The machine: its processor's name, and how many cores and how much memory this process may use."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path


def name(root: Path = Path("/")) -> str:
    """The processor's model; its architecture where the model is unknown. `root` is the folder of the system's files."""
    for line in _text(root / "proc/cpuinfo").splitlines() if sys.platform == "linux" else ():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model", "Hardware"):
            return " ".join(value.split())
    return platform.processor() or platform.machine()


def usable_cores(root: Path = Path("/")) -> int:
    """How many cores this process may use at the same time, at least 1.

    The minimum of its CPU affinity and the limits of its control groups (version 1 and 2) and all groups around them, as in a
    container; a part of a core counts as one. `root` is the folder of the system's files.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    shares = (
        _share(_text(group / "cpu.cfs_quota_us"), _text(group / "cpu.cfs_period_us"))
        if old
        else _share(*_text(group / "cpu.max").split()[:2])
        for group, old in _groups(root, "cpu")
    )
    return max(1, math.ceil(min([cores, *shares])))


def usable_memory(root: Path = Path("/")) -> float:
    """How much memory all that runs here may use, bytes: the machine's, or less where a control group allows less. Infinite where
    that is not known. `root` as for `usable_cores`.
    """
    return min([_meminfo(root, "MemTotal"), *(limit for limit, _ in _memory_groups(root))])


def free_memory(root: Path = Path("/")) -> float:
    """How much of that is free now, bytes; infinite where that is not known."""
    left = [limit - used for limit, used in _memory_groups(root) if math.isfinite(limit)]
    return max(0.0, min([_meminfo(root, "MemAvailable"), *left]))


def _meminfo(root: Path, key: str) -> float:
    rows = (line.split() for line in _text(root / "proc/meminfo").splitlines())
    return 1024 * next((_bytes(row[1]) for row in rows if len(row) > 1 and row[0] == f"{key}:"), math.inf)


def _memory_groups(root: Path) -> Iterator[tuple[float, float]]:
    """The limit of each control group of this process, and what it uses, bytes."""
    for group, old in _groups(root, "memory"):
        limit, used = ("memory.limit_in_bytes", "memory.usage_in_bytes") if old else ("memory.max", "memory.current")
        in_use = _text(group / used)
        yield _bytes(_text(group / limit)), float(in_use) if in_use.isdecimal() else 0.0


def _groups(root: Path, controller: str) -> Iterator[tuple[Path, bool]]:
    """The folders of this process's control groups that may limit `controller`, and whether they are of version 1."""
    groups = root / "sys/fs/cgroup"
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if not controllers:
            yield from ((each, False) for each in _around(groups, path))
        elif controller in controllers.split(","):
            for top in (groups / controllers, groups / controller):
                yield from ((each, True) for each in _around(top, path))


def _around(top: Path, path: str) -> Iterator[Path]:
    """The folder of a group and those of the groups around it. In a container its path may be that of the host: `top` is there."""
    folder = Path(path.lstrip("/"))
    return (top / each for each in (folder, *folder.parents) if ".." not in each.parts)


def _share(quota: str = "", period: str = "") -> float:
    """`quota` of each `period`, both in microseconds, in cores; infinite for no limit."""
    try:
        share = int(quota) / int(period)
    except (ValueError, ZeroDivisionError):
        return math.inf
    return share if share > 0 else math.inf


def _bytes(text: str) -> float:
    """A number of bytes, or infinite for none."""
    return float(text) if text.isdecimal() and int(text) > 0 else math.inf


def _text(file: Path) -> str:
    try:
        return file.read_text(errors="replace").strip()
    except OSError:
        return ""
