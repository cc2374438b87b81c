"""A set of additional parameters in parts: which of its parameters a camera, a flight, a session or an image shares.

    p = (p_camera, p_flight, p_session, p_image),    (x, y) + sum of K_part p_part = projection

c, x0 and y0 of a lens that is refocused or hit change from image to image while its distortion stays: the former are
image-variant, the latter block-invariant. Each part is a group of unknowns of its own; that of the images joins them
in the order of elimination, so that it fills nothing in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from aatri.adapters.bundle.camera_parameters import Unit
from aatri.camera.parameters.parameter_set import ParameterSet, chosen
from aatri.errors import SpecError
from aatri.observations.poses import ADDITIONAL

UNITS: tuple[Unit, ...] = ("camera", "flight", "session", "image")
"""From what most images share to what none do."""

Per = Unit | Mapping[Unit, Sequence[str]]


@dataclass(frozen=True)
class SetPart:
    """Parameters of a set that share their unit.

    Attributes
    ----------
    group : str
        Name of the group of unknowns.
    per : str
        camera, flight, session or image.
    parameters : ParameterSet
        The set with these parameters only.
    """

    group: str
    per: Unit
    parameters: ParameterSet


def parts_of_set(parameters: ParameterSet, per: Per) -> tuple[SetPart, ...]:
    """The parts of a set.

    Parameters
    ----------
    parameters : ParameterSet
    per : str or mapping
        What shares all parameters, or what shares which of them; parameters that are not named are left out.

    Raises
    ------
    SpecError
        If a name is not one of the set, or is given twice.
    """
    if isinstance(per, str):
        return (SetPart(ADDITIONAL, per, parameters),)
    named = [name for unit in UNITS for name in per.get(unit, ())]
    twice = sorted({name for name in named if named.count(name) > 1})
    if twice or not named:
        what = f"names {', '.join(twice)} twice" if twice else "names no parameter"
        raise SpecError(f"self_calibration.per {what}", remedy="per: {camera: [k1, k2], image: [x0, y0]}")
    units = [unit for unit in UNITS if per.get(unit)]
    groups = [ADDITIONAL, *(f"{ADDITIONAL} per {unit}" for unit in units[1:])]
    return tuple(SetPart(g, unit, chosen(parameters, list(per[unit]))) for g, unit in zip(groups, units))


def names_of_parts(parts: Sequence[SetPart]) -> str:
    """What shares which parameters, as text."""
    if len(parts) == 1:
        return f"per {parts[0].per}"
    return "; ".join(f"{', '.join(p.parameters.parameters)} per {p.per}" for p in parts)
