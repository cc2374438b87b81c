"""Least squares with a dense Jacobian: for single models, strips, resections, similarities, below some 500 unknowns.

Minimise v'v, where v = (computed - observed) / sigma are whitened residuals and J = dv/dx. A Gauss-Newton step solves
J dx = -v by QR of the column-scaled Jacobian; if it does not lower the cost, Levenberg-Marquardt damping takes over:

    (J'J + lambda D^2) dx = -J'v,     D_k = largest norm of column k so far, fading
    (J'J + lambda D^2) a  = -J'v'',   v'' = second derivative of v along dx, by a difference

A damped step follows the curved valley, dx + a/2; it is refused where a component of D a exceeds 0.375 |D dx|: the
linear model does not hold that far. Undetermined unknowns are damped on the way and refused at the end.

Converged when the Newton decrement sqrt(dx'J'J dx) is at most `tolerance`, which bounds the step of every unknown by
`tolerance` times its own standard deviation; the last step is applied.

Source: Nocedal & Wright, Numerical Optimization, ch. 10; Mikhail & Ackermann, Observations and Least Squares;
More 1978, The Levenberg-Marquardt algorithm (D); Transtrum & Sethna 2012, Improvements to the Levenberg-Marquardt
algorithm (a).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from aatri.adjustment.stepping.damping import ROUNDING, Damping, gain
from aatri.arrays import Float
from aatri.errors import ConvergenceError, GeometryError

S = TypeVar("S")

Linearise = Callable[[S], tuple[Float, Float]]
"""state -> (v (m,), J (m, u)), whitened."""
Update = Callable[[S, Float], S]
"""(state, dx (u,)) -> state."""

MOST_DAMPING = 1e30
"""Beyond it no step of any length lowers the cost."""

FADING = 0.8
"""What is remembered of a column's norm from one step to the next."""

BEND = 0.375
"""Largest acceleration of a step, as a share of the step."""

AHEAD = 0.1
"""Share of the step after which its second derivative is taken."""

RANK_TOLERANCE = 1e-10
"""Smallest eigenvalue of the unit-diagonal normal matrix that still counts as determined."""


@dataclass(frozen=True)
class DenseResult(Generic[S]):
    """Result of a dense adjustment.

    Attributes
    ----------
    state : S
        The adjusted state.
    residual : (m,) float64
        Whitened residuals, computed minus observed over sigma.
    jacobian : (m, u) float64
        Whitened Jacobian at the solution.
    covariance : (u, u) float64
        A-priori covariance of the unknowns (sigma0 = 1).
    redundancy : int
    sigma0 : float
        sqrt(v'v / redundancy); NaN without redundancy.
    iterations : int
    """

    state: S
    residual: Float
    jacobian: Float
    covariance: Float
    redundancy: int
    sigma0: float
    iterations: int

    def redundancy_numbers(self) -> Float:
        """Redundancy number r of each observation: diagonal of I - J Q J'. Between 0 and 1; sums to the redundancy."""
        return np.asarray(1.0 - np.einsum("ij,jk,ik->i", self.jacobian, self.covariance, self.jacobian))


def adjust(
    linearise: Linearise[S],
    update: Update[S],
    start: S,
    *,
    names: Sequence[str] = (),
    max_iterations: int = 30,
    tolerance: float = 1e-3,
    what: str = "adjustment",
) -> DenseResult[S]:
    """Adjust a small non-linear problem.

    Parameters
    ----------
    linearise, update, start
        The problem, see the types above.
    names : sequence of str
        Names of the unknowns, for messages.
    max_iterations : int
    tolerance : float
        Bound of the Newton decrement.
    what : str
        What is adjusted, for messages.

    Raises
    ------
    GeometryError
        If the unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge.
    """
    here, damping = _at(linearise, start, np.zeros(0)), Damping()
    if not np.isfinite(here.cost):
        raise ConvergenceError(f"{what}: residuals are not finite at the start")
    for iteration in range(1, max_iterations + 1):
        if damping.value == 0.0 and undetermined(here.J):
            damping = damping.refused()
        dx = _step(here, here.v, damping.value)
        decrement = float(np.linalg.norm(here.J @ dx))
        predicted = here.cost - float(np.sum((here.v + here.J @ dx) ** 2))
        bend = np.zeros_like(dx)
        if damping.value > 0.0 and predicted > ROUNDING * here.cost:
            bend = _acceleration(linearise, update, here, dx, damping.value)
        follows = bool((np.abs(here.scale * bend) <= BEND * np.linalg.norm(here.scale * dx)).all())
        there = _at(linearise, update(here.state, dx + bend / 2), here.scale) if follows else here
        if damping.value == 0.0 and decrement <= tolerance and np.isfinite(there.cost):
            return _result(there, iteration, names, what)
        if follows and there.cost <= here.cost * (1 + ROUNDING):
            damping = damping.accepted(gain(here.cost, there.cost, predicted))
            here = there
        else:
            damping = damping.refused()
        if damping.value > MOST_DAMPING:
            break
    refuse_undetermined(here.J, names, what)
    raise ConvergenceError(
        f"{what} did not converge in {max_iterations} iterations (sum of squares {here.cost:.6g})",
        remedy="check the observations with the largest residuals, or give better initial values",
    )


