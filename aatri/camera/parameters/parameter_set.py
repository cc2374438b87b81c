"""Sets of additional parameters: a correction added to the measured photo coordinates, linear in its parameters.

    (x, y) + K(x, y) p = projection with the nominal principal distance        p (s,) in mm, K (2, s) without unit

x, y are the measured coordinates from the nominal principal point, of a set that is `ideal` the corrected ones. So K is
a constant matrix of each image point, and the derivative of the residual (projection minus corrected measurement) with
respect to p is -K. Programs and notes that write `x = projection + dx` have parameters of the other sign.

Every term is scaled so that its parameter is a length in mm: about the correction it makes near the border of the
format. Parameters are then of comparable size, one standard deviation a priori serves all, and the normal matrix is
balanced. The classical value (K1 in mm^-2 ...) is the parameter times `classical_factors`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.errors import ConvergenceError, SpecError
from aatri.ids import did_you_mean


@dataclass(frozen=True)
class SetScale:
    """What the terms of a set are scaled with: one camera's format."""

    principal_distance_mm: float
    """Nominal."""
    half_format_mm: tuple[float, float]
    """(float, float), mm. Half width and half height of the format."""
    base_mm: float
    """Photo base b of Ebner's grid, x and y in {0, +-b}."""

    @property
    def radius_mm(self) -> float:
        """Half the diagonal of the format: no power of x/radius or r/radius exceeds 1 in the image."""
        return float(np.hypot(*self.half_format_mm))


MOST_ROUNDS = 50
"""Of solving for ideal coordinates; each leaves some per cent of the error."""

Basis = Callable[[Float, SetScale], Float]
Factors = Callable[[SetScale], Float]


def no_classical_values(count: int) -> Factors:
    """Factors of a set whose parameters are used as they are."""
    return lambda _: np.ones(count)


@dataclass(frozen=True)
class ParameterSet:
    """One set of additional parameters."""

    name: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    """Units of the classical values; the parameters themselves are in mm."""
    basis: Basis
    """(xy_mm (n, 2) from the nominal principal point, SetScale) -> K (n, 2, s)."""
    classical_factors: Factors
    """SetScale -> (s,): classical value = factor times parameter."""
    ideal: bool = False
    """K is that of the ideal coordinates, (x, y) + K p themselves: an adjustment forms it anew as p becomes known."""

    def __len__(self) -> int:
        return len(self.parameters)


def scale_of_format(half_format_mm: npt.ArrayLike, principal_distance_mm: float, base_mm: float = np.nan) -> SetScale:
    """Scale of a camera; without a photo base that of 60 % overlap along the shorter side, 0.8 of its half.

    Parameters
    ----------
    half_format_mm : (2,) float64, mm
    principal_distance_mm : float, mm
    base_mm : float, mm, optional

    Raises
    ------
    SpecError
        If the format, the principal distance or the base is not a positive number.
    """
    width, height = (float(h) for h in np.asarray(half_format_mm, dtype=np.float64))
    base = 0.8 * min(width, height) if np.isnan(base_mm) else float(base_mm)
    for what, value in (
        ("principal distance", principal_distance_mm),
        ("half format", min(width, height)),
        ("photo base", base),
    ):
        if not (np.isfinite(value) and value > 0):
            raise SpecError(
                f"{what} is {value} mm: additional parameters cannot be scaled",
                remedy="give the camera's principal distance and format",
            )
    return SetScale(float(principal_distance_mm), (width, height), base)


def chosen(parameter_set: ParameterSet, names: Sequence[str]) -> ParameterSet:
    """The set with only the parameters named, in the set's order.

    Raises
    ------
    SpecError
        If a name is not in the set.
    """
    for name in names:
        if name not in parameter_set.parameters:
            raise SpecError(
                f"{parameter_set.name} has no parameter {name!r}{did_you_mean(name, parameter_set.parameters)}",
                remedy=f"its parameters are {', '.join(parameter_set.parameters)}",
            )
    rows = [i for i, name in enumerate(parameter_set.parameters) if name in names]
    return replace(
        parameter_set,
        parameters=tuple(parameter_set.parameters[i] for i in rows),
        units=tuple(parameter_set.units[i] for i in rows),
        basis=lambda xy_mm, scale: parameter_set.basis(xy_mm, scale)[:, :, rows],
        classical_factors=lambda scale: parameter_set.classical_factors(scale)[rows],
    )


def correction(parameter_set: ParameterSet, scale: SetScale, values_mm: Float, xy_mm: Float) -> Float:
    """Correction to add to measured coordinates.

    Parameters
    ----------
    values_mm : (s,) float64, mm
    xy_mm : (n, 2) float64, mm, from the nominal principal point

    Returns
    -------
    (n, 2) float64, mm

    Raises
    ------
    ConvergenceError
        If the terms are of ideal coordinates, and too steep to be solved for them.
    """
    change = np.asarray(parameter_set.basis(xy_mm, scale) @ values_mm)
    for _ in range(MOST_ROUNDS if parameter_set.ideal else 0):
        before, change = change, np.asarray(parameter_set.basis(xy_mm + change, scale) @ values_mm)
        if np.nanmax(np.abs(change - before), initial=0.0) <= 1e-13 * scale.radius_mm:
            return change
        if not np.nanmax(np.abs(change), initial=0.0) < 1e3 * scale.radius_mm:
            break
    if parameter_set.ideal:
        raise ConvergenceError(
            f"the correction of {parameter_set.name} cannot be solved for ideal coordinates inside the image",
            remedy="check the parameters: they are mm near the border of the format",
        )
    return change
