"""How many cores a process may use: its affinity, and the limits of its control groups."""

import os

import pytest

from ddenv import processor

VERSION_1 = "4:cpu,cpuacct:/docker/a\n3:memory:/docker/a"


@pytest.fixture
def usable(tmp_path, monkeypatch):
    """A function from the process's control group and the files of limits to the cores it may use, on a machine with 64."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)

    def cores(group: str = "", limits: dict[str, str] | None = None) -> int:
        for name, text in {"proc/self/cgroup": group, **(limits or {})}.items():
            file = tmp_path / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        return processor.usable_cores(tmp_path)

    return cores


def test_without_limits_all_cores_of_the_affinity(usable, monkeypatch, tmp_path):
    assert usable() == 64
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5})
    assert usable() == 2
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processor.usable_cores(tmp_path / "nothing") == 1


@pytest.mark.parametrize(
    ("text", "cores"),
    [("max 100000", 64), ("200000 100000", 2), ("150000 100000", 2), ("5000 100000", 1), ("", 64), ("what 0", 64)],
)
def test_the_limit_of_a_container(usable, text, cores):
    assert usable("0::/", {"sys/fs/cgroup/cpu.max": text}) == cores


def test_the_lowest_limit_of_all_groups_around_counts(usable):
    limits = {"sys/fs/cgroup/a/cpu.max": "300000 100000", "sys/fs/cgroup/a/b/c/cpu.max": "max 100000"}
    assert usable("0::/a/b/c", limits) == 3


@pytest.mark.parametrize("folder", ["cpu,cpuacct/docker/a", "cpu,cpuacct", "cpu"])
@pytest.mark.parametrize(("quota", "cores"), [("-1", 64), ("250000", 3), ("1000", 1)])
def test_the_limit_of_a_group_of_version_1(usable, folder, quota, cores):
    place = f"sys/fs/cgroup/{folder}"
    limits = {f"{place}/cpu.cfs_quota_us": quota, f"{place}/cpu.cfs_period_us": "100000"}
    assert usable(VERSION_1, limits) == cores


def test_on_this_machine_there_are_cores_and_a_name():
    assert 1 <= processor.usable_cores() <= (os.cpu_count() or 1)
    assert processor.name() == " ".join(processor.name().split())
