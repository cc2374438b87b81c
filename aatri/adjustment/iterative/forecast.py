"""What a problem will take, before the first iteration, and what to do if it is more than there is.

Flops and factor follow from the elimination tree; the fronts in memory at a time from the order in which they are
worked on; rays and eliminated blocks count with what an iteration keeps of them. Python, the block and its observations
are what the process takes already (on Linux; nothing else tells), the index of the rays among it; the arrays of the
result come on top.

| predicted memory | what is done |
|---|---|
| within the limit, beside what the process takes already | factor in memory |
| within the limit without the factor, which the disk has room for | panels of the factor in a file |
| within the limit, not beside what the process takes, and the disk has no room | factor in memory; the log says so |
| more | conjugate gradients, preconditioned by as much of the factor as three quarters of the limit hold |

The limit is `memory_gb`, or a share of the memory of the machine, its container or batch job, or of a cluster's
worker where that has less.
"""

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from aatri.adjustment.elimination.schedule import Schedule
from aatri.adjustment.iterative.preconditioner import piece_within, subtrees_within
from aatri.adjustment.problem import Solver as Solver
from aatri.adjustment.structure.indexed_problem import IndexedProblem, PartlyFactorised
from aatri.adjustment.structure.tree import FrontNode
from aatri.errors import ResourceError, SpecError
from aatri.ids import several
from aatri.machine import memory_bytes
from aatri.progress import Reporter
from aatri.together import MEMORY_OF_WORKER

SHARE = 0.8
"""Share of the machine's memory, and of the free disk, that may be used."""

CHEAP = 0.1
"""Share of the limit that a factor may take while the tests of groups, a third of whose memory it is, use it."""

BLOCK_BYTES = 350
"""Of an eliminated block: factor, right-hand side, own normal matrix, and its values before and after a step."""

RAY_BYTES = 50
"""Of a ray: its measurement and camera in the order of the rays, beside the index."""


@dataclass(frozen=True)
class Forecast:
    """Predicted work and memory."""

    flops: float
    """Of one factorisation."""
    factor_bytes: float
    fronts_bytes: float
    rays_bytes: float
    """Factor; fronts in memory at a time, at most; rays and eliminated blocks with their index."""
    index_bytes: float = 0.0
    """Of the index, which is in memory before the first iteration and part of `rays_bytes`."""

    def memory_bytes(self, spill: bool = False) -> float:
        """Memory of an iteration, with the factor or without."""
        return self.fronts_bytes + self.rays_bytes + (0 if spill else self.factor_bytes)


def forecast(problem: IndexedProblem) -> Forecast:
    """Predict work and memory of one iteration."""
    rays = problem.rays
    rays_bytes, index_bytes = BLOCK_BYTES * len(problem.block_free), 0
    if rays is not None:
        arrays = (rays.rows, rays.ray_start, rays.block, rays.parts.vertex, rays.loc)
        index_bytes = sum(a.nbytes for a in arrays)
        rays_bytes += index_bytes + RAY_BYTES * len(rays.rows)
    return Forecast(problem.tree.flops, problem.tree.factor_bytes, _fronts_bytes(problem), rays_bytes, index_bytes)


def _fronts_bytes(problem: IndexedProblem) -> float:
    """Most that fronts take at a time; of subtrees worked on in parallel, that of the largest at once."""
    nodes = problem.tree.nodes
    schedule = Schedule.of(problem)
    if not schedule.subtrees:
        return _most(nodes, range(len(nodes)))[0]
    of_subtrees = [_most(nodes, members) for members in schedule.subtrees]
    waiting = sum(left for _, left in of_subtrees)
    below = waiting + sum(8.0 * nodes[k].size ** 2 for k in schedule.early)
    largest = sorted((most - left for most, left in of_subtrees), reverse=True)[: problem.threads]
    above = waiting + _most(nodes, [k for level in schedule.levels for k in level])[0]
    return max(below + sum(largest), above)


def _most(nodes: Sequence[FrontNode], members: Sequence[int]) -> tuple[float, float]:
    """Most bytes of the fronts while some nodes are worked on in their order, and what is left in the end."""
    most = in_memory = 0.0
    inside = set(members)
    for k in members:
        in_memory += 8.0 * nodes[k].size ** 2
        most = max(most, in_memory)
        in_memory -= sum(8.0 * nodes[c].size ** 2 for c in nodes[k].children if c in inside)
        if nodes[k].size == nodes[k].panel:
            in_memory -= 8.0 * nodes[k].size ** 2
    return most, in_memory


