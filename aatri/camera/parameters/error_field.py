"""Image-error field: what a set of additional parameters does over the format, with its standard deviation.

The image error is what the camera added to the ideal coordinates, the negative of the correction: e = -K p. Its
covariance is K C K'. What an orientation of the single image would take up over flat terrain (shift, scale, rotation,
tilts) says nothing of the camera's quality; `shape_mm` is the field without it, by least squares over the grid. It
makes fields of different sets comparable.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.exterior_effects import exterior_effects, format_grid
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale


@dataclass(frozen=True)
class ErrorField:
    """Image-error field on a regular grid."""

    xy_mm: Float
    """(n, 2), mm. From the nominal principal point; x varies fastest."""
    error_mm: Float
    """(n, 2), mm. Image error."""
    sigma_mm: Float
    """(n, 2), mm. Its standard deviation; NaN where the covariance is."""
    shape_mm: Float
    """(n, 2), mm. Image error without the effects of the exterior orientation."""


def image_error_field(
    parameter_set: ParameterSet, scale: SetScale, values_mm: Float, covariance_mm2: Float, n: int = 15
) -> ErrorField:
    """Evaluate a set over the format.

    Parameters
    ----------
    values_mm : (s,) float64, mm
    covariance_mm2 : (s, s) float64, mm^2
    n : int
        Grid points in each direction.
    """
    xy = format_grid(scale, n)
    K = parameter_set.basis(xy, scale)
    error = -K @ values_mm
    sigma = np.sqrt(np.maximum(np.einsum("nis,st,nit->ni", K, covariance_mm2, K), 0.0))
    return ErrorField(xy, error, sigma, without_exterior(xy, error, scale.principal_distance_mm))


def without_exterior(xy_mm: Float, field_mm: Float, principal_distance_mm: float) -> Float:
    """A field of displacements less its best fit by the exterior orientation over flat terrain.

    Parameters
    ----------
    xy_mm, field_mm : (n, 2) float64, mm

    Returns
    -------
    (n, 2) float64, mm
    """
    design = exterior_effects(xy_mm, principal_distance_mm).reshape(2 * len(xy_mm), -1)
    fit = np.linalg.lstsq(design, field_mm.ravel(), rcond=None)[0]
    return np.asarray(field_mm - (design @ fit).reshape(-1, 2))
