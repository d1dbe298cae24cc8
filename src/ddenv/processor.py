"""The processor: its name, and how many of its cores this process may use."""

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
    return max(1, math.ceil(min([cores, *_limits(root)])))


def _limits(root: Path) -> Iterator[float]:
    """The limit, in cores, of each control group of this process."""
    groups = root / "sys/fs/cgroup"
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if not controllers:
            yield from (_share(*_text(each / "cpu.max").split()[:2]) for each in _around(groups, path))
        elif "cpu" in controllers.split(","):
            for top in (groups / controllers, groups / "cpu"):
                for each in _around(top, path):
                    yield _share(_text(each / "cpu.cfs_quota_us"), _text(each / "cpu.cfs_period_us"))


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


def _text(file: Path) -> str:
    try:
        return file.read_text(errors="replace").strip()
    except OSError:
        return ""
