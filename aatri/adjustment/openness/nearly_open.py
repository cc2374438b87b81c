"""What a solution leaves nearly open: seen after the iteration, from the last factor.

A factorisation passes a rank defect that rounding hides: no pivot vanishes, and what comes out is arbitrary along some
combination of unknowns. With the covariance Q and the diagonal N_ii of A'A before elimination an unknown is open if

    Q_ii N_ii > 1e12    (no digit that the observations give is left of it), or
    sqrt(Q_ii) > limit  (`Unknowns.implausible`, given by the caller: the flying height, 1 rad ...)

The directions that can do so are the leading eigenvectors u of D Q D, D = diag(sqrt(N_ii)), found by some steps of
subspace iteration with the factor: two solves for all columns together. Q_ii N_ii >= sum of lambda u_i^2, and nearly
equal where it is large. A block by itself is found by its own 3x3 matrix. Most problems are far from all this, which
one solve tells: with random orthonormal columns X the largest eigenvalue is at most |D Q D X| / |u'X|, and |u'X|^2 is
less than `UNLIKELY` of its mean once in 1e15 times.

A direction within one block (a single image, a single point) says that this block is weak: it is set aside. Any other
is a weakness of the whole: it is refused, and the combination named. A tenth of the limits is worth a warning.

Source: Golub & Van Loan, Matrix Computations, 8.2 (subspace iteration).
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.elimination.backsolve import solve_columns
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.openness.limits import (
    ALONE,
    MOST_NAMED,
    MOTION_IF_NEARLY,
    MOTION_IF_WEAK,
    OPEN,
    SAME_DIRECTION,
    UNLIKELY,
    WARNED,
)
from aatri.adjustment.openness.motions import open_motions
from aatri.adjustment.openness.open_directions import OpenCombination, OpenDirections, described
from aatri.adjustment.openness.unseen_motions import fit_of_datum
from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.adjustment.statistics.limits import ALARM
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.threads import one_blas_thread
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int

COLUMNS = 8
"""Directions looked for at once: a free datum leaves seven open."""

STEPS = 2
"""Multiplications by the covariance: the first brings out what is open by orders of magnitude."""


def nearly_open(problem: IndexedProblem, factored: Factored, state: State, datum_scale: float = 1.0) -> OpenDirections:
    """Look for open directions at the state of a factorisation without damping.

    `datum_scale` is by how much smaller standard deviations of the unknowns are than stated: see `loosely_held`.
    """
    with one_blas_thread():  # a few columns are not worth a second thread
        U, excess = _directions(problem, factored, datum_scale)
    vertex_of = np.repeat(np.arange(len(problem.layout.size)), problem.layout.size)
    vertices: list[int] = []
    single = np.zeros(len(excess), dtype=bool)
    for k, u in enumerate(U.T):
        share = np.bincount(vertex_of, u**2, minlength=len(problem.layout.size))
        single[k] = excess[k] <= 1 or share.max() <= ALONE or len(share) == 1
        if not single[k]:
            vertices.append(int(share.argmax()))

    def named(chosen: Bool) -> tuple[OpenCombination, ...]:
        motions, rest = open_motions(problem, state, U[:, chosen], factored.diagonal, common=MOTION_IF_NEARLY)
        others = (described(problem, u) for u in (rest.T if motions else U[:, chosen].T))
        return (*motions, *others)

    texts, nearly = named(single & (excess > 1)), named(single & (excess <= 1))
    more = max(len(texts) - MOST_NAMED, 0)
    vertices_open, blocks = np.unique(np.array(vertices, dtype=np.int64)), _weak_blocks(problem, factored)
    directions = U[:, single & (excess > 1)]
    return OpenDirections(directions.shape[1], texts[:MOST_NAMED], directions, vertices_open, blocks, nearly, more=more)


def loosely_held(problem: IndexedProblem, factored: Factored, state: State, weak: OpenDirections) -> OpenDirections:
    """What is nearly open, less motions of the whole block that only the size of stated sigmas leaves open.

    Rays do not see them, so that their covariance is that of the observations that the datum rests on, and is smaller
    with it: by the square of their sigma0 at most, divided by the low end of the interval of chance. What is within the
    limits with that scale has the right geometry: it is told, and not refused.
    """
    if not weak.texts or not all(one.of_whole for one in weak.texts):
        return weak
    sigma0, redundancy = fit_of_datum(problem, state)
    scale = sigma0 / sigma0_interval(redundancy, ALARM)[0] if redundancy > 0 else 1.0
    if not scale < 1.0:
        return weak
    left = nearly_open(problem, factored, state, scale)
    if left.texts or len(left.vertices) or len(left.blocks):
        return weak
    fit = f"the observations that fix it fit to {sigma0:.2g} of their standard deviations: state smaller ones"
    texts = (replace(one, text=f"{one.text}; {fit}") for one in weak.texts)
    return replace(left, nearly=(*texts, *left.nearly))


def _directions(problem: IndexedProblem, factored: Factored, datum_scale: float) -> tuple[Float, Float]:
    """Directions (n_kept, k) in unknowns times D that are open or nearly so, and what they have of the limits, (k,)."""
    limit, bare = _limits(problem) / datum_scale, np.where(factored.diagonal > 0, factored.diagonal, 1.0)
    D = np.sqrt(bare)
    # the largest eigenvalue with which nothing is open, nor nearly so
    harmless = min(WARNED * OPEN, WARNED**2 * float((bare * limit**2).min(initial=np.inf)))
    values, U = leading(problem, factored, D, harmless)
    excess = (values * U**2).max(axis=0, initial=0.0) / OPEN
    # in standard deviations: the limit of the ratio is one of variances
    far = np.sqrt((values * U**2 / (bare * limit**2)[:, None]).max(axis=0, initial=0.0))
    U, excess, beyond = U[:, excess > WARNED], excess[excess > WARNED], bool((far > WARNED).any())
    if beyond:
        # what is large in its own unit need not stand out of D Q D: looked for in units of the limits, seen in all
        values, V = leading(problem, factored, 1.0 / limit, 0.0)
        far = np.sqrt((values * V**2).max(axis=0, initial=0.0))
        V, far = V[:, far > WARNED], far[far > WARNED]
        V = D[:, None] * solve_columns(problem, factored, V / limit[:, None])
        V /= np.linalg.norm(V, axis=0)
        others = (np.abs(V.T @ U) < SAME_DIRECTION).all(axis=0) if V.shape[1] else np.ones(U.shape[1], dtype=bool)
        U, excess = np.concatenate([V, U[:, others]], axis=1), np.concatenate([far, excess[others]])
    return U, excess


def least_certain(problem: IndexedProblem, factored: Factored, state: State) -> str:
    """The direction that a solution determines least, against what its unknowns would be by themselves."""
    D = np.sqrt(np.where(factored.diagonal > 0, factored.diagonal, 1.0))
    with one_blas_thread():
        U = leading(problem, factored, D, 0.0)[1][:, :1]
    motions, rest = open_motions(problem, state, U, factored.diagonal, common=MOTION_IF_WEAK)
    return "; ".join(map(str, [*motions, *(described(problem, u) for u in rest.T)]))


def leading(problem: IndexedProblem, factored: Factored, D: Float, harmless: float) -> tuple[Float, Float]:
    """Leading eigenvalues and vectors of D Q D, with Q the cofactors of the kept unknowns.

    Parameters
    ----------
    D : (n_kept,) float64
        Inverse units of the unknowns, or the roots of their diagonal of the normal matrix.
    harmless : float
        None are returned where all eigenvalues are below it; of D Q D, without unit.

    Returns
    -------
    values : (k,) float64
        The largest first.
    vectors : (n_kept, k) float64
    """
    used = ~problem.layout.fixed & (factored.diagonal > 0) & (D > 0)
    scale = np.where(used, D, 0.0)[:, None]
    count = min(COLUMNS, int(used.sum()))
    if not count:
        return np.zeros(0), np.zeros((len(used), 0))
    X = np.linalg.qr(np.random.default_rng(0).normal(size=(len(used), count)) * used[:, None])[0]
    for step in range(STEPS):
        Y = scale * solve_columns(problem, factored, scale * X)
        if step == 0 and np.linalg.norm(Y) * np.sqrt(used.sum() / (count * UNLIKELY)) < harmless:
            return np.zeros(0), np.zeros((len(used), 0))
        values, rotation = np.linalg.eigh(X.T @ Y)
        U = X @ rotation
        X = np.linalg.qr(Y)[0]
    return values[::-1], U[:, ::-1]


def _limits(problem: IndexedProblem) -> Float:
    """Standard deviation beyond which a kept unknown counts as open, (n_kept,)."""
    limit = np.full(problem.layout.n_kept, np.inf)
    for u in problem.unknowns:
        if u.implausible is not None and (problem.layout.vertex[u.name] >= 0).any():
            columns = problem.layout.columns(u.name, u.size)
            limit[columns[columns >= 0]] = np.broadcast_to(u.implausible, columns.shape)[columns >= 0]
    return limit


def _weak_blocks(problem: IndexedProblem, factored: Factored) -> Int:
    """Eliminated blocks that are open even with all else known."""
    if problem.rays is None or not len(problem.rays.block):
        return np.zeros(0, dtype=np.int64)
    group = next(u for u in problem.unknowns if u.eliminated)
    l00, l10, l20, l11, l21, l22 = factored.block_factor.T
    diagonal = (l00**2, l10**2 + l11**2, l20**2 + l21**2 + l22**2)
    m10, m21 = -l10 / (l00 * l11), -l21 / (l11 * l22)
    m20 = (l10 * l21 - l20 * l11) / (l00 * l11 * l22)
    variance = (1 / l00**2 + m10**2 + m20**2, 1 / l11**2 + m21**2, 1 / l22**2)
    limit = np.full(3, np.inf) if group.implausible is None else np.asarray(group.implausible, dtype=np.float64)
    weak: Bool = np.zeros(len(l00), dtype=bool)
    for q, n, most, free in zip(variance, diagonal, limit, problem.block_free.T):
        weak |= ((q * n > OPEN) | (q > most**2)) & (free > 0)
    return np.flatnonzero(weak & (problem.hold[:, 0, 0] == 0))
