"""Physical parameters: Brown-Conrady, and Brown's 21.

brown_conrady, classical values c, x0, y0, k1-k3, p1, p2, b1, b2 as in `aatri.camera.models.brown`:

    dx = -x dc/c0 - dx0 + x (k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 x^2) + 2 p2 x y + b1 x + b2 y
    dy = -y dc/c0 - dy0 + y (k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 y^2)

c0 is the nominal principal distance. This linear form is exact in the interior orientation if read backwards: with
g = 1 / (1 - dc/c0) the camera has c = c0 g, x0 = g dx0, y0 = g dy0 (`interior_orientation`), and its k, p, b
are the set's times g, about the nominal principal point. Adjusting again with the new values as nominal ones carries
dc, dx0, dy0 to zero and the rest to its usual definition.

brown21, f the principal distance:

    dx = a1 x + a2 y + a3 x y + a4 y^2 + a5 x^2 y + a6 x y^2 + a7 x^2 y^2 + x/f [a13 (x^2 - y^2) + a14 x^2 y^2
         + a15 (x^4 - y^4)] + x [a16 r^2 + a17 r^4 + a18 r^6] + a19 + a21 x/f
    dy = a8 x y + a9 x^2 + a10 x^2 y + a11 x y^2 + a12 x^2 y^2 + y/f [as above] + y [as above] + a20 + a21 y/f

a1-a12 film deformation and what is not radial, a13-a15 flatness of the platen, a16-a18 symmetric radial distortion,
a19-a21 interior orientation. On flat terrain a19, a20, a21 cannot be told from X0, Y0, Z0.

Source: Brown 1971 and 1976; lecture notes of Wuhan University on bundle block adjustment, there with the sign of
x = projection + dx.
"""

import numpy as np

from aatri.arrays import Float
from aatri.camera.models.brown import brown_basis
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale


def interior_orientation(c0_mm: float, dc_dx0_dy0_mm: Float) -> tuple[Float, Float]:
    """Principal distance and point of the camera from the linear parameters c, x0, y0.

    Parameters
    ----------
    c0_mm : float, mm
        Nominal principal distance.
    dc_dx0_dy0_mm : (3,) float64, mm

    Returns
    -------
    (3,) float64, mm
        c; x0 and y0 from the nominal principal point.
    (3, 3) float64
        Derivative with respect to the parameters, for the covariance.
    """
    dc, dx0, dy0 = dc_dx0_dy0_mm
    g = 1.0 / (1.0 - dc / c0_mm)
    by_dc = g * g / c0_mm
    derivative = np.array([[g * g, 0.0, 0.0], [by_dc * dx0, g, 0.0], [by_dc * dy0, 0.0, g]])
    return np.array([c0_mm * g, g * dx0, g * dy0]), derivative


def _conrady_basis(xy_mm: Float, scale: SetScale) -> Float:
    interior = np.zeros((len(xy_mm), 2, 3), dtype=xy_mm.dtype)
    interior[:, :, 0] = -xy_mm / scale.principal_distance_mm
    interior[:, 0, 1] = interior[:, 1, 2] = -1.0
    return np.concatenate([interior, brown_basis(xy_mm) * _conrady_factors(scale)[3:]], axis=2)


def _conrady_factors(scale: SetScale) -> Float:
    return np.asarray(scale.radius_mm ** -np.array([0.0, 0, 0, 3, 5, 7, 2, 2, 1, 1]))


BROWN_CONRADY = ParameterSet(
    name="brown_conrady",
    parameters=("c", "x0", "y0", "k1", "k2", "k3", "p1", "p2", "b1", "b2"),
    units=("mm", "mm", "mm", "mm^-2", "mm^-4", "mm^-6", "mm^-1", "mm^-1", "1", "1"),
    basis=_conrady_basis,
    classical_factors=_conrady_factors,
)


def _brown21_basis(xy_mm: Float, scale: SetScale) -> Float:
    x, y = (xy_mm / scale.radius_mm).T
    r2 = x**2 + y**2
    one, zero = np.ones_like(x), np.zeros_like(x)
    film_x = [x, y, x * y, y**2, x**2 * y, x * y**2, x**2 * y**2]
    film_y = [x * y, x**2, x**2 * y, x * y**2, x**2 * y**2]
    central = [x**2 - y**2, x**2 * y**2, x**4 - y**4, r2, r2**2, r2**3]
    dx = [*film_x, *[zero] * 5, *(x * term for term in central), one, zero, x]
    dy = [*[zero] * 7, *film_y, *(y * term for term in central), zero, one, y]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)


_DEGREE_21 = np.array([1, 1, 2, 2, 3, 3, 4, 2, 2, 3, 3, 4, 3, 5, 5, 3, 5, 7, 0, 0, 1])
_OVER_F_21 = np.isin(np.arange(1, 22), (13, 14, 15, 21))
_UNITS_21 = {0: "mm", 1: "1", 2: "mm^-1", 3: "mm^-2", 4: "mm^-3", 5: "mm^-4", 7: "mm^-6"}


def _brown21_factors(scale: SetScale) -> Float:
    factors = scale.radius_mm ** -_DEGREE_21.astype(np.float64)
    return np.asarray(np.where(_OVER_F_21, factors * scale.principal_distance_mm, factors))


BROWN21 = ParameterSet(
    name="brown21",
    parameters=tuple(f"a{i}" for i in range(1, 22)),
    units=tuple(_UNITS_21[int(degree - over_f)] for degree, over_f in zip(_DEGREE_21, _OVER_F_21)),
    basis=_brown21_basis,
    classical_factors=_brown21_factors,
)
