"""Orders of elimination of a bundle: the textbook's half bandwidth, and what is found in this block."""

import numpy as np

from aatri.adjustment.structure.bandwidth import OrderingFigures, ordering_figures
from aatri.adjustment.structure.index_problem import Ordering
from aatri.artifacts.solution import Orderings
from aatri.ids import several
from aatri.observations.poses import POSE
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.progress import Reporter

CHAINS: tuple[Ordering, ...] = ("across_strips", "along_strips")


def report_orderings(done: AdjustedBlock, used: Ordering, reporter: Reporter) -> Orderings | None:
    """Compare the order in use with those of the textbook, in the log and as a table; None without images."""
    problem, numbering = done.result.adjusted.problem, done.inputs.numbering
    if numbering is None:
        return None
    position = problem.layout.position.copy()
    vertex = problem.layout.vertex[POSE]
    position[vertex[vertex >= 0]] = numbering.place[vertex >= 0]
    figures_of_all = ordering_figures(problem, used, [name for name in CHAINS if name != used], position)
    textbook = numbering.textbook
    if textbook:
        n, N = numbering.images, numbering.strips
        better = "across" if n > 2 * N - 1 else "along"
        reporter.log(
            f"{several(N, 'parallel strip')} of up to {several(n, 'image')}; the textbook "
            f"numbers {better} the strips, n {n}, 2N - 1 {2 * N - 1}"
        )
    for k, figures in enumerate(figures_of_all):
        one_front = len(problem.tree.nodes) == 1 and k == 0
        reporter.log(_described(figures, textbook.get(figures.ordering), one_front))
    return Orderings(
        ordering=np.array([f.ordering for f in figures_of_all]),
        used=np.arange(len(figures_of_all)) == 0,
        textbook_images=np.array([textbook.get(f.ordering, -1) for f in figures_of_all], dtype=np.int32),
        images=np.array([f.half_bandwidth for f in figures_of_all], dtype=np.int32),
        unknowns=np.array([f.half_bandwidth_unknowns for f in figures_of_all], dtype=np.int64),
        border=np.array([f.border_unknowns for f in figures_of_all], dtype=np.int64),
        stored=np.array([f.stored for f in figures_of_all], dtype=np.int64),
        gflop=np.array([1e-9 * f.flops for f in figures_of_all]),
    )


def _described(f: OrderingFigures, textbook: int | None, one_front: bool) -> str:
    expected = f" (textbook {textbook})" if textbook is not None else ""
    band = f"half bandwidth {f.half_bandwidth} images{expected}, {f.half_bandwidth_unknowns} unknowns, "
    return (
        f"{f.ordering}{', one front' if one_front else ''}: {band if f.ordering in CHAINS else ''}"
        f"border {f.border_unknowns}, {f.stored:,} elements stored, {f.flops / 1e9:.3g} Gflop"
    )
