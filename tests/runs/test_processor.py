"""How many cores and how much memory a process may use: its affinity, and the limits of its control
groups.
"""

import math
import os

import pytest

from ddenv.runs import processor

VERSION_1 = "4:cpu,cpuacct:/docker/a\n3:memory:/docker/a"


@pytest.fixture
def usable(tmp_path, monkeypatch):
    """A function from the process's control group and the files of limits to the cores it may use,
    on a machine with 64.
    """
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr(processor, "ROOT", tmp_path)

    def cores(group: str = "", limits: dict[str, str] | None = None) -> int:
        for name, text in {"proc/self/cgroup": group, **(limits or {})}.items():
            file = tmp_path / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        return processor.usable_cores()

    return cores


def test_without_limits_all_cores_of_the_affinity(usable, monkeypatch, tmp_path):
    assert usable() == 64
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5})
    assert usable() == 2
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    monkeypatch.setattr(processor, "ROOT", tmp_path / "nothing")
    assert processor.usable_cores() == 1
    assert processor.usable_memory() == processor.free_memory() == math.inf


@pytest.mark.parametrize(
    ("text", "cores"),
    [
        ("max 100000", 64),
        ("200000 100000", 2),
        ("150000 100000", 2),
        ("5000 100000", 1),
        ("", 64),
        ("what 0", 64),
    ],
)
def test_the_lowest_limit_of_all_groups_around_counts(usable, text, cores):
    assert usable("0::/", {"sys/fs/cgroup/cpu.max": text}) == cores
    inner = {
        "sys/fs/cgroup/a/cpu.max": "300000 100000",
        "sys/fs/cgroup/a/b/c/cpu.max": "max 100000",
    }
    assert usable("0::/a/b/c", inner) == min(3, cores)


@pytest.mark.parametrize("folder", ["cpu,cpuacct/docker/a", "cpu,cpuacct", "cpu"])
@pytest.mark.parametrize(("quota", "cores"), [("-1", 64), ("250000", 3), ("1000", 1)])
def test_the_limit_of_a_group_of_version_1(usable, folder, quota, cores):
    place = f"sys/fs/cgroup/{folder}"
    limits = {f"{place}/cpu.cfs_quota_us": quota, f"{place}/cpu.cfs_period_us": "100000"}
    assert usable(VERSION_1, limits) == cores


def test_on_this_machine_there_are_cores_and_a_name():
    assert 1 <= processor.usable_cores() <= (os.cpu_count() or 1)
    assert processor.name() == " ".join(processor.name().split())


MEMORY = "MemTotal:  16000 kB\nMemFree:  1 kB\nMemAvailable:   9000 kB\nHugePages_Total:       0"


@pytest.mark.parametrize(
    ("group", "limits", "found"),
    [
        ("0::/", {}, (16000, 9000)),
        (
            "0::/a/b",
            {"a/memory.max": "4096000", "a/memory.current": "1024000", "a/b/memory.max": "max"},
            (4000, 3000),
        ),
        ("0::/", {"memory.max": "99999999999", "memory.current": "1"}, (16000, 9000)),
        (
            VERSION_1,
            {"memory/memory.limit_in_bytes": "2048000", "memory/memory.usage_in_bytes": "4096000"},
            (2000, 0),
        ),
    ],
)
def test_the_memory_is_that_of_the_smallest_group(usable, tmp_path, group, limits, found):
    usable(
        group,
        {"proc/meminfo": MEMORY} | {f"sys/fs/cgroup/{name}": text for name, text in limits.items()},
    )
    assert (processor.usable_memory(), processor.free_memory()) == tuple(1024 * kb for kb in found)
