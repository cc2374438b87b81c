"""Steps by conjugate gradients on the implicit reduced normal matrix, for problems whose factor has no room.

    S x = b,   dx = -x,    S = A'A - A'B D^-1 B'A,   b = A'v - A'B D^-1 (B'v + h0)

S is applied ray by ray (`kernels/implicit.py`); rays are linearised anew each time. The preconditioner is partly the
factor itself (`preconditioner.py`). The error e of x is bounded in the norm that counts, e'S e, in which no unknown is
off by more than sqrt(e'S e) standard deviations, points included:

    e'S e <= r'M^-1 r / smallest eigenvalue of M^-1 S

that eigenvalue from the Lanczos matrix, which the coefficients of the iteration give. It ends when the bound is at most
`ACCURACY` of the Newton decrement sqrt(x'S x), or of `SMALL` where that is less: what is left after the last step is
below 1e-7 standard deviations.

Whether S is regular, which a factorisation sees by its pivots, is found out by a second right-hand side: S w for a
random w. What then is left of w, e, has the quotient e'S e / e'diag(A'A) e: an upper bound of the smallest eigenvalue,
however accurate the solution, and close to it if it is very small.

Source: Hestenes & Stiefel 1952; Golub & Meurant 1997, Matrices, moments and quadrature II (bound of the error).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal

from aatri.adjustment.elimination.chunks import linearised, side_by_side
from aatri.adjustment.elimination.factor import Factor, Factored
from aatri.adjustment.elimination.schedule import Stretch, in_shares
from aatri.adjustment.iterative.preconditioner import partly_factorised
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.kernels.implicit import along_rays, onto_kept
from aatri.adjustment.structure.index import part_columns
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.errors import ConvergenceError

Product = Callable[[Float], Float]

ACCURACY = 1e-5
"""Error of a step, as a share of its Newton decrement."""

SMALL = 1e-2
"""Decrement below which the error of a step is not made smaller."""

PROBE_ACCURACY = 1e-8
"""Error of the solution that shows whether the matrix is regular, as a share of its right-hand side's."""

MOST_ITERATIONS = 3000


def solve_by_conjugate_gradients(problem: IndexedProblem, state: State, damping: float = 0.0) -> Factored:
    """Linearise at a state and solve the normal equations without their factor.

    Parameters
    ----------
    problem : IndexedProblem
        With the subtrees to factorise.

    Returns
    -------
    Factored
        With the kept unknowns' solution in place of a factor.

    Raises
    ------
    ConvergenceError
        If the iteration does not converge.
    """
    preconditioner, factored = partly_factorised(problem, state, damping)
    x = np.zeros(problem.layout.n_kept)
    if not factored.weak and bool(factored.determined.all()) and np.isfinite(factored.cost):
        S = _Reduced(problem, state, factored)
        x = conjugate_gradients(S.times, S.gradient(), preconditioner.solve, ACCURACY, SMALL)
        factored.y = [np.array([np.sqrt(max(float(x @ S.times(x)), 0.0))])]
    preconditioner.panels.clear()
    return replace(factored, factor=Factor(x=x))


def null_vector(problem: IndexedProblem, state: State) -> Float | None:
    """A null vector of the reduced normal matrix, if there is one, in unknowns times the root of their diagonal."""
    preconditioner, factored = partly_factorised(problem, state, 0.0)
    S, diagonal = _Reduced(problem, state, factored), factored.diagonal
    used = ~problem.layout.fixed & (diagonal > 0)
    w = np.where(used, np.random.default_rng(0).normal(size=len(used)) / np.sqrt(np.where(used, diagonal, 1.0)), 0.0)
    left = w - _iterated(S.times, S.times(w), preconditioner.solve, PROBE_ACCURACY, 0.0)[0]
    size = float((diagonal * left**2).sum())
    if size > 0.0 and float(left @ S.times(left)) < RANK_TOLERANCE * size:
        return left * np.sqrt(diagonal)
    return None


