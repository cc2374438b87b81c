"""What this process may use of its machine: processors and memory, within the limits of its container or batch job.

Docker, SLURM and systemd limit what they run by *control groups* of Linux (cgroups(7)). `/proc/self/cgroup` names the
group of a process in each hierarchy; a limit of any group above it holds as well. Version 1 has a hierarchy for each
resource (`memory/GROUP/memory.limit_in_bytes`, `cpu/GROUP/cpu.cfs_quota_us`), version 2 one for all
(`GROUP/memory.max`, `GROUP/cpu.max`). Within a container the group may be named as its host sees it, while its files
are those of the top: so both are asked.
"""

import contextlib
import math
import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

MOUNTED, MEMBERSHIP = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def memory_bytes() -> float:
    """Memory of the machine, or of the container or batch job, bytes; infinite where the system does not tell."""
    machine = math.inf
    with contextlib.suppress(OSError, ValueError, AttributeError):
        machine = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    files = [folder / name for folder in _groups("memory") for name in ("memory.limit_in_bytes", "memory.max")]
    return min([machine, *(limit for file in files for limit in _numbers(file))])


@lru_cache(maxsize=1)
def processors() -> int:
    """Processors that this process may use: those it is bound to, at most its share of processor time, rounded up."""
    most = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for folder in _groups("cpu"):
        shares = [_numbers(folder / "cpu.cfs_quota_us") + _numbers(folder / "cpu.cfs_period_us")]
        shares.append(_numbers(folder / "cpu.max"))
        limited = [share for share in shares if len(share) == 2 and share[0] > 0]  # -1 in version 1: no limit
        most = min([most, *(math.ceil(quota / period) for quota, period in limited)])
    return max(most, 1)


def _numbers(file: Path) -> list[float]:
    """Numbers in a file of a group; none where it is missing or has a word (`max`), which is no limit."""
    with contextlib.suppress(OSError, ValueError):
        return [float(int(word)) for word in file.read_text(encoding="ascii").split()]
    return []


def _groups(resource: str) -> Iterator[Path]:
    """Folders of the groups that limit this process, its own first."""
    try:
        lines = MEMBERSHIP.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return  # not Linux
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")
        if not group.startswith("/") or (controllers and resource not in controllers.split(",")):
            continue
        top, names = MOUNTED / (resource if controllers else ""), [name for name in group.split("/") if name]
        # seen from a container a group beside its own begins with `..`: it leads out of what is mounted
        inside = Path(*(name for name in names if name != ".."))
        for above in (inside, *inside.parents):
            yield top / above
