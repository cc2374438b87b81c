"""Parameter sets by name."""

from dataclasses import replace

import numpy as np

from aatri.camera.parameters.aicon import aicon
from aatri.camera.parameters.brown import BROWN21, BROWN_CONRADY
from aatri.camera.parameters.ebner import EBNER12, bauer3
from aatri.camera.parameters.exterior_effects import format_grid, share_in_span
from aatri.camera.parameters.fourier import fourier
from aatri.camera.parameters.orthogonal import GRUEN44, legendre
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, chosen
from aatri.errors import SpecError
from aatri.ids import did_you_mean

_FIXED = {
    "brown_conrady": BROWN_CONRADY,
    "brown21": BROWN21,
    "ebner12": EBNER12,
    "gruen44": GRUEN44,
}
_BALANCED = {"aicon": aicon, "bauer3": bauer3}
_SERIES = {"fourier": fourier, "legendre": legendre}

SETS = (*_FIXED, *_BALANCED, *_SERIES)
"""Names of the built-in sets."""


def parameter_set(
    name: str, *, orders: tuple[int, int] | None = None, balance_radius_mm: float | None = None
) -> ParameterSet:
    """A built-in set.

    Parameters
    ----------
    name : str
        One of `SETS`, or the `name` of a set of other orders or radius: `legendre 5x5`, `aicon r0=8.0`.
    orders : (int, int), optional
        Orders or degrees in x and y of `fourier` (1, 1 unless given) and `legendre` (4, 4).
    balance_radius_mm : float, mm, optional
        Of `aicon` and `bauer3`.

    Raises
    ------
    SpecError
        If the set is unknown or has no such option.
    """
    name, _, variant = name.partition(" ")
    if variant.startswith("r0="):
        balance_radius_mm = float(variant.removeprefix("r0="))
    elif variant:
        order_x, order_y = map(int, variant.split("x"))
        orders = order_x, order_y
    if name not in SETS:
        raise SpecError(
            f"parameter set {name!r} is unknown{did_you_mean(name, SETS)}", remedy=f"one of {', '.join(SETS)}"
        )
    if orders is not None and name not in _SERIES:
        raise SpecError(f"{name} has no orders", remedy=f"they belong to {' and '.join(_SERIES)}")
    if balance_radius_mm is not None and name not in _BALANCED:
        raise SpecError(f"{name} has no balance radius", remedy=f"it belongs to {' and '.join(_BALANCED)}")
    if name in _FIXED:
        return _FIXED[name]
    if name in _BALANCED:
        balanced = _BALANCED[name](balance_radius_mm)
        return balanced if balance_radius_mm is None else replace(balanced, name=f"{name} r0={balance_radius_mm!r}")
    return (
        _SERIES[name]() if orders is None else replace(_SERIES[name](*orders), name=f"{name} {orders[0]}x{orders[1]}")
    )


def is_ideal(name: str) -> bool:
    """Whether the terms of a set, told by its name, are functions of the ideal coordinates."""
    return name.partition(" ")[0] in SETS and parameter_set(name).ideal


INTERIOR = chosen(BROWN_CONRADY, ("c", "x0", "y0"))
"""Principal distance and point alone."""


def holds_interior(parameters: ParameterSet, scale: SetScale) -> bool:
    """Whether the set can describe a change of c, x0 or y0 by itself."""
    xy = format_grid(scale)
    return bool((share_in_span(INTERIOR.basis(xy, scale), parameters.basis(xy, scale)) > 1 - 1e-9).any())


def with_interior(parameters: ParameterSet) -> ParameterSet:
    """The set with c, x0 and y0 before its own parameters.

    Sets that are free of the exterior orientation leave to Z0, X0, Y0 what a lens error has in common with them. Where
    observed projection centres hold these, c, x0 and y0 must take it up.
    """
    return replace(
        parameters,
        parameters=INTERIOR.parameters + parameters.parameters,
        units=INTERIOR.units + parameters.units,
        basis=lambda xy, scale: np.concatenate([INTERIOR.basis(xy, scale), parameters.basis(xy, scale)], axis=2),
        classical_factors=lambda scale: np.concatenate(
            [INTERIOR.classical_factors(scale), parameters.classical_factors(scale)]
        ),
    )
