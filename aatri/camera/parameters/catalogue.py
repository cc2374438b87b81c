"""Parameter sets by name."""

from __future__ import annotations

from aatri.camera.parameters.brown import BROWN21, BROWN_CONRADY
from aatri.camera.parameters.ebner import EBNER12, bauer3
from aatri.camera.parameters.fourier import fourier
from aatri.camera.parameters.orthogonal import GRUEN44, legendre
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.errors import SpecError
from aatri.ids import did_you_mean

SETS = ("brown_conrady", "brown21", "ebner12", "gruen44", "bauer3", "fourier", "legendre")
"""Names of the built-in sets."""

_FIXED = {s.name: s for s in (BROWN_CONRADY, BROWN21, EBNER12, GRUEN44)}
_DEFAULT_ORDERS = {"fourier": (1, 1), "legendre": (4, 4)}


def parameter_set(
    name: str, *, orders: tuple[int, int] | None = None, balance_radius_mm: float | None = None
) -> ParameterSet:
    """A built-in set.

    Parameters
    ----------
    name : str
        One of `SETS`.
    orders : (int, int), optional
        Orders or degrees in x and y of `fourier` (1, 1 unless given) and `legendre` (4, 4).
    balance_radius_mm : float, mm, optional
        Of `bauer3`.

    Raises
    ------
    SpecError
        If the set is unknown or has no such option.
    """
    if name not in SETS:
        raise SpecError(
            f"parameter set {name!r} is unknown{did_you_mean(name, SETS)}", remedy=f"one of {', '.join(SETS)}"
        )
    if orders is not None and name not in _DEFAULT_ORDERS:
        raise SpecError(f"{name} has no orders", remedy="orders belong to fourier and legendre")
    if balance_radius_mm is not None and name != "bauer3":
        raise SpecError(f"{name} has no balance radius", remedy="it belongs to bauer3")
    if name == "bauer3":
        return bauer3(balance_radius_mm)
    if name in _FIXED:
        return _FIXED[name]
    m, n = orders or _DEFAULT_ORDERS[name]
    return fourier(m, n) if name == "fourier" else legendre(m, n)