@dataclass(frozen=True)
class _Linear(Generic[S]):
    """The problem linearised at a state; infinite cost where it cannot be evaluated."""

    state: S
    v: Float
    J: Float
    cost: float
    scale: Float


def _at(linearise: Linearise[S], state: S, scale_before: Float) -> _Linear[S]:
    v, J = linearise(state)
    if not (np.isfinite(v).all() and np.isfinite(J).all()):
        return _Linear(state, v, J, float("inf"), scale_before)
    with np.errstate(over="ignore"):
        cost = float(v @ v)
        norm = np.linalg.norm(J, axis=0)
    scale = np.maximum(FADING * scale_before, norm) if len(scale_before) else norm
    return _Linear(state, v, J, cost, scale)


def _step(here: _Linear[S], v: Float, damping: float) -> Float:
    scale = here.scale if damping > 0 else np.linalg.norm(here.J, axis=0)
    scale = np.where(scale == 0, 1.0, scale)
    A, b = here.J / scale, -v
    if damping > 0:
        A = np.vstack([A, np.sqrt(damping) * np.eye(len(scale))])
        b = np.concatenate([b, np.zeros(len(scale))])
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0] / scale)


def _acceleration(linearise: Linearise[S], update: Update[S], here: _Linear[S], dx: Float, damping: float) -> Float:
    """Acceleration along a damped step; infinite where it cannot be evaluated."""
    v, _ = linearise(update(here.state, AHEAD * dx))
    with np.errstate(over="ignore", invalid="ignore"):
        second = 2 / AHEAD * ((v - here.v) / AHEAD - here.J @ dx)
    return _step(here, second, damping) if np.isfinite(second).all() else np.full_like(dx, np.inf)


def _result(at: _Linear[S], iterations: int, names: Sequence[str], what: str) -> DenseResult[S]:
    covariance = inverse_normal(at.J, names, what)
    redundancy = len(at.v) - at.J.shape[1]
    sigma0 = float(np.sqrt(at.cost / redundancy)) if redundancy > 0 else float("nan")
    return DenseResult(at.state, at.v, at.J, covariance, redundancy, sigma0, iterations)


def inverse_normal(J: Float, names: Sequence[str] = (), what: str = "adjustment") -> Float:
    """(J'J)^-1 by QR of the column-scaled Jacobian.

    Raises
    ------
    GeometryError
        If it does not exist; see `refuse_undetermined`.
    """
    refuse_undetermined(J, names, what)
    scale = np.linalg.norm(J, axis=0)
    R = np.linalg.qr(J / scale, mode="r")
    R_inverse = np.linalg.inv(R)
    return np.asarray(R_inverse @ R_inverse.T / np.outer(scale, scale))


def refuse_undetermined(J: Float, names: Sequence[str] = (), what: str = "adjustment") -> None:
    """Raise if the observations leave unknowns open.

    Raises
    ------
    GeometryError
        If an eigenvalue of the unit-diagonal normal matrix is below `RANK_TOLERANCE`; the message names the unknowns of
        its null vectors.
    """
    defects = undetermined(J, names)
    if defects:
        raise GeometryError(
            f"{what}: {len(defects)} of {J.shape[1]} unknowns are not determined by {J.shape[0]} observations: "
            + "; ".join(defects)
        )


def undetermined(J: Float, names: Sequence[str] = ()) -> list[str]:
    """What the observations leave open: one text per defect, naming the unknowns of the null vector.

    Parameters
    ----------
    J : (m, u) float64, whitened
    names : sequence of str
    """
    labels = list(names) or [f"x{k + 1}" for k in range(J.shape[1])]
    scale = np.linalg.norm(J, axis=0)
    empty = scale == 0
    scale[empty] = 1.0
    A = J / scale
    values, vectors = np.linalg.eigh(A.T @ A)
    texts = []
    for vector in vectors[:, values < RANK_TOLERANCE].T:
        largest = np.argsort(-np.abs(vector))
        members = sorted(k for k in largest[:5] if abs(vector[k]) > 0.3 * abs(vector[largest[0]]))
        texts.append(" with ".join(labels[k] for k in members))
    return texts
