"""Camera models with unknown parameters: residuals of image points and their derivatives.

Forward models (`aatri.camera.models.projection`) compute the measured coordinate from the ray,

    v = model(u, p) - (x, y),

the measured-side model `brown` corrects the measurement and compares it with the central projection,

    q = ((1 + as) (x - x0), y - y0),    v = -c (u1, u2)/u3 - (q + brown(q)),

x, y being the photo coordinates from the nominal principal point in mm. `as` is DBAT's affinity (model 3), 0
otherwise; brown(q) is the correction of `aatri.camera.models.brown`. x0, y0 are small: what the principal point has
moved from the nominal one.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.camera.models import projection
from aatri.camera.models.brown import PARAMETERS as BROWN
from aatri.camera.models.brown import brown_basis, brown_derivative

Array = npt.NDArray[Any]
Residual = tuple[Array, Array, Array]

INTERIOR = ("principal_distance", "principal_point.x", "principal_point.y")
_SQUARE = (INTERIOR[0], "q", *INTERIOR[1:])

PARAMETERS: dict[str, tuple[str, ...]] = {
    "pinhole": INTERIOR,
    "brown": (*INTERIOR, "as", *BROWN),
    "bal": (INTERIOR[0], *projection.PARAMETERS["bal"][1:]),
    "opencv": (*_SQUARE, *projection.PARAMETERS["opencv"][4:]),
    "polynomial": (*_SQUARE, *projection.PARAMETERS["polynomial"][4:]),
    "fisheye": (*_SQUARE, *projection.PARAMETERS["fisheye"][4:]),
}
"""Parameters of each model, by the names of the block's camera_parameters; principal points from the nominal one."""


def residual(model: str, u: Array, xy_mm: Array, parameters: Array) -> Residual:
    """Residuals, computed minus observed, with derivatives.

    Parameters
    ----------
    model : str
        One of `PARAMETERS`.
    u : (n, 3) float64
        Ground points in the axes of their images.
    xy_mm : (n, 2) float64, mm
        Measured, from the nominal principal point.
    parameters : (n, s) float64
        In the order of `PARAMETERS`.

    Returns
    -------
    v : (n, 2) float64, mm
    by_u : (n, 2, 3) float64
    by_parameters : (n, 2, s) float64
    """
    return _MODELS[model](u, xy_mm, parameters)


def _forward(model: str) -> Callable[[Array, Array, Array], Residual]:
    function = projection.MODELS[model]

    def compared(u: Array, xy_mm: Array, parameters: Array) -> Residual:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a point in the centre has no image
            xy, by_u, by_parameters = function(u, parameters)
        return xy - xy_mm, by_u, by_parameters

    return compared


def _brown(u: Array, xy_mm: Array, parameters: Array) -> Residual:
    c, x0, y0, affinity = parameters[:, :4].T
    p = -u[:, :2] / u[:, 2:]
    by_u = np.zeros((len(u), 2, 3), dtype=p.dtype)
    by_u[:, 0, 0] = by_u[:, 1, 1] = -c / u[:, 2]
    by_u[:, :, 2] = -c[:, None] * p / u[:, 2:]
    q = np.stack([(1 + affinity) * (xy_mm[:, 0] - x0), xy_mm[:, 1] - y0], axis=1)
    basis = brown_basis(q)
    corrected = q + np.einsum("nij,nj->ni", basis, parameters[:, 4:])
    by_q = np.eye(2) + brown_derivative(q, dict(zip(BROWN, parameters[:, 4:].T)))
    q_by = np.zeros((len(q), 2, 3), dtype=q.dtype)
    q_by[:, 0, 0], q_by[:, 1, 1], q_by[:, 0, 2] = -(1 + affinity), -1.0, xy_mm[:, 0] - x0
    by_parameters = np.concatenate([p[:, :, None], -by_q @ q_by, -basis], axis=2)
    return c[:, None] * p - corrected, by_u, by_parameters


_MODELS: dict[str, Callable[[Array, Array, Array], Residual]] = {
    "brown": _brown,
    **{model: _forward(model) for model in projection.MODELS},
}
