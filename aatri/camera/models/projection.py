"""Forward camera models: from a point in image axes to photo coordinates, with exact derivatives.

u = R'(X - X0), photo axes: x right, y up, the camera looks along -z, so that u3 < 0 in front. Coordinates are
photo coordinates from the nominal principal point, in the unit of the principal distance (mm, or px).

    pinhole   x = x0 - c u1/u3,  y = y0 - c u2/u3                                    c x0 y0
    bal       p = -(u1, u2)/u3,  xy = f (1 + k1 r^2 + k2 r^4) p                      f k1 k2
    opencv    (a, b) = (-u1/u3, u2/u3) distorted (b down),  x = x0 + c a_d,  y = y0 - c q b_d
                                                                                     c q x0 y0 k1 k2 p1 p2 k3 k4 k5 k6
    polynomial                       the same, distorted by its terms                c q x0 y0 k1 ... k7 p1 p2 a1 a2 b2
    fisheye   theta = angle between (u1, u2, u3) and (0, 0, -1), r_d = theta (1 + k1 theta^2 + ... + k4 theta^8),
              (a_d, b_d) = r_d (u1, u2)/|u1, u2|,  x = x0 + c a_d,  y = y0 + c q b_d    c q x0 y0 k1 k2 k3 k4

q is the ratio of the principal distances fy/fx, 1 for square pixels. bal is Bundler's model as it is: its camera too
looks along -z with y up. The fisheye also takes points beside and behind the camera (theta beyond 90 degrees), all but
those on its axis backwards. The distortions are those of `forward_models`.

Every function takes u (n, 3) and parameters (s,) or (n, s) in the order of `PARAMETERS`, and returns xy (n, 2),
d xy/du (n, 2, 3) and d xy/dparameters (n, 2, s).

Source: Agarwal et al. 2010; OpenCV documentation, calib3d; Kannala & Brandt 2006.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.camera.models import forward_models

Array = npt.NDArray[Any]
Projected = tuple[Array, Array, Array]

PARAMETERS: dict[str, tuple[str, ...]] = {
    "pinhole": ("c", "x0", "y0"),
    "bal": ("f", *forward_models.PARAMETERS["bal"]),
    "opencv": ("c", "q", "x0", "y0", *forward_models.PARAMETERS["opencv"]),
    "polynomial": ("c", "q", "x0", "y0", *forward_models.PARAMETERS["polynomial"]),
    "fisheye": ("c", "q", "x0", "y0", *forward_models.PARAMETERS["fisheye"]),
}
"""Parameters of each model, in order."""

Y_DOWN = np.array([1.0, -1.0])


def pinhole(u: Array, parameters: Array) -> Projected:
    """Central projection."""
    c, x0, y0 = _columns(parameters, "pinhole")
    p, p_by_u = _normalised(u)
    xy = c[:, None] * p + np.stack([x0, y0], axis=1)
    by_parameters = np.zeros((len(u), 2, 3), dtype=xy.dtype)
    by_parameters[:, :, 0] = p
    by_parameters[:, 0, 1] = by_parameters[:, 1, 2] = 1.0
    return xy, c[:, None, None] * p_by_u, by_parameters


def bal(u: Array, parameters: Array) -> Projected:
    """Bundler's model: one focal length, two radial terms."""
    f, k1, k2 = _columns(parameters, "bal")
    p, p_by_u = _normalised(u)
    distorted, by_p = forward_models.bal(p, {"k1": k1, "k2": k2})
    q = (p**2).sum(axis=1)[:, None]
    by_parameters = np.stack([distorted, f[:, None] * q * p, f[:, None] * q**2 * p], axis=2)
    return f[:, None] * distorted, f[:, None, None] * (by_p @ p_by_u), by_parameters


def opencv(u: Array, parameters: Array) -> Projected:
    """OpenCV's rational model with tangential terms."""
    return _of_plane(u, parameters, "opencv", forward_models.opencv_by_parameters)


def polynomial(u: Array, parameters: Array) -> Projected:
    """Powers of r^2 with tangential terms, affinity and shear."""
    return _of_plane(u, parameters, "polynomial", forward_models.polynomial_by_parameters)


def _of_plane(
    u: Array, parameters: Array, model: str, by_parameters: Callable[[Array, forward_models.Parameters], Array]
) -> Projected:
    """A model that distorts normalised coordinates, v down."""
    c, q, x0, y0, *rest = _columns(parameters, model)
    p, p_by_u = _normalised(u)
    ab, ab_by_u = p * Y_DOWN, p_by_u * Y_DOWN[:, None]
    values = dict(zip(forward_models.PARAMETERS[model], rest))
    distorted, by_ab = forward_models.MODELS[model](ab, values)
    by_k = by_parameters(ab, values)
    return _affine(c, q, x0, y0, distorted * Y_DOWN, (by_ab @ ab_by_u) * Y_DOWN[:, None], by_k * Y_DOWN[:, None])


def fisheye(u: Array, parameters: Array) -> Projected:
    """Kannala and Brandt's model."""
    c, q, x0, y0, *k = _columns(parameters, "fisheye")
    return _affine(c, q, x0, y0, *forward_models.fisheye_of_rays(u, k))


MODELS: dict[str, Callable[[Array, Array], Projected]] = {
    "pinhole": pinhole,
    "bal": bal,
    "opencv": opencv,
    "polynomial": polynomial,
    "fisheye": fisheye,
}
"""Forward models by name."""


def _columns(parameters: Array, model: str) -> list[Array]:
    return [np.atleast_1d(column) for column in np.moveaxis(parameters, -1, 0)[: len(PARAMETERS[model])]]


def _normalised(u: Array) -> tuple[Array, Array]:
    """p = -(u1, u2)/u3 and its derivative (n, 2, 3)."""
    p = -u[:, :2] / u[:, 2:]
    by_u = np.zeros((len(u), 2, 3), dtype=p.dtype)
    by_u[:, 0, 0] = by_u[:, 1, 1] = -1 / u[:, 2]
    by_u[:, :, 2] = -p / u[:, 2:]
    return p, by_u


def _affine(c: Array, q: Array, x0: Array, y0: Array, d: Array, d_by_u: Array, d_by_k: Array) -> Projected:
    """xy = (x0 + c d1, y0 + c q d2) of the distorted d, with derivatives to c, q, x0, y0 and the distortion's."""
    n = len(d)
    factors = np.stack(np.broadcast_arrays(c, c * q, d[:, 0])[:2], axis=1)
    xy = factors * d + np.stack([x0, y0], axis=1)
    interior = np.zeros((n, 2, 4), dtype=xy.dtype)
    interior[:, 0, 0], interior[:, 1, 0] = d[:, 0], q * d[:, 1]
    interior[:, 1, 1] = c * d[:, 1]
    interior[:, 0, 2] = interior[:, 1, 3] = 1.0
    return xy, factors[:, :, None] * d_by_u, np.concatenate([interior, factors[:, :, None] * d_by_k], axis=2)
