"""Functions by which a strip is deformed: linear in their coefficients, in the axes of the strip.

U runs along the strip, V across, W up; u and v are U and V centred and divided by half of their range, so that they lie
in [-1, 1] and the terms are about equally large.

    polynomial   dU = a'p, dV = b'p, dW = c'p,   p = 1; u, v; u^2, u v; u^3, u^2 v                       (degree 0 to 3)
                 full: v^2 in degree 2, u v^2 and v^3 in degree 3 as well
    conformal    dU + i dV = sum (a_k + i b_k) z^k,   z = u + i r v,  r the ratio of the half ranges;     dW = c'p

The conformal form keeps angles in plan (Cauchy-Riemann: d(dU)/dU = d(dV)/dV, d(dU)/dV = -d(dV)/dU) and has 2 (degree +
1) coefficients in plan. With `narrow` the terms with v^2 and v^3 are left out of it, as the lecture notes have it for
narrow strips; it is conformal then only where v = 0.

Source: docs/formulas.md 4.2; lecture notes A603, A604 with errata E05, E06; Schut 1967.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aatri.arrays import Float, Int

Form = Literal["polynomial", "conformal"]

POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (3, 0), (2, 1), (0, 2), (1, 2), (0, 3))
"""Exponents of u and v of the terms; the last three only of the full form."""

LINEAR_ACROSS = 7
"""Terms without powers of v."""


@dataclass(frozen=True)
class StripAxes:
    """Axes of a strip: U along it, V across, W up."""

    origin_m: Float
    """(3,), m. Centre of the points' range in U and V, at their mean height."""
    half_range_m: Float
    """(2,), m. Half the range of U and V."""
    ground_from_axes: Float
    """(3, 3). Rotation about the vertical."""
    camera_m: Float
    """(2,), m. Mean of the projection centres in V and W."""


def strip_axes(points_m: Float, centres_m: Float) -> StripAxes:
    """Axes of a strip from its points and its projection centres.

    U is the principal direction of the projection centres in plan, from the first to the last.

    Parameters
    ----------
    points_m : (n, 3) float64, m
        On the ground, Z up.
    centres_m : (k, 3) float64, m
        Projection centres, in order along the strip.
    """
    plan = centres_m[:, :2] - centres_m[:, :2].mean(0)
    along = np.linalg.svd(plan, full_matrices=True)[2][0] if len(plan) > 1 else np.array([1.0, 0.0])
    along = along * (np.sign(along @ (centres_m[-1, :2] - centres_m[0, :2])) or 1.0)
    rotation = np.array([[along[0], -along[1], 0.0], [along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    local = points_m @ rotation
    low, high = local[:, :2].min(0), local[:, :2].max(0)
    middle = np.append((low + high) / 2, local[:, 2].mean())
    half = np.maximum((high - low) / 2, 1e-6 * max(float((high - low).max()), 1e-3))
    return StripAxes(rotation @ middle, half, rotation, (centres_m.mean(0) @ rotation - middle)[1:])


@dataclass(frozen=True)
class StripBasis:
    """A set of deformations."""

    form: str
    full: bool
    """Powers of v too."""
    narrow: bool
    """Conformal without powers of v."""
    labels: tuple[str, ...]
    """Of the K coefficients: a of dU, b of dV, c of dW."""
    part: Int
    """(K,). Plan (0) or height (1)."""
    degree: Int
    """(K,)."""

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.labels)

    def rows(self, u: Float, v: Float, across_over_along: Float) -> Float:
        """Derivatives of (dU, dV, dW) by the coefficients.

        Parameters
        ----------
        u, v : (n,) float64
        across_over_along : (n,) float64
            Half range of V over that of U.

        Returns
        -------
        (n, 3, K) float64
        """
        derivatives = np.zeros((len(u), 3, self.size), dtype=np.result_type(u, v))
        p = terms(u, v, self.full, int(self.degree.max(initial=0)))
        count = p.shape[1]
        derivatives[:, 2, self.size - count :] = p
        if self.form == "polynomial":
            derivatives[:, 0, :count] = derivatives[:, 1, count : 2 * count] = p
            return derivatives
        y = across_over_along * v
        for k, (real, imaginary) in enumerate(_powers(u, y, self.narrow)[: (self.size - count) // 2]):
            derivatives[:, 0, 2 * k], derivatives[:, 0, 2 * k + 1] = real, -imaginary
            derivatives[:, 1, 2 * k], derivatives[:, 1, 2 * k + 1] = imaginary, real
        return derivatives

    def model(self, degree: int) -> str:
        """Name of what a part of a strip has got."""
        return f"{self.form}_{degree}" if degree >= 0 else "similarity"


def strip_basis(form: str, degree: int, *, full: bool = False, narrow: bool = False) -> StripBasis:
    """The deformations of a form up to a degree.

    Parameters
    ----------
    form : {'polynomial', 'conformal'}
    degree : int
        0 to 3.
    full, narrow : bool
        See the module's text.
    """
    chosen = _chosen(full, degree)
    names, of_term, n = ["U" * i + "V" * j or "1" for i, j in chosen], [i + j for i, j in chosen], len(chosen)
    if form == "polynomial":
        labels = [f"{axis}_{name}" for axis in "abc" for name in names]
        return StripBasis(form, full, False, tuple(labels), np.repeat([0, 0, 1], n), np.tile(of_term, 3))
    plan = [f"{axis}_{'z' * k or '1'}" for k in range(degree + 1) for axis in "ab"]
    labels = plan + [f"c_{name}" for name in names]
    part = np.concatenate([np.zeros(len(plan), dtype=np.int64), np.ones(n, dtype=np.int64)])
    return StripBasis(form, full, narrow, tuple(labels), part, np.array([k // 2 for k in range(len(plan))] + of_term))


def terms(u: Float, v: Float, full: bool, degree: int) -> Float:
    """The terms of the polynomial, (n, t)."""
    return np.stack([u**i * v**j for i, j in _chosen(full, degree)], axis=1)


def _chosen(full: bool, degree: int) -> list[tuple[int, int]]:
    return [(i, j) for k, (i, j) in enumerate(POWERS) if i + j <= degree and (full or k < LINEAR_ACROSS)]


def _powers(u: Float, y: Float, narrow: bool) -> list[tuple[Float, Float]]:
    """Real and imaginary part of z^0 ... z^3."""
    one, zero = np.ones_like(u), np.zeros_like(u)
    if narrow:
        return [(one, zero), (u, y), (u * u, 2 * u * y), (u**3, 3 * u * u * y)]
    return [(one, zero), (u, y), (u * u - y * y, 2 * u * y), (u**3 - 3 * u * y * y, 3 * u * u * y - y**3)]


SECOND_DEGREE = strip_basis("polynomial", 2)
"""The five coefficients per coordinate of the lecture notes."""
