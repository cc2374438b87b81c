"""Huber's loss: records far from the rest count less. It acts on the norm s of a whitened record as a whole.

    s <= k    cost s^2              weight w = 1
    s >  k    cost 2 k s - k^2      weight w = k / s

The gradient is 2 w J'v. Along its residual, n = v / s, the cost of a record beyond k does not bend: the Hessian, but
for the curvature of the observation itself, is 2 w J'(I - n n')J. Each such record is replaced by one of least squares,

    J <- sqrt(w) (I - a n n') J,    v <- sqrt(w) v / (1 - a),    (1 - a)^2 = 1 - theta

whose normal equations are w J'(I - theta n n')J and w J'v. theta, the `curvature`, is 0 in reweighted least squares:
safe far from the optimum, slow near it. Near 1 it is Newton's method: fast near the optimum, lost far from it. At 1
records beyond k determine nothing along their residual.

Source: Huber 1964, Robust estimation of a location parameter; Triggs et al. 2000, Bundle adjustment - a modern
synthesis.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float

NEWTON = 0.9999
"""Curvature near the optimum: the rest keeps the normal equations positive definite."""


@dataclass(frozen=True)
class Huber:
    """Huber's loss."""

    k: float
    """In standard deviations, positive; infinite is least squares."""
    curvature: float = 0.0
    """theta, from 0 to below 1. It changes the steps, not the cost."""

    def __post_init__(self) -> None:
        if not (self.k > 0 and 0 <= self.curvature < 1):
            raise ValueError(f"Huber's loss with k {self.k}, curvature {self.curvature}")

    def weigh(self, v: Float, jacobians: tuple[Float, ...]) -> None:
        """Weigh the records beyond k, in place.

        Parameters
        ----------
        v : (n, m) float64, whitened
        jacobians : tuple of (n, m, k) float64, whitened
        """
        far = np.flatnonzero(np.einsum("ni,ni->n", v, v) > self.k**2)
        if not len(far):
            return
        s = np.linalg.norm(v[far], axis=1)
        with np.errstate(invalid="ignore"):  # infinite residuals are refused by the cost, not here
            n = v[far] / s[:, None]
        root, rest = np.sqrt(self.k / s), np.sqrt(1 - self.curvature)
        v[far] *= (root / rest)[:, None]
        weight = root[:, None, None] * (np.eye(v.shape[1]) - (1 - rest) * n[:, :, None] * n[:, None, :])
        for J in jacobians:
            J[far] = weight @ J[far]

    def beyond(self, v: Float) -> Bool:
        """Which records lie beyond k, (n,); of weighted residuals."""
        return np.asarray(np.einsum("ni,ni->n", v, v) > self.k**2)

    def costs(self, v: Float) -> Float:
        """Cost of each record, (n,); of weighted residuals."""
        squares = np.einsum("ni,ni->n", v, v)
        far = squares > self.k**2
        squares[far] = 2 * (1 - self.curvature) * squares[far] - self.k**2
        return np.asarray(squares)
