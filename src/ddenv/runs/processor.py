"""The machine: its processor's name, how many cores and how much memory this process may use, and which packages it has."""

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


def usable_cores(root: Path = Path("/")) -> int:
    """How many cores this process may use at the same time, at least 1.

    The minimum of its CPU affinity and the limits of its control groups (version 1 and 2) and all groups around them, as in a
    container; a part of a core counts as one. `root` is the folder of the system's files.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    limits = _groups(root, "cpu", ("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us"))
    return max(1, math.ceil(min([cores, *(_share(*" ".join(limit).split()[:2]) for limit in limits)])))


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
    old = ("memory.limit_in_bytes", "memory.usage_in_bytes")
    for limit, used in _groups(root, "memory", ("memory.max", "memory.current"), old):
        yield _bytes(limit), float(used) if used.isdecimal() else 0.0


def _groups(root: Path, controller: str, new: tuple[str, ...], old: tuple[str, ...]) -> Iterator[list[str]]:
    """What the files `new`, or in version 1 `old`, say of each control group that may limit this process: its own and those
    around it. In a container their paths may be those of the host: then the limits are at the top.
    """
    groups = root / "sys/fs/cgroup"
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if controllers and controller not in controllers.split(","):
            continue
        folder = Path(path.lstrip("/"))
        for top in (groups / controllers, groups / controller) if controllers else (groups,):
            for each in (folder, *folder.parents):
                if ".." not in each.parts:
                    yield [_text(top / each / name) for name in (old if controllers else new)]


def _share(quota: str = "", period: str = "") -> float:
    """`quota` of each `period`, both in microseconds, in cores; infinite for no limit."""
    try:
        share = int(quota) / int(period)
    except (ValueError, ZeroDivisionError):
        return math.inf
    return share if share > 0 else math.inf


def _bytes(text: str) -> float:
    return float(text) if text.isdecimal() and int(text) > 0 else math.inf


def _text(file: Path) -> str:
    try:
        return file.read_text(errors="replace").strip()
    except OSError:
        return ""
