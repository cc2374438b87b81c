"""What the observations leave open, by name.

A pivot that vanishes says that something is not determined, but not what: the null vectors of the normal matrix do.
Problems of up to `WHOLE` kept unknowns are analysed as a whole, by the eigenvectors of the reduced matrix over the
diagonal that it had before elimination;
in larger ones the null vectors of the leading parts that end at vanishing pivots are found by back substitution.
"""

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.reduced import ReducedNormals, reduced_normals
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.openness.limits import MOST_NAMED
from aatri.adjustment.openness.motions import of_motions, open_motions
from aatri.adjustment.openness.open_directions import OpenDirections, described
from aatri.adjustment.openness.unseen_motions import unseen_motions
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float

WHOLE = 2000
"""Up to this many kept unknowns the whole matrix is analysed."""


def vanishing(problem: IndexedProblem, state: State, factored: Factored) -> OpenDirections:
    """What vanishing pivots leave open: eliminated blocks, or else combinations of the kept unknowns."""
    blocks = np.flatnonzero(factored.determined == 0)
    if len(blocks):
        return OpenDirections(0, (), np.zeros((problem.layout.n_kept, 0)), blocks=blocks, exact=True)
    defect, vectors, normals = null_vectors(problem, state, factored)
    unseen = unseen_motions(problem, state) if normals is None else []
    if len(unseen) >= defect:
        return OpenDirections(len(unseen), (of_motions(unseen),), vectors, exact=True)
    diagonal, N = (factored.diagonal, None) if normals is None else (normals.diagonal, normals.N)
    motions, rest = open_motions(problem, state, vectors, diagonal, N)
    texts = (*motions, *(described(problem, vector) for vector in rest.T[:MOST_NAMED]))
    return OpenDirections(defect, texts, vectors, exact=True, more=max(rest.shape[1] - MOST_NAMED, 0))


def null_vectors(problem: IndexedProblem, state: State, factored: Factored) -> tuple[int, Float, ReducedNormals | None]:
    """Number of defects, null vectors in scaled unknowns, (n_kept, k), and the matrix where it is seen as a whole."""
    layout = problem.layout
    if layout.n_kept <= WHOLE:
        normals, free = reduced_normals(problem, state), np.flatnonzero(~layout.fixed)
        scale = np.sqrt(np.where(normals.diagonal[free] > 0, normals.diagonal[free], 1.0))
        values, among_free = np.linalg.eigh(normals.N[np.ix_(free, free)] / np.outer(scale, scale))
        open_ = (values < RANK_TOLERANCE) | (values <= values[0])
        vectors = np.zeros((layout.n_kept, int(open_.sum())))
        vectors[free] = among_free[:, open_]
        return int(open_.sum()), vectors, normals
    if not factored.factor.is_direct:
        return len(factored.weak), _weak_columns(problem, factored), None
    trusted = _without_weak_descendants(problem, factored)
    leading = [_leading_null_vector(problem, factored, k, row) for k, row in trusted]
    return len(factored.weak), np.concatenate(leading, axis=1), None


def _weak_columns(problem: IndexedProblem, factored: Factored) -> Float:
    """Unit vectors of the unknowns with vanishing pivots, where there is no factor for more."""
    vectors = np.zeros((problem.layout.n_kept, len(factored.weak)))
    for i, (k, row) in enumerate(factored.weak):
        vectors[problem.tree.nodes[k].columns[row], i] = 1.0
    return vectors


def _without_weak_descendants(problem: IndexedProblem, factored: Factored) -> list[tuple[int, int]]:
    """Weak pivots below which no other is: what comes after a weak pivot means nothing."""
    weak, spoiled = dict(factored.weak), set()
    for k in weak:
        parent = problem.tree.nodes[k].parent
        while parent >= 0 and parent not in spoiled:
            spoiled.add(parent)
            parent = problem.tree.nodes[parent].parent
    return [(k, row) for k, row in factored.weak if k not in spoiled]


def _leading_null_vector(problem: IndexedProblem, factored: Factored, k: int, row: int) -> Float:
    """Null vector of the unknowns eliminated up to a vanishing pivot."""
    x = np.zeros(problem.layout.n_kept)
    for j in range(k, -1, -1):
        node = problem.tree.nodes[j]
        front = np.concatenate([np.zeros(node.panel), x[node.columns[node.panel :]]])
        panel = factored.factor.panel(j)
        if j == k:
            leading = np.array(panel[: row + 1, :row], order="F")
            part = np.append(np.zeros(row), 1.0)
            if row:
                lapack.backward(leading, part)
            front[: row + 1] = part
        elif node.panel:
            lapack.backward(panel, front)
        x[node.columns[: node.panel]] = front[: node.panel]
    scale = np.where(factored.diagonal > 0, np.sqrt(np.maximum(factored.diagonal, 0.0)), 1.0)
    return np.asarray((x * scale)[:, None])
