"""Coordinates from one declared frame to another, by pyproj.

Positions go through the best transformation pyproj has, and only through it: a missing geoid or datum grid is an
error, not a silent shift of metres. Covariances follow by the derivative D of the conversion, D C D'. Covariances of
latitude, longitude, height are in metres along north, east, up: there D is the change in the target frame per metre on
the ellipsoid along those axes.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.frames.axes import in_right_handed_order
from aatri.frames.crs_text import crs_from
from aatri.frames.ellipsoid import Ellipsoid, geocentric

_DEGREE_M = 111_000.0
_STEP_M = 1.0


@dataclass(frozen=True)
class Frame:
    """A declared frame: axes in the order of its tables, and coordinate reference systems as pyproj reads them."""

    name: str
    axes: tuple[str, ...]
    crs: str
    vertical: str = ""

    @property
    def geographic(self) -> bool:
        """Whether the axes are latitude, longitude, height."""
        return "latitude" in self.axes


WGS84 = Frame("wgs84", ("longitude", "latitude", "height"), "EPSG:4979")


def convert(xyz: Float, covariance_m2: Float, source: Frame, target: Frame) -> tuple[Float, Float]:
    """Convert coordinates with covariances.

    Parameters
    ----------
    xyz : (n, 3) float64, m, or degrees where geographic
        In the order of the source's axes.
    covariance_m2 : (n, 3, 3) float64, m^2
        In the order of the source's axes.
    source, target : Frame
        The target is not geographic.

    Returns
    -------
    xyz : (n, 3) float64, m
        East, north, up (or x, y, z) of the target.
    covariance_m2 : (n, 3, 3) float64, m^2

    Raises
    ------
    InputError
        If pyproj is not installed, a frame is local or not understood, or a transformation grid is missing.
    """
    converted, derivative = with_derivatives(xyz, source, target)
    covariance = in_right_handed_order(covariance_m2, source.axes)
    return converted, derivative @ covariance @ derivative.transpose(0, 2, 1)


def with_derivatives(xyz: Float, source: Frame, target: Frame) -> tuple[Float, Float]:
    """Coordinates converted as by `convert`, and their derivatives by metres along the right-handed axes of the source.

    Returns
    -------
    xyz : (n, 3) float64, m
    derivatives : (n, 3, 3) float64
    """
    transformer = transformer_between(source, target)
    ordered = in_right_handed_order(xyz, source.axes)
    converted = _apply(transformer, ordered, source, target)
    step = np.full(len(ordered), _STEP_M / _DEGREE_M) if source.geographic else np.full(len(ordered), _STEP_M)
    columns = []
    for k in range(3):
        shift = np.zeros_like(ordered)
        shift[:, k] = _STEP_M if k == 2 else step
        if source.geographic and k == 0:
            shift[:, 0] /= np.cos(np.radians(ordered[:, 1]))
        ahead = _apply(transformer, ordered + shift, source, target)
        back = _apply(transformer, ordered - shift, source, target)
        change = ahead - back
        length = _apart(source, ordered + shift, ordered - shift) if source.geographic else 2 * _STEP_M
        columns.append(change / length)
    return converted, np.stack(columns, axis=-1)


def _apart(source: Frame, a: Float, b: Float) -> Float:
    """Distances in metres of places given by longitude, latitude and height, (n, 1)."""
    body = crs_of(source).geodetic_crs.ellipsoid
    major, minor = body.semi_major_metre, body.semi_minor_metre
    ellipsoid = Ellipsoid(major, (major**2 - minor**2) / major**2)
    return np.asarray(np.linalg.norm(geocentric(a, ellipsoid) - geocentric(b, ellipsoid), axis=1, keepdims=True))


def _apply(transformer: Any, xyz: Float, source: Frame, target: Frame) -> Float:
    try:
        result = transformer.transform(xyz[:, 0], xyz[:, 1], xyz[:, 2], errcheck=True)
    except Exception as error:  # pyproj.exceptions.ProjError; pyproj is not imported here
        raise InputError(
            f"cannot convert from frame {source.name} to {target.name}: {error}",
            where=source.name,
            remedy="check crs, vertical and axes of both frames in block.yaml",
        ) from error
    converted = np.stack(result, axis=1)
    if not np.isfinite(converted).all():
        row = int(np.argwhere(~np.isfinite(converted).all(axis=1))[0, 0])
        raise InputError(
            f"{xyz[row].tolist()} of frame {source.name} has no place in {target.name}",
            where=source.name,
            remedy="check that the axes of the frame are in the order of the table",
        )
    return converted


def crs_of(frame: Frame) -> Any:
    """The coordinate reference system of a frame as pyproj has it, with its heights.

    Raises
    ------
    InputError
        If pyproj is not installed, or the frame is local or not understood.
    """
    try:
        import pyproj
    except ImportError as error:
        raise InputError(
            f"converting coordinates of frame {frame.name} needs pyproj", where=frame.name, remedy="pip install pyproj"
        ) from error
    if frame.crs == "local":
        what = f"frame {frame.name} is local: nothing can be converted from or to it"
        raise InputError(what, where=frame.name, remedy="give its crs in block.yaml")
    try:
        system = crs_from(frame.crs)
        if frame.vertical:
            vertical = crs_from(frame.vertical)
            horizontal = system.to_2d()
            return pyproj.crs.CompoundCRS(f"{horizontal.name} + {vertical.name}", [horizontal, vertical])
        return system if system.is_geocentric or system.is_compound else system.to_3d()
    except pyproj.exceptions.CRSError as error:
        raise InputError(
            f"crs of frame {frame.name} is not understood: {error}",
            where=frame.name,
            remedy="write it as EPSG:32650, PROJ or WKT text",
        ) from error


def transformer_between(source: Frame, target: Frame) -> Any:
    """The transformation of pyproj from one frame to another: the best one, with all its grids, or none.

    Raises
    ------
    InputError
        If a frame is not understood, or a grid is missing.
    """
    systems = [crs_of(frame) for frame in (source, target)]
    from pyproj.transformer import Transformer

    try:
        return Transformer.from_crs(systems[0], systems[1], always_xy=True, only_best=True, allow_ballpark=False)
    except Exception as error:
        what = f"no transformation from frame {source.name} to {target.name}"
        if not (grids := _missing_grids(systems)):
            raise InputError(f"{what}: {error}", where=source.name, remedy="use other frames") from error
        names, urls = ", ".join(grids), ", ".join(grids.values())
        by_path = "of files of other programs, give its path as `geoid` of the source in place of `vertical`"
        remedy = f"get {urls} and install it (projsync --file {names}); or, {by_path}"
        raise InputError(f"{what}: the grid {names} is not there", where=source.name, remedy=remedy) from error


def _missing_grids(systems: list[Any]) -> dict[str, str]:
    """Names of the grids that the best transformation lacks, if any, with where they are to be had."""
    from pyproj.exceptions import ProjError
    from pyproj.transformer import TransformerGroup

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that the best one is not available
            group = TransformerGroup(systems[0], systems[1], always_xy=True)
    except ProjError:
        return {}
    best = group.unavailable_operations[:1]
    return {grid.short_name: grid.url for of_best in best for grid in of_best.grids if not grid.available}
