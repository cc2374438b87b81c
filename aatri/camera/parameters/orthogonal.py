"""Products of orthogonal polynomials less the effects of the exterior orientation: Gruen's 44, Legendre sets.

Both displacements are expanded in products q_i(x) q_j(y) of orthonormal polynomials, 2 (m + 1)(n + 1) terms. Out of
their span the six effects of the exterior orientation of vertical photographs of flat terrain,

    (1, 0)   (0, 1)   (x, y)   (y, -x)   (x^2, x y)   (x y, y^2)

are taken by Gram-Schmidt, term after term in ascending degree; what nothing remains of drops out. The rest is
orthonormal and orthogonal to the six. The name of a parameter is that of the term it began with: `x31` is of degree
3 in x and 1 in y in dx. A parameter of 1 mm displaces by 1 mm in root mean square.

    gruen44    q orthonormal on the 5 x 5 grid x in {0, +-w/2, +-w}, y in {0, +-h/2, +-h}: 2 x 25 - 6 = 44
    legendre   q orthonormal over the format, degrees m, n: (2, 2) gives 12, (4, 4) 44, (5, 5) 66

w, h are half the width and height of the format. Gruen's own grid reaches to the photo base only, his coefficients are
rounded; with any grid the 44 span the same space up to the exterior orientation, and with this one no term runs away
towards the corners.

Source: Gruen 1978; Tang, Cramer & Fritsch 2012, Application of Legendre polynomials in photogrammetric calibration.
"""

from functools import lru_cache

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.parameter_set import Basis, ParameterSet, SetScale, no_classical_values
from aatri.errors import SpecError

HIGHEST_DEGREE = 12
"""Polynomials of higher degree oscillate beyond what image points can determine."""

_GRUEN_NODES = (-1.0, -0.5, 0.0, 0.5, 1.0)


def legendre(degree_x: int = 4, degree_y: int = 4) -> ParameterSet:
    """Legendre polynomials over the format.

    Parameters
    ----------
    degree_x, degree_y : int
        2 to 12.

    Raises
    ------
    SpecError
        If a degree is out of range.
    """
    for degree in (degree_x, degree_y):
        if not 2 <= degree <= HIGHEST_DEGREE:
            raise SpecError(
                f"legendre additional parameters of degree {degree}", remedy=f"2 to {HIGHEST_DEGREE} in x and in y"
            )
    t, w = np.polynomial.legendre.leggauss(max(degree_x, degree_y) + 1)
    nodes, weights = tuple(map(float, t)), tuple(map(float, w / 2))

    def basis(xy_mm: Float, scale: SetScale) -> Float:
        return _evaluate(xy_mm, scale.half_format_mm, nodes, weights, (degree_x, degree_y))

    return _named("legendre", (degree_x, degree_y), basis)


def _gruen_basis(xy_mm: Float, scale: SetScale) -> Float:
    return _evaluate(xy_mm, scale.half_format_mm, _GRUEN_NODES, (0.2,) * 5, (4, 4))


def _evaluate(
    xy_mm: Float,
    widths_mm: tuple[float, float],
    nodes: tuple[float, ...],
    weights: tuple[float, ...],
    degrees: tuple[int, int],
) -> Float:
    coefficients = _polynomials(nodes, weights, max(degrees))
    q_x, q_y = (np.vander(xy_mm[:, k] / widths_mm[k], max(degrees) + 1, increasing=True) @ coefficients for k in (0, 1))
    terms = _terms(degrees)
    products = np.stack([q_x[:, i] * q_y[:, j] for i, j in terms], axis=1)
    mixing = _without_exterior(nodes, weights, degrees, widths_mm[1] / widths_mm[0])[0]
    t = len(terms)
    return np.stack([products @ mixing[:t], products @ mixing[t:]], axis=1)


@lru_cache(maxsize=32)
def _polynomials(nodes: tuple[float, ...], weights: tuple[float, ...], degree: int) -> Float:
    """Coefficients of the orthonormal polynomials, column j that of degree j in ascending powers."""
    root = np.sqrt(np.array(weights))[:, None]
    triangle = np.linalg.qr(root * np.vander(np.array(nodes), degree + 1, increasing=True))[1]
    return np.asarray(np.linalg.inv(triangle * np.sign(np.diag(triangle))[:, None]))


def _terms(degrees: tuple[int, int]) -> list[tuple[int, int]]:
    """Degrees (i, j) of the products, ascending."""
    every = [(i, j) for i in range(degrees[0] + 1) for j in range(degrees[1] + 1)]
    return sorted(every, key=lambda ij: (ij[0] + ij[1], ij[1]))


@lru_cache(maxsize=32)
def _without_exterior(
    nodes: tuple[float, ...], weights: tuple[float, ...], degrees: tuple[int, int], aspect: float
) -> tuple[Float, tuple[int, ...]]:
    """Orthonormal combinations of the terms, orthogonal to the exterior orientation.

    Returns
    -------
    (2 t, 2 t - 6) float64
        Coefficients of the terms in dx, then in dy.
    tuple of int
        Row in which each combination began.
    """
    terms = _terms(degrees)
    t = len(terms)
    done = [*_exterior_coefficients(nodes, weights, degrees, aspect).T]
    six = len(done)
    began = []
    for row in sorted(range(2 * t), key=lambda r: (sum(terms[r % t]), r)):
        rest = np.zeros(2 * t)
        rest[row] = 1.0
        for _ in range(2):  # twice is enough: the second pass removes the rounding of the first
            for direction in done:
                rest -= (direction @ rest) * direction
        length = float(np.linalg.norm(rest))
        if length > 1e-6:
            rest[np.abs(rest) < 1e-15] = 0.0
            done.append(rest / length)
            began.append(row)
    return np.stack(done[six:], axis=1), tuple(began)


def _exterior_coefficients(
    nodes: tuple[float, ...], weights: tuple[float, ...], degrees: tuple[int, int], aspect: float
) -> Float:
    """The six effects in terms of the products, orthonormal, (2 t, 6)."""
    t = np.array(nodes)
    x, y = np.tile(t, len(t)), aspect * np.repeat(t, len(t))
    q = np.vander(t, max(degrees) + 1, increasing=True) @ _polynomials(nodes, weights, max(degrees))
    weight = np.outer(weights, weights).ravel()
    products = np.stack([np.outer(q[:, j], q[:, i]).ravel() for i, j in _terms(degrees)], axis=1)
    one, zero = np.ones_like(x), np.zeros_like(x)
    effects = [(one, zero), (zero, one), (x, y), (y, -x), (x**2, x * y), (x * y, y**2)]
    coefficients = [np.concatenate([products.T @ (weight * d) for d in effect]) for effect in effects]
    return np.linalg.qr(np.stack(coefficients, axis=1))[0]


def _named(name: str, degrees: tuple[int, int], basis: Basis) -> ParameterSet:
    terms = _terms(degrees)
    names = [f"{axis}{i}_{j}" if max(degrees) > 9 else f"{axis}{i}{j}" for axis in "xy" for i, j in terms]
    # which terms drop out does not depend on the format: the nodes of any inner product tell
    t, w = np.polynomial.legendre.leggauss(max(degrees) + 1)
    began = _without_exterior(tuple(map(float, t)), tuple(map(float, w / 2)), degrees, 1.0)[1]
    count = len(began)
    return ParameterSet(name, tuple(names[r] for r in began), ("mm",) * count, basis, no_classical_values(count))


GRUEN44 = _named("gruen44", (4, 4), _gruen_basis)
