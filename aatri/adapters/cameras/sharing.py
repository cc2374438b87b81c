"""What shares parameters of a set, and with what scale: the camera, a flight, a session, or each image its own.

    p = (p_camera, p_flight, p_session, p_image),    (x, y) + sum of K_part p_part = projection

c, x0 and y0 of a lens that is refocused or hit change from image to image while its distortion stays: the former are
image-variant, the latter block-invariant. Each part is a group of unknowns of its own; that of the images joins them
in the order of elimination, so that it fills nothing in.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aatri.arrays import Int, Text
from aatri.artifacts.block import Block
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, chosen, scale_of_format
from aatri.errors import SpecError
from aatri.observations.poses import ADDITIONAL

Sharing = Literal["camera", "flight", "session", "image"]

SHARINGS: tuple[Sharing, ...] = ("camera", "flight", "session", "image")
"""From what most images share to what none do."""

Per = Sharing | Mapping[Sharing, Sequence[str]]


@dataclass(frozen=True)
class SharingUnits:
    """The cameras, flights, sessions or images that share parameters."""

    id: Text
    """(n,) str."""
    camera: Int
    """(n,). Camera of each unit."""
    of_image: Int
    """(n_images,)."""


def units_of(block: Block, per: Sharing) -> SharingUnits:
    """Cameras, flights or sessions of cameras, or images."""
    camera = block.images.camera
    if per == "image":
        return SharingUnits(block.images.id, camera, np.arange(len(camera)))
    if per == "camera":
        return SharingUnits(block.cameras.id, np.arange(len(block.cameras)), camera)
    part = block.images.flight if per == "flight" else block.images.session
    names = np.array([f"{block.cameras.id[c]}/{s}" for c, s in zip(camera, part)])
    ids, first, of_image = np.unique(names, return_index=True, return_inverse=True)
    return SharingUnits(ids, camera[first], of_image.ravel())


def camera_scale(block: Block, camera: int) -> SetScale:
    """Scale of the additional parameters of a camera: its format, else the extent of its measurements."""
    cameras = block.cameras
    half = 0.5 * cameras.format[camera]
    if cameras.kind[camera] == "digital":
        half = half * cameras.pixel_size_mm[camera]
    if not np.isfinite(half).all():
        of_camera = block.images.camera[block.image_points.image] == camera
        half = np.abs(block.image_points.xy[of_camera]).max(axis=0, initial=0.0)
    return scale_of_format(half, float(cameras.principal_distance_mm[camera]))


@dataclass(frozen=True)
class SetPart:
    """Parameters of a set that share their unit."""

    group: str
    """Name of the group of unknowns."""
    per: Sharing
    """camera, flight, session or image."""
    parameters: ParameterSet
    """The set with these parameters only."""


def parts_of_set(parameters: ParameterSet, per: Per) -> tuple[SetPart, ...]:
    """The parts of a set.

    Parameters
    ----------
    per : str or mapping
        What shares all parameters, or what shares which of them; parameters that are not named are left out.

    Raises
    ------
    SpecError
        If a name is not one of the set, or is given twice.
    """
    if isinstance(per, str):
        return (SetPart(ADDITIONAL, per, parameters),)
    named = [name for unit in SHARINGS for name in per.get(unit, ())]
    twice = sorted({name for name in named if named.count(name) > 1})
    if twice or not named:
        what = f"names {', '.join(twice)} twice" if twice else "names no parameter"
        raise SpecError(f"self_calibration.per {what}", remedy="per: {camera: [k1, k2], image: [x0, y0]}")
    units = [unit for unit in SHARINGS if per.get(unit)]
    groups = [ADDITIONAL, *(f"{ADDITIONAL} per {unit}" for unit in units[1:])]
    return tuple(SetPart(g, unit, chosen(parameters, list(per[unit]))) for g, unit in zip(groups, units))


def names_of_parts(parts: Sequence[SetPart]) -> str:
    """What shares which parameters, as text."""
    if len(parts) == 1:
        return f"per {parts[0].per}"
    return "; ".join(f"{', '.join(p.parameters.parameters)} per {p.per}" for p in parts)
