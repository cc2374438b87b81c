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

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.diagnosis import described
from aatri.adjustment.elimination.backsolve import solve_columns
from aatri.adjustment.structure.indexed_problem import Factored, IndexedProblem
from aatri.adjustment.threads import thread_control
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.notes import Note

OPEN = 1e12
"""Q_ii N_ii from which on an unknown is open."""

WARNED = 0.1
"""Share of the limits from which on there is a warning."""

COLUMNS = 8
"""Directions looked for at once: a free datum leaves seven open."""

STEPS = 2
"""Multiplications by the covariance: the first brings out what is open by orders of magnitude."""

UNLIKELY = 1e-4

ALONE = 0.98
"""Share of a direction within one vertex from which on it is that vertex's own."""


@dataclass(frozen=True)
class Conditioning:
    """What is open, or nearly so.

    Attributes
    ----------
    open : tuple of str
        Combinations of unknowns that are open.
    nearly : tuple of str
        Combinations that are within a factor of ten of it.
    weak_vertices : (k,) int
        Vertices that are open by themselves.
    weak_blocks : (k,) int
        Eliminated blocks that are, by their place among the rays' blocks.
    """

    open: tuple[str, ...]
    nearly: tuple[str, ...]
    weak_vertices: Int
    weak_blocks: Int


def conditioning(problem: IndexedProblem, factored: Factored) -> Conditioning:
    """Look for open directions at the state of a factorisation without damping."""
    vertices: list[int] = []
    open_: list[str] = []
    nearly: list[str] = []
    with thread_control().limit(limits=1, user_api="blas"):  # a few columns are not worth a second thread
        limit, bare = _limits(problem), np.where(factored.diagonal > 0, factored.diagonal, 1.0)
        # the largest eigenvalue with which nothing is open, nor nearly so
        harmless = min(WARNED * OPEN, WARNED**2 * float((bare * limit**2).min(initial=np.inf)))
        values, U = _leading(problem, factored, harmless)
    vertex_of = np.repeat(np.arange(len(problem.layout.size)), problem.layout.size)
    for value, u in zip(values, U.T):
        own = value * u**2
        # in standard deviations: the limit of the ratio is one of variances
        excess = max(own.max(initial=0.0) / OPEN, float(np.sqrt((own / bare / limit**2).max(initial=0.0))))
        if not excess > WARNED:
            continue
        share = np.bincount(vertex_of, u**2, minlength=len(problem.layout.size))
        if excess > 1 and share.max() > ALONE and len(share) > 1:
            vertices.append(int(share.argmax()))
        else:
            (open_ if excess > 1 else nearly).append(described(problem, u))
    return Conditioning(tuple(open_), tuple(nearly), np.unique(np.array(vertices, dtype=np.int64)),
                        _weak_blocks(problem, factored))  # fmt: skip


def refuse_open(found: Conditioning, why: str = "") -> None:
    """Raise if anything but single blocks is open.

    Parameters
    ----------
    why : str
        How it showed.

    Raises
    ------
    GeometryError
    """
    if found.open:
        more = f" and {len(found.open) - 7} more" if len(found.open) > 7 else ""
        raise GeometryError(
            f"the observations nearly leave {len(found.open)} combination(s) of unknowns open{why}: "
            f"{'; '.join(found.open[:7])}{more}",
            remedy="observe more, hold them or weigh them by a prior, or estimate fewer parameters",
        )


def notes_of(found: Conditioning) -> tuple[Note, ...]:
    """Warnings of what is nearly open."""
    return tuple(Note("warning", f"hardly determined by the observations: {text}") for text in found.nearly)


def _leading(problem: IndexedProblem, factored: Factored, harmless: float) -> tuple[Float, Float]:
    """Leading eigenvalues (k,) and vectors (n_kept, k) of D Q D; none where all eigenvalues are below `harmless`."""
    used = ~problem.layout.held & (factored.diagonal > 0)
    scale = np.where(used, np.sqrt(np.where(used, factored.diagonal, 0.0)), 0.0)[:, None]
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
