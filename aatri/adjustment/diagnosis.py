"""What the observations leave open, by name.

A pivot that vanishes says that something is not determined, but not what: the null vectors of the normal matrix do.
Problems of up to `WHOLE` kept unknowns are analysed as a whole, by the eigenvectors of the reduced matrix over the
diagonal that it had before elimination;
in larger ones the null vectors of the leading parts that end at vanishing pivots are found by back substitution.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.reduced import ReducedNormals, reduced_normals
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.open_similarity import open_motions
from aatri.adjustment.open_whole import open_motions_of_all
from aatri.adjustment.structure.indexed_problem import Factored, IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float
from aatri.errors import GeometryError

LARGE = 0.2
"""What is larger than this part of the largest is named."""

MOST_DESCRIBED = 7
"""So many open directions at most are described."""

WHOLE = 2000
"""Up to this many kept unknowns the whole matrix is analysed."""


def refuse_undetermined(problem: IndexedProblem, state: State, factored: Factored) -> None:
    """Raise the error that names what is not determined.

    Raises
    ------
    GeometryError
    """
    _refuse_blocks(problem, factored)
    defect, vectors, normals = null_vectors(problem, state, factored)
    whole = open_motions_of_all(problem, state) if normals is None else []
    if len(whole) >= defect:
        names = ", ".join(dict.fromkeys(whole))
        raise GeometryError(f"the observations leave {len(whole)} unknown(s) open: {names} of the whole block")
    diagonal, N = (factored.diagonal, None) if normals is None else (normals.diagonal, normals.N)
    motions, rest = open_motions(problem, state, vectors, diagonal, N)
    texts = [*motions, *(described(problem, vector) for vector in rest.T[:MOST_DESCRIBED])]
    left = max(rest.shape[1] - MOST_DESCRIBED, 0)
    more = f" and {left} more" if left else ""
    raise GeometryError(f"the observations leave {defect} unknown(s) open: {'; '.join(texts)}{more}")


def _refuse_blocks(problem: IndexedProblem, factored: Factored) -> None:
    weak = np.flatnonzero(factored.determined == 0)
    if not len(weak) or problem.rays is None:
        return
    group = next(u for u in problem.unknowns if u.eliminated)
    names = [f"{group.name} {group.ids[k]}" for k in np.sort(problem.rays.block[weak])]
    more = f" and {len(names) - 10} more" if len(names) > 10 else ""
    raise GeometryError(
        f"{len(names)} of {len(group.ids)} are not determined by their observations: {', '.join(names[:10])}{more}",
        remedy="give them more rays or known coordinates, or leave them out",
    )


def null_vectors(problem: IndexedProblem, state: State, factored: Factored) -> tuple[int, Float, ReducedNormals | None]:
    """Number of defects, null vectors in scaled unknowns, (n_kept, k), and the matrix where it is seen as a whole."""
    layout = problem.layout
    if layout.n_kept <= WHOLE:
        normals, free = reduced_normals(problem, state), np.flatnonzero(~layout.held)
        scale = np.sqrt(np.where(normals.diagonal[free] > 0, normals.diagonal[free], 1.0))
        values, among_free = np.linalg.eigh(normals.N[np.ix_(free, free)] / np.outer(scale, scale))
        open_ = (values < RANK_TOLERANCE) | (values <= values[0])
        vectors = np.zeros((layout.n_kept, int(open_.sum())))
        vectors[free] = among_free[:, open_]
        return int(open_.sum()), vectors, normals
    if not factored.factor.whole:
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


def described(problem: IndexedProblem, vector: Float) -> str:
    """The unknowns that take part most in a null vector: of each label up to four, or the one with most and a count.

    A label takes part where one of its unknowns does, or all blocks together: what many blocks share, as the heights of
    all images where the principal distance is open, is small in each of them.
    """
    shares: list[tuple[float, float, str]] = []
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        size = np.where(columns >= 0, np.abs(vector[np.maximum(columns, 0)]), 0.0)
        for scalar in range(u.size):
            own = size[:, scalar]
            total, most = float((own**2).sum()), float(own.max(initial=0.0))
            if total > 0:
                large = np.argsort(-own, kind="stable")[: int((own > LARGE * most).sum())].tolist()
                named = " with ".join(u.label(k, scalar) for k in large)
                many = f"{u.label(large[0], scalar)} and {len(large) - 1} more"
                shares.append((total, most, named if len(large) <= 4 else many))
    shares.sort(key=lambda share: -share[0])
    largest = max((own for _, own, _ in shares), default=0.0)
    members = [name for total, own, name in shares if total > LARGE**2 * shares[0][0] or own > LARGE * largest][:5]
    return " with ".join(members) or "unknowns of no group"
