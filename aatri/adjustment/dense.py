"""Least squares with a dense Jacobian: for single models, strips, resections, similarities, below some 500 unknowns.

Minimise v'v, where v = (computed - observed) / sigma are whitened residuals and J = dv/dx. A Gauss-Newton step solves
J dx = -v by QR of the column-scaled Jacobian; if it does not lower the cost, Levenberg-Marquardt damping takes over.
Converged when the Newton decrement sqrt(dx'J'J dx) is at most `tolerance`, which bounds the step of every unknown by
`tolerance` times its own standard deviation; the last step is applied.

Source: Nocedal & Wright, Numerical Optimization, ch. 10; Mikhail & Ackermann, Observations and Least Squares.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from aatri.adjustment.damping import Damping, gain
from aatri.errors import ConvergenceError, GeometryError

Float = npt.NDArray[np.float64]
S = TypeVar("S")

Linearise = Callable[[S], tuple[Float, Float]]
"""state -> (v (m,), J (m, u)), whitened."""
Update = Callable[[S, Float], S]
"""(state, dx (u,)) -> state."""

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
    state, damping = start, Damping()
    v, J = linearise(state)
    for iteration in range(1, max_iterations + 1):
        cost = float(v @ v)
        if not np.isfinite(cost):
            raise ConvergenceError(f"{what}: residuals are not finite in iteration {iteration}")
        if damping.value == 0.0:
            refuse_undetermined(J, names, what)
        dx = _step(J, v, damping.value)
        decrement = float(np.linalg.norm(J @ dx))
        trial = update(state, dx)
        v_trial, J_trial = linearise(trial)
        cost_trial = float(v_trial @ v_trial)
        if damping.value == 0.0 and decrement <= tolerance:
            covariance = inverse_normal(J_trial, names, what)
            redundancy = len(v_trial) - J_trial.shape[1]
            sigma0 = float(np.sqrt(cost_trial / redundancy)) if redundancy > 0 else float("nan")
            return DenseResult(trial, v_trial, J_trial, covariance, redundancy, sigma0, iteration)
        if np.isfinite(cost_trial) and cost_trial <= cost * (1 + 1e-12):
            predicted = cost - float(np.sum((v + J @ dx) ** 2))
            state, v, J = trial, v_trial, J_trial
            damping = damping.accepted(gain(cost, cost_trial, predicted))
        else:
            damping = damping.refused()
    raise ConvergenceError(
        f"{what} did not converge in {max_iterations} iterations (sum of squares {cost:.6g})",
        remedy="check the observations with the largest residuals, or give better initial values",
    )


def _step(J: Float, v: Float, damping: float) -> Float:
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0] = 1.0
    A, b = J / scale, -v
    if damping > 0:
        A = np.vstack([A, np.sqrt(damping) * np.eye(J.shape[1])])
        b = np.concatenate([b, np.zeros(J.shape[1])])
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0] / scale)


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
