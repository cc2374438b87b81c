"""Camera models between the two kernels of `camera_frame`: residuals and derivatives of many rays, compiled.

Brown's is the model of most self-calibrations; its equations are those of `aatri.camera.models.calibration`. OpenCV's
and Bundler's are those of `aatri.camera.models.projection`. A model is a function of this signature, and an entry in the lane's table.
"""

from numba import njit

MODEL = (
    "void(int64, int64, int32[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], "
    "float64[:,:,::1], float64[:,:,::1])"
)


@njit(MODEL, nogil=True, cache=True, error_model="numpy")
def brown(first, last, block, xy, parameters, u, v, by_u, by_camera):
    """Residuals of Brown's model (c x0 y0 as k1 k2 k3 p1 p2 b1 b2) and derivatives to u and to the parameters.

    Parameters
    ----------
    block : (n,) int32
        Row of parameters of each ray.
    xy : (n, 2) float64, mm
    parameters : (n_blocks, s) float64, s at least the number of the model's
    u : (last - first, 3) float64
    v : (last - first, 2) float64, mm
    by_u : (last - first, 2, 3) float64
    by_camera : (last - first, 2, s) float64
        Filled in; columns beyond the model's parameters are zero.
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


@njit(MODEL, nogil=True, cache=True, error_model="numpy")
def opencv(first, last, block, xy, parameters, u, v, by_u, by_camera):
    """Residuals of OpenCV's model (c q x0 y0 k1 k2 p1 p2 k3 k4 k5 k6); arguments as of `brown`, s from 12 on."""
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


@njit(MODEL, nogil=True, cache=True, error_model="numpy")
def bal(first, last, block, xy, parameters, u, v, by_u, by_camera):
    """Residuals of Bundler's model (f k1 k2); arguments as of `brown`, s from 3 on."""
    for k in range(first, last):
        r, g = k - first, parameters[block[k]]
        f, k1, k2, w = g[0], g[1], g[2], u[r, 2]
        a, b = -u[r, 0] / w, -u[r, 1] / w
        q = a * a + b * b
        L = 1.0 + q * (k1 + q * k2)
        dL = 2.0 * (k1 + 2.0 * q * k2)
        aa, ab, bb = L + dL * a * a, dL * a * b, L + dL * b * b
        v[r, 0], v[r, 1] = f * a * L - xy[k, 0], f * b * L - xy[k, 1]
        by_u[r, 0, 0], by_u[r, 0, 1], by_u[r, 0, 2] = -f * aa / w, -f * ab / w, -f * (aa * a + ab * b) / w
        by_u[r, 1, 0], by_u[r, 1, 1], by_u[r, 1, 2] = -f * ab / w, -f * bb / w, -f * (ab * a + bb * b) / w
        J = by_camera[r]
        J[0, 0], J[1, 0] = a * L, b * L
        J[0, 1], J[1, 1] = f * q * a, f * q * b
        J[0, 2], J[1, 2] = f * q * q * a, f * q * q * b
        for j in range(3, J.shape[1]):
            J[0, j], J[1, j] = 0.0, 0.0
