"""Limits of control groups, as files of a made-up machine; what the kernel writes into them is in cgroups(7)."""

import math
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from aatri import machine

Groups = Callable[..., None]
UNLIMITED_V1 = "9223372036854771712"
"""What version 1 shows where nothing is limited: the largest int64 in whole pages."""


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Groups:
    """Write the membership of this process, and files of groups by their path."""

    def make(membership: str, **files: str) -> None:
        (tmp_path / "membership").write_text(membership, encoding="utf-8")
        for name, text in files.items():
            path = tmp_path / "mounted" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n", encoding="ascii")

    monkeypatch.setattr(machine, "MEMBERSHIP", tmp_path / "membership")
    monkeypatch.setattr(machine, "MOUNTED", tmp_path / "mounted")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr(os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 25_000_000}.__getitem__)
    machine.processors.cache_clear()
    return make


@pytest.fixture(autouse=True)
def _as_before() -> object:
    """Other tests ask the true machine."""
    yield
    machine.processors.cache_clear()


def test_without_groups_the_machine_is_the_limit(groups: Groups) -> None:
    machine.MEMBERSHIP.unlink(missing_ok=True)
    assert (machine.memory_bytes(), machine.processors()) == (4096 * 25_000_000, 64)


def test_a_batch_job_has_the_least_of_its_own_group_and_those_above(groups: Groups) -> None:
    files = {
        "jobs/7/step/memory.max": "max",
        "jobs/7/memory.max": "6000000000",
        "jobs/memory.max": "50000000000",
        "jobs/7/step/cpu.max": "max 100000",
        "jobs/7/cpu.max": "350000 100000",
    }
    groups("0::/jobs/7/step\n", **files)
    assert (machine.memory_bytes(), machine.processors()) == (6e9, 4)


def test_a_container_of_version_1_sees_its_limits_at_the_top(groups: Groups) -> None:
    """Docker mounts the container's own group at the top, and names it as the host does."""
    files = {
        "memory/memory.limit_in_bytes": "8589934592",
        "cpu/cpu.cfs_quota_us": "150000",
        "cpu/cpu.cfs_period_us": "100000",
    }
    groups("9:name=systemd:/docker/ab\n4:memory:/docker/ab\n2:cpu,cpuacct:/docker/ab\n", **files)
    assert (machine.memory_bytes(), machine.processors()) == (8589934592.0, 2)


def test_groups_without_limits_limit_nothing(groups: Groups) -> None:
    files = {
        "memory/a/memory.limit_in_bytes": UNLIMITED_V1,
        "cpu/a/cpu.cfs_quota_us": "-1",
        "cpu/a/cpu.cfs_period_us": "100000",
        "memory.max": "6000000000",
    }
    groups("4:memory:/a\n1:cpu:/a\n", **files)
    assert (machine.memory_bytes(), machine.processors()) == (4096 * 25_000_000, 64)


@pytest.mark.parametrize("membership", ["0::\n1:memory:\n", "0::/../../jobs\n1:memory:/..\n", "no groups\n\n"])
def test_a_group_without_a_name_or_outside_what_is_mounted_ends_nothing(groups: Groups, membership: str) -> None:
    """The files above those that are mounted are of others."""
    groups(membership, **{"jobs/memory.max": "6000000000", "../memory.max": "1", "../cpu.max": "100000 100000"})
    of_jobs = 6e9 if "jobs" in membership else 4096 * 25_000_000
    assert (machine.memory_bytes(), machine.processors()) == (of_jobs, 64)


def test_a_system_that_does_not_tell_its_memory_has_no_limit(groups: Groups, monkeypatch: pytest.MonkeyPatch) -> None:
    groups("")
    monkeypatch.setattr(os, "sysconf", {}.__getitem__)
    monkeypatch.setattr(os, "sysconf", lambda name: int("none"))  # ValueError, as for a name that is not known
    assert math.isinf(machine.memory_bytes())
