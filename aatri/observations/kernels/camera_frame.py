"""Rays of cameras with models of their own: into the axes of the camera, through Brown's model, and back out.

The camera model stands between two kernels: u = R'(X - X0) before it, and the chain rule after it. Brown's, the model
of most self-calibrations, is compiled too; its equations are those of `aatri.camera.models.calibration`.
"""

from __future__ import annotations

from numba import njit

SCENE = "int32[::1], int32[::1], float64[:,::1], float64[:,:,::1], float64[:,::1]"


@njit(f"void(int64, int64, {SCENE}, float64[:,::1])", nogil=True, cache=True, error_model="numpy")
def into_camera(first, last, image, point, X0, R, X, u):
    """Ground points of the rays first ... last - 1 in the axes of their images, u (last - first, 3)."""
    for k in range(first, last):
        r, i, p = k - first, image[k], point[k]
        dx, dy, dz = X[p, 0] - X0[i, 0], X[p, 1] - X0[i, 1], X[p, 2] - X0[i, 2]
        for a in range(3):
            u[r, a] = R[i, 0, a] * dx + R[i, 1, a] * dy + R[i, 2, a] * dz


@njit(
    f"void(int64, int64, {SCENE}, float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])",
    nogil=True,
    cache=True,
)
def out_of_camera(first, last, image, point, X0, R, X, weight, by_u, by_pose, by_point):
    """Derivatives to pose (X0, d; R <- exp([d]x) R) and point, whitened, from those to u.

    Parameters
    ----------
    weight : (n, 2) float64, 1/mm
    by_u : (last - first, 2, 3) float64, mm
    by_pose : (last - first, 2, 6) float64
    by_point : (last - first, 2, 3) float64
        Filled in.
    """
    for k in range(first, last):
        r, i, p = k - first, image[k], point[k]
        dx, dy, dz = X[p, 0] - X0[i, 0], X[p, 1] - X0[i, 1], X[p, 2] - X0[i, 2]
        for e in range(2):
            w = weight[k, e]
            a, b, c = w * by_u[r, e, 0], w * by_u[r, e, 1], w * by_u[r, e, 2]
            q0 = a * R[i, 0, 0] + b * R[i, 0, 1] + c * R[i, 0, 2]
            q1 = a * R[i, 1, 0] + b * R[i, 1, 1] + c * R[i, 1, 2]
            q2 = a * R[i, 2, 0] + b * R[i, 2, 1] + c * R[i, 2, 2]
            by_point[r, e, 0], by_point[r, e, 1], by_point[r, e, 2] = q0, q1, q2
            by_pose[r, e, 0], by_pose[r, e, 1], by_pose[r, e, 2] = -q0, -q1, -q2
            by_pose[r, e, 3] = q1 * dz - q2 * dy
            by_pose[r, e, 4] = q2 * dx - q0 * dz
            by_pose[r, e, 5] = q0 * dy - q1 * dx


@njit(
    "void(int64, int64, int32[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], "
    "float64[:,:,::1], float64[:,:,::1])",
    nogil=True,
    cache=True,
    error_model="numpy",
)
def brown(first, last, block, xy, parameters, u, v, by_u, by_camera):
    """Residuals of Brown's model (c x0 y0 as k1 k2 k3 p1 p2 b1 b2) and derivatives to u and to the parameters.

    Parameters
    ----------
    block : (n,) int32
        Row of parameters of each ray.
    xy : (n, 2) float64, mm
    parameters : (n_blocks, s) float64, s from 11 on
    u : (last - first, 3) float64
    v : (last - first, 2) float64, mm
    by_u : (last - first, 2, 3) float64
    by_camera : (last - first, 2, s) float64
        Filled in; columns from the twelfth on are zero.
    """
    for k in range(first, last):
        r, g = k - first, parameters[block[k]]
        c, stretch = g[0], 1.0 + g[3]
        k1, k2, k3, p1, p2, b1, b2 = g[4], g[5], g[6], g[7], g[8], g[9], g[10]
        s, y = xy[k, 0] - g[1], xy[k, 1] - g[2]
        x = stretch * s
        r2 = x * x + y * y
        r4 = r2 * r2
        r6 = r4 * r2
        radial = k1 * r2 + k2 * r4 + k3 * r6
        slope = 2.0 * (k1 + 2.0 * k2 * r2 + 3.0 * k3 * r4)
        px, py = -u[r, 0] / u[r, 2], -u[r, 1] / u[r, 2]
        dx = x * radial + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y + b1 * x + b2 * y
        dy = y * radial + p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y
        v[r, 0], v[r, 1] = c * px - (x + dx), c * py - (y + dy)
        by_u[r, 0, 0], by_u[r, 0, 1], by_u[r, 0, 2] = -c / u[r, 2], 0.0, -c * px / u[r, 2]
        by_u[r, 1, 0], by_u[r, 1, 1], by_u[r, 1, 2] = 0.0, -c / u[r, 2], -c * py / u[r, 2]
        xx = 1.0 + radial + slope * x * x + 6.0 * p1 * x + 2.0 * p2 * y + b1
        xy_ = slope * x * y + 2.0 * p1 * y + 2.0 * p2 * x + b2
        yx = slope * x * y + 2.0 * p2 * x + 2.0 * p1 * y
        yy = 1.0 + radial + slope * y * y + 6.0 * p2 * y + 2.0 * p1 * x
        J = by_camera[r]
        J[0, 0], J[1, 0] = px, py
        J[0, 1], J[1, 1] = stretch * xx, stretch * yx
        J[0, 2], J[1, 2] = xy_, yy
        J[0, 3], J[1, 3] = -s * xx, -s * yx
        J[0, 4], J[1, 4] = -x * r2, -y * r2
        J[0, 5], J[1, 5] = -x * r4, -y * r4
        J[0, 6], J[1, 6] = -x * r6, -y * r6
        J[0, 7], J[1, 7] = -(r2 + 2.0 * x * x), -2.0 * x * y
        J[0, 8], J[1, 8] = -2.0 * x * y, -(r2 + 2.0 * y * y)
        J[0, 9], J[1, 9] = -x, 0.0
        J[0, 10], J[1, 10] = -y, 0.0
        for j in range(11, J.shape[1]):
            J[0, j], J[1, j] = 0.0, 0.0
