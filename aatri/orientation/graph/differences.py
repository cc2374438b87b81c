"""Values of the nodes of a graph from observed differences along its edges, robustly.

    x_second - x_first = difference + v,    sum w rho(|v|) = min

rho is first |v| (least absolute deviations: wrong edges hardly count), then Cauchy's log(1 + (v / 2.4 s)^2) with s from
the median of |v|; both by reweighted least squares, each step one sparse factorisation of the Laplacian of the graph.
One node of every connected part is held at zero.

Rotations, logarithms of scales and positions of images are all of this form.

Source: Chatterjee & Govindu, PAMI 40 (2018) 958; Holland & Welsch 1977.
"""

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from aatri.arrays import Float, Int

STEPS = 15
"""Reweighted steps of either kind, at most."""

LEAST = 1e-3
"""Residuals below this share of their median count as equal in least absolute deviations."""

EXACT = 1e-9
"""A smaller median residual is rounding."""

WORTHLESS = 1e-9
"""Least factor on the weight of an edge: what nothing else holds is held by it."""

CAUCHY = 2.385
"""Bound of Cauchy's weights, in standard deviations: 95 % efficient for normal errors."""

SETTLED = 1e-6
"""Steps end when no value moves by more than this share of the median residual."""


def parts_of(n: int, first: Int, second: Int) -> Int:
    """The connected part of each node, (n,); numbered by their first node."""
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def fitted(n: int, first: Int, second: Int, difference: Float, weight: Float) -> Float:
    """Weighted least squares.

    Parameters
    ----------
    n : int
        Nodes.
    first, second : (m,) int
        Ends of each edge.
    difference : (m, k) float64
        Observed x_second - x_first.
    weight : (m,) float64

    Returns
    -------
    (n, k) float64
        Zero at the first node of each connected part.
    """
    part = parts_of(n, first, second)
    fixed = np.zeros(n, dtype=bool)
    fixed[np.unique(part, return_index=True)[1]] = True
    place = np.where(fixed, -1, np.cumsum(~fixed) - 1)
    x = np.zeros((n, difference.shape[1]))
    free = int((~fixed).sum())
    if not free:
        return x
    a, b, w = place[first], place[second], weight
    of_a, of_b, both = a >= 0, b >= 0, (a >= 0) & (b >= 0)
    rows = np.concatenate([a[of_a], b[of_b], a[both], b[both]])
    columns = np.concatenate([a[of_a], b[of_b], b[both], a[both]])
    values = np.concatenate([w[of_a], w[of_b], -w[both], -w[both]])
    laplacian = csc_array(coo_array((values, (rows, columns)), shape=(free, free)))
    right = np.zeros((free, difference.shape[1]))
    np.add.at(right, b[of_b], (w[:, None] * difference)[of_b])
    np.add.at(right, a[of_a], -(w[:, None] * difference)[of_a])
    x[~fixed] = splu(laplacian, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(right)
    return x


def robust_weights(size: Float, weight: Float, *, absolute: bool) -> Float:
    """Weights of the next step from the sizes of the residuals.

    Parameters
    ----------
    size : (m,) float64
    weight : (m,) float64
        A priori.
    absolute : bool
        Least absolute deviations; else Cauchy's.
    """
    typical = max(float(np.median(size)), EXACT) if len(size) else 1.0
    if absolute:
        factor = typical / np.maximum(size, LEAST * typical)
    else:
        factor = 1.0 / (1.0 + (size / (CAUCHY * 1.4826 * typical)) ** 2)
    return np.asarray(weight * np.maximum(factor, WORTHLESS))


def fitted_robustly(
    n: int, first: Int, second: Int, difference: Float, weight: Float, size: Float | None = None
) -> tuple[Float, Float]:
    """Robust fit; see above.

    Parameters
    ----------
    size : (m,) float64, optional
        What the length of a residual is divided by before it is judged.

    Returns
    -------
    x : (n, k) float64
    residual : (m,) float64
        Length of x_second - x_first - difference, divided by `size`.
    """
    unit = np.ones(len(first)) if size is None else size
    x = fitted(n, first, second, difference, weight)
    for absolute in (True, False):
        for _ in range(STEPS):
            v = np.linalg.norm(x[second] - x[first] - difference, axis=1) / unit
            before, x = x, fitted(n, first, second, difference, robust_weights(v, weight, absolute=absolute))
            typical = float(np.median(v * unit)) if len(v) else 0.0
            if float(np.abs(x - before).max(initial=0.0)) <= SETTLED * max(typical, 1e-9):
                break
    return x, np.asarray(np.linalg.norm(x[second] - x[first] - difference, axis=1) / unit)
