"""Normal equations of coefficients and summed deformations of strips together, the ground points eliminated.

Everything that moves a strip is made of the same few functions f of the place in the strip, in its three axes G
(summed_deformation). For strips j and k, axes a and b,

    N_(j a, k b) = sum_p [G_j'(W_j d_jk - W_j W_p^-1 W_k) G_k]_ab f_j f_k',      W_p = sum of the weights at point p

so that only scalar functions are summed; coefficients and causes are linear in them. Points of one strip without
control contribute nothing.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csr_array

from aatri.arrays import Bool, Float, Int
from aatri.geometry.strip_bases import StripAxes, StripBasis
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.similarity_ties import in_axes
from aatri.orientation.bodies.summed_deformation import HIGHEST, causes, functions


@dataclass(frozen=True)
class DeformedTies:
    """Active points of strips, in the order of points and strips."""

    row: Int
    strip: Int
    point: Int
    """(n,)."""
    weight: Float
    """(n, 3, 3), 1/m^2. From the strip's axes to the ground: W G."""
    axes: Float
    """(n, 3, 3). G."""
    f: Float
    """(n, m). Functions."""


def is_wide(basis: StripBasis) -> bool:
    """Whether a basis needs powers of v."""
    return basis.full or (basis.form == "conformal" and not basis.narrow)


def deformed_ties(
    points: BodyPoints, axes: Sequence[StripAxes], active: Bool, whitener: Float, *, wide: bool
) -> DeformedTies:
    """Active points of strips.

    Parameters
    ----------
    axes : (n_strips,) sequence of StripAxes
    active : (n,) bool
    whitener : (n, 3, 3) float64, 1/m
    wide : bool
        See `functions`.
    """
    row = np.flatnonzero(active)
    row = row[np.lexsort((points.strip[row], points.point[row]))]
    active_points, T = points.take(row), whitener[row]
    local, _ = in_axes(active_points, axes)
    G = np.stack([a.ground_from_axes for a in axes])[active_points.strip]
    f = functions(local[:, 0], local[:, 1], wide=wide)
    return DeformedTies(row, active_points.strip, active_points.point, T.swapaxes(1, 2) @ (T @ G), G, f)


def by_functions(axes: Sequence[StripAxes], models: Int, basis: StripBasis) -> Float:
    """Coefficients and causes by the functions, (n_strips, 3 m, K + L)."""
    half_m, wide = np.stack([a.half_range_m for a in axes]), is_wide(basis)
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, HIGHEST + 2), np.linspace(-1, 1, 5)))
    f = functions(u, v, wide=wide)
    # The coefficients' terms are sums of the functions: at a few places they say which.
    inverse_of_functions = np.linalg.pinv(f)
    of_basis = [
        inverse_of_functions @ basis.rows(u, v, np.full(len(u), across / along)).transpose(1, 0, 2)
        for along, across in half_m
    ]
    camera_m = np.stack([a.camera_m for a in axes])
    both = np.concatenate([np.stack(of_basis), causes(half_m, camera_m, models, f.shape[1])], axis=3)
    return both.reshape(len(axes), -1, both.shape[3])


def normals(ties: DeformedTies, latent_basis: Float, inverse: Float, points: Bool) -> csr_array:
    """Normal matrix of what is made of the functions of every strip, (n_strips K, n_strips K), in blocks of strips.

    Parameters
    ----------
    latent_basis : (n_strips, 3 m, K) float64
    inverse : (n_points, 3, 3) float64, m^2
        W_p^-1.
    points : (n_points,) bool
        Those that count.
    """
    n, m, K = len(latent_basis), ties.f.shape[1], latent_basis.shape[2]
    blocks: list[list[tuple[int, Float]]] = [[] for _ in range(n)]
    rows = np.flatnonzero(points[ties.point])
    WG, f = ties.weight[rows], ties.f[rows]
    weighted = inverse[ties.point[rows]] @ WG
    for j, k, first, second in pairs_of_strips(ties.strip[rows], ties.point[rows]):
        P = -WG[first].swapaxes(1, 2) @ weighted[second]
        if j == k:
            P += ties.axes[rows[first]].swapaxes(1, 2) @ WG[first]
        left = (P.reshape(-1, 9, 1) * f[first, None]).reshape(-1, 9 * m)
        block = (left.T @ f[second]).reshape(3, 3, m, m).transpose(0, 2, 1, 3).reshape(3 * m, 3 * m)
        of_pair = latent_basis[j].T @ block @ latent_basis[k]
        blocks[j].append((k, of_pair))
        if j != k:
            blocks[k].append((j, of_pair.T))
    every = [block for row in blocks for block in row]
    columns, first = np.array([k for k, _ in every], dtype=np.int64), np.cumsum([0, *map(len, blocks)])
    data = np.stack([np.zeros((K, K)), *(block for _, block in every)])[1:]
    return bsr_array((data, columns, first), shape=(n * K, n * K)).tocsr()


def misfit(ties: DeformedTies, residual_m: Float, n_strips: int) -> Float:
    """Of the functions to the residuals of all strip points: sum of f (G'W v), (n_strips, 3 m)."""
    turned = np.einsum("nji,nj->ni", ties.weight, np.nan_to_num(residual_m[ties.row]))
    sums = np.zeros((n_strips, 3, ties.f.shape[1]))
    for k in range(n_strips):
        of_strip = ties.strip == k
        sums[k] = turned[of_strip].T @ ties.f[of_strip]
    return sums.reshape(n_strips, -1)


def of_control(ties: DeformedTies, n_strips: int, inverse: Float, control: Int, whitener: Float) -> Float:
    """What control brings in, by whitened columns: sum of G'W W_p^-1 T', (n_strips, 3 m, 3 n_control).

    Parameters
    ----------
    inverse : (n_points, 3, 3) float64, m^2
    control : (n_control,) int
        Points.
    whitener : (n_control, 3, 3) float64, 1/m
        T, zero where not used.
    """
    columns = np.zeros((n_strips, 3, ties.f.shape[1], len(control), 3))
    for c, point in enumerate(control.tolist()):
        rows = np.arange(*np.searchsorted(ties.point, [point, point + 1]))
        brought = ties.weight[rows].swapaxes(1, 2) @ (inverse[point] @ whitener[c].T)
        columns[ties.strip[rows], :, :, c] = brought[:, :, None] * ties.f[rows, None, :, None]
    return columns.reshape(n_strips, columns.shape[1] * columns.shape[2], 3 * len(control))


def pairs_of_strips(strip: Int, point: Int) -> Iterator[tuple[int, int, Int, Int]]:
    """Strips j <= k, and the rows of both at their common points; rows in the order of points and strips."""
    first, second = [np.arange(len(point))], [np.arange(len(point))]
    for apart in range(1, int(np.bincount(point).max(initial=1))):
        same = np.flatnonzero(point[apart:] == point[:-apart])
        first.append(same)
        second.append(same + apart)
    a, b = np.concatenate(first), np.concatenate(second)
    code = strip[a].astype(np.int64) * (int(strip.max(initial=0)) + 1) + strip[b]
    order = np.argsort(code, kind="stable")
    for of_pair in np.split(order, np.flatnonzero(np.diff(code[order])) + 1):
        if len(of_pair):
            yield int(strip[a[of_pair[0]]]), int(strip[b[of_pair[0]]]), a[of_pair], b[of_pair]
