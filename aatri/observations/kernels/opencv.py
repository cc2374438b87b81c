"""Rays of cameras with OpenCV's model, compiled; its equations are those of `aatri.camera.models.projection`."""

from __future__ import annotations

from numba import njit


@njit(
    "void(int64, int64, int32[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], "
    "float64[:,:,::1], float64[:,:,::1])",
    nogil=True,
    cache=True,
    error_model="numpy",
)
def opencv(first, last, block, xy, parameters, u, v, by_u, by_camera):
    """Residuals of OpenCV's model (c q x0 y0 k1 k2 p1 p2 k3 k4 k5 k6) and derivatives to u and to the parameters.

    Parameters
    ----------
    block : (n,) int32
        Row of parameters of each ray.
    xy : (n, 2) float64, mm
    parameters : (n_blocks, s) float64, s from 12 on
    u : (last - first, 3) float64
    v : (last - first, 2) float64, mm
    by_u : (last - first, 2, 3) float64
    by_camera : (last - first, 2, s) float64
        Filled in; columns from the thirteenth on are zero.
    """
    for k in range(first, last):
        r, g = k - first, parameters[block[k]]
        c, ratio = g[0], g[1]
        k1, k2, p1, p2, k3, k4, k5, k6 = g[4], g[5], g[6], g[7], g[8], g[9], g[10], g[11]
        w = u[r, 2]
        a, b = -u[r, 0] / w, u[r, 1] / w  # normalised, b down
        q = a * a + b * b
        q2 = q * q
        q3 = q2 * q
        bottom = 1.0 + k4 * q + k5 * q2 + k6 * q3
        L = (1.0 + k1 * q + k2 * q2 + k3 * q3) / bottom
        dL = (k1 + 2.0 * k2 * q + 3.0 * k3 * q2 - L * (k4 + 2.0 * k5 * q + 3.0 * k6 * q2)) / bottom
        tangent_a, tangent_b, both = q + 2.0 * a * a, q + 2.0 * b * b, 2.0 * a * b
        da, db = a * L + p1 * both + p2 * tangent_a, b * L + p1 * tangent_b + p2 * both
        aa = L + 2.0 * dL * a * a + 2.0 * p1 * b + 6.0 * p2 * a
        ab = 2.0 * dL * a * b + 2.0 * p1 * a + 2.0 * p2 * b
        bb = L + 2.0 * dL * b * b + 6.0 * p1 * b + 2.0 * p2 * a
        fx, fy = c, -c * ratio
        v[r, 0], v[r, 1] = g[2] + fx * da - xy[k, 0], g[3] + fy * db - xy[k, 1]
        by_u[r, 0, 0], by_u[r, 0, 1], by_u[r, 0, 2] = -fx * aa / w, fx * ab / w, -fx * (aa * a + ab * b) / w
        by_u[r, 1, 0], by_u[r, 1, 1], by_u[r, 1, 2] = -fy * ab / w, fy * bb / w, -fy * (ab * a + bb * b) / w
        J = by_camera[r]
        J[0, 0], J[1, 0] = da, -ratio * db
        J[0, 1], J[1, 1] = 0.0, -c * db
        J[0, 2], J[1, 2] = 1.0, 0.0
        J[0, 3], J[1, 3] = 0.0, 1.0
        xa, yb = fx * a / bottom, fy * b / bottom
        J[0, 4], J[1, 4] = xa * q, yb * q
        J[0, 5], J[1, 5] = xa * q2, yb * q2
        J[0, 6], J[1, 6] = fx * both, fy * tangent_b
        J[0, 7], J[1, 7] = fx * tangent_a, fy * both
        J[0, 8], J[1, 8] = xa * q3, yb * q3
        J[0, 9], J[1, 9] = -L * xa * q, -L * yb * q
        J[0, 10], J[1, 10] = -L * xa * q2, -L * yb * q2
        J[0, 11], J[1, 11] = -L * xa * q3, -L * yb * q3
        for j in range(12, J.shape[1]):
            J[0, j], J[1, j] = 0.0, 0.0