def conjugate_gradients(S: Product, b: Float, solve: Product, accuracy: float, small: float = 0.0) -> Float:
    """Solve S x = b.

    Parameters
    ----------
    S, solve : callable
        The matrix and the inverse of the preconditioner, times a vector.
    b : (n,) float64
    accuracy, small : float
        The error in the norm of S is at most `accuracy` times that of x, or times `small` if that is more.

    Raises
    ------
    ConvergenceError
    """
    x, iterations, converged = _iterated(S, b, solve, accuracy, small)
    if not converged:
        raise ConvergenceError(
            f"conjugate gradients did not converge in {iterations} iterations: the block is held together too loosely",
            remedy="raise memory_gb, so that more of the factor fits, or add control",
        )
    return x


def _iterated(S: Product, b: Float, solve: Product, accuracy: float, small: float) -> tuple[Float, int, bool]:
    """What is reached, the number of iterations, and whether it is accurate enough."""
    x, r = np.zeros_like(b), b.copy()
    z = solve(r)
    p, rho, square = z.copy(), float(r @ z), 0.0
    alphas: list[float] = []
    betas: list[float] = []
    while rho > 0.0 and len(alphas) < MOST_ITERATIONS:
        q = S(p)
        curvature = float(p @ q)
        if not curvature > 0.0:
            break
        alpha = rho / curvature
        x += alpha * p
        r -= alpha * q
        square += alpha * rho
        z = solve(r)
        before, rho = rho, float(r @ z)
        alphas.append(alpha)
        betas.append(rho / before)
        target = accuracy**2 * max(square, small**2)
        if rho <= target and rho <= target * _smallest_eigenvalue(alphas, betas):
            return x, len(alphas), True
        p = z + betas[-1] * p
    return x, len(alphas), rho == 0.0


def _smallest_eigenvalue(alphas: list[float], betas: list[float]) -> float:
    """Of the Lanczos matrix, which approaches that of the preconditioned matrix from above."""
    a, b = np.array(alphas), np.array(betas[:-1])
    diagonal = 1 / a
    diagonal[1:] += b / a[:-1]
    return float(eigvalsh_tridiagonal(diagonal, np.sqrt(b) / a[:-1], select="i", select_range=(0, 0))[0])


class _Reduced:
    """The reduced normal matrix at a state, and its gradient."""

    def __init__(self, problem: IndexedProblem, state: State, factored: Factored) -> None:
        self.problem, self.factored = problem, factored
        self.free = ~problem.layout.fixed
        self.fill = problem.ray_lane(state) if problem.rays is not None else None
        self.kept = [
            (part_columns(k.parts, problem.layout), *side_by_side(k, problem.layout, state)) for k in problem.kept
        ]

    def times(self, x: Float) -> Float:
        """S x."""
        total = self._over_rays(x) + self.factored.damping * self.factored.diagonal * x
        for columns, _, A in self.kept:
            t = np.einsum("nia,na->ni", A, np.append(x, 0.0)[columns])
            total += self._summed(columns, np.einsum("nia,ni->na", A, t))
        return total * self.free

    def gradient(self) -> Float:
        """b."""
        total = self._over_rays(None)
        for columns, v, A in self.kept:
            total += self._summed(columns, np.einsum("nia,ni->na", A, v))
        return total * self.free

    def _summed(self, columns: Int, values: Float) -> Float:
        total = np.zeros(len(self.free) + 1)
        np.add.at(total, columns, values)
        return total[:-1]

    def _over_rays(self, x: Float | None) -> Float:
        """Sum over the rays of S x, or of the gradient."""
        total = np.zeros(len(self.free))
        if self.problem.rays is None:
            return total
        for part in in_shares(self.problem, partial(self._share, x)):
            total += part
        return total

    def _share(self, x: Float | None, parts: Sequence[Stretch]) -> Float:
        problem, factored, total = self.problem, self.factored, np.zeros(len(self.free))
        rays, w = problem.rays, factored.block_y if x is None else np.empty_like(factored.block_y)
        assert rays is not None
        size, start = rays.parts.size, rays.parts.start
        assert self.fill is not None
        for stretch in parts:
            for p0, p1, v, A, B in linearised(problem, self.fill, stretch):
                base, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
                place = (p0, p1, base, rays.ray_start, A, B, problem.ray_columns[base:last], size, start)
                factors = (problem.block_free, factored.block_factor)
                if x is not None:
                    along_rays(*place, x, *factors, v, w)
                onto_kept(*place, *factors, v, w, total)
        return total