def memory_limit(memory_gb: float | None) -> float:
    """Limit in bytes: as given, or a share of what the machine or the worker has; infinite where that is not known."""
    if memory_gb is not None:
        return 1e9 * memory_gb
    of_worker = float(os.environ.get(MEMORY_OF_WORKER, "inf"))
    return SHARE * min(memory_bytes(), of_worker)


def resident_bytes() -> int:
    """What the process has in memory now; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, AttributeError, ValueError):
        return 0


def fits_in_memory(problem: IndexedProblem) -> bool:
    """Whether an iteration with its factor has room beside what the process takes already."""
    expected = forecast(problem)
    return expected.memory_bytes() + _beside(expected) <= memory_limit(problem.settings.memory_gb)


def is_cheap(problem: IndexedProblem) -> bool:
    """Whether a factor may be kept for what comes after the adjustment: it is in a file, or small beside the limit."""
    return problem.spill or problem.tree.factor_bytes <= CHEAP * memory_limit(problem.settings.memory_gb)


def _beside(expected: Forecast) -> float:
    """Bytes that the process takes beside what the forecast counts."""
    return max(resident_bytes() - expected.index_bytes, 0.0)


def within_limit(problem: IndexedProblem, reporter: Reporter) -> IndexedProblem:
    """Choose how to solve a problem by its settings, and announce what it will take.

    Raises
    ------
    ResourceError
        If the problem is beyond the limit, and exact constraints or what is demanded need its factor.
    """
    solver = problem.settings.solver
    expected, limit = forecast(problem), memory_limit(problem.settings.memory_gb)
    _announce(problem, expected, reporter)
    fits = expected.memory_bytes() <= limit
    disk_holds = expected.factor_bytes <= SHARE * shutil.disk_usage(tempfile.gettempdir()).free
    fits_on_disk = expected.memory_bytes(spill=True) <= limit and disk_holds
    if solver == "direct" or (solver == "auto" and (fits or fits_on_disk)):
        beside = _beside(expected)
        spill = not fits or (expected.memory_bytes() + beside > limit and disk_holds)
        if not fits or expected.memory_bytes() + beside > limit:
            of_process = f" and the {beside / 1e9:.3g} GB that the process takes already" if beside else ""
            file = tempfile.gettempdir()
            place = f"goes to {file}" if spill else f"stays in memory, for {file} has no room for it"
            predicted = f"the prediction{of_process} {'are' if of_process else 'is'} above the limit"
            reporter.log(f"{predicted} of {limit / 1e9:.3g} GB: the factor {place}")
        return replace(problem, spill=spill)
    if problem.constraints:
        _refuse("exact constraints", "observe them with small standard deviations", expected, limit, solver)
    if problem.settings.demands:
        _refuse(problem.settings.demands, "do not ask for them", expected, limit, solver)
    reason = "" if solver != "auto" else f"above the limit of {limit / 1e9:.3g} GB even with the factor on disk: "
    reporter.log(f"{reason}conjugate gradients; there will be no standard deviations")
    subtrees, piece = subtrees_within(problem.tree, limit / 2), piece_within(problem.layout.n_kept, limit / 4)
    return replace(problem, iterative=PartlyFactorised(subtrees, piece))


def _announce(problem: IndexedProblem, expected: Forecast, reporter: Reporter) -> None:
    tree = problem.tree
    reporter.log(
        f"{problem.layout.n_kept} unknowns beside the eliminated ones in {several(len(tree.nodes), 'front')} of at "
        f"most {tree.largest_front}; factorisation {expected.flops / 1e9:.3g} Gflop"
    )
    factor, fronts, rays = expected.factor_bytes / 1e6, expected.fronts_bytes / 1e6, expected.rays_bytes / 1e6
    reporter.log(
        f"memory predicted: {expected.memory_bytes() / 1e6:.0f} MB (factor {factor:.0f}, fronts {fronts:.0f}, "
        f"rays {rays:.0f})"
    )


def _refuse(what: str, otherwise: str, expected: Forecast, limit: float, solver: Solver) -> None:
    if solver == "conjugate_gradients":
        raise SpecError(f"{what} need a factor: not by conjugate gradients", remedy="solver: auto")
    raise ResourceError(
        f"{what} need a factor: {expected.memory_bytes(spill=True) / 1e9:.3g} GB of memory and "
        f"{expected.factor_bytes / 1e9:.3g} GB on disk; the limit is {limit / 1e9:.3g} GB",
        remedy=f"{otherwise}, or raise memory_gb",
    )
