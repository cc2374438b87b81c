"""The local tangent frame: Cartesian, touching the ellipsoid of a declared CRS, in which a block is adjusted.

    X = A' (G - G0),    G geocentric coordinates on the ellipsoid of the CRS, G0 the origin,
                        A = (grid east, grid north, up) there, so that the axes of block and frame hardly differ

Map coordinates become geographic ones by pyproj (with the geoid grid where a vertical is declared) and geocentric ones
in closed form; so no map scale, no curvature and no convergence is left, at any height and any distance. At a place,
the block's own axes are those in which its coordinates grow:

    D = d(E, N, h) / dX      derivatives of the coordinates of the block by those of the tangent frame
    B = (east, north, up)    unit vectors of grid east, grid north and the ellipsoid normal, columns

so that covariances go over by D and its inverse, and rotations against the grid by R_tangent = B R_block. Where the
first frame of a block is geocentric, its axes are the same everywhere.

`undulation_m` stands for a geoid grid that is missing: one number, whose slope is neglected.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.frames import ellipsoid
from aatri.frames.conversion import Frame, crs_of, transformer_between
from aatri.frames.ellipsoid import Ellipsoid

STEP_M = 100.0
"""Step of the difference quotients of maps: of relative error (step / R)^2 / 6 = 4e-11, rounding 1e-11."""


@dataclass(frozen=True)
class TangentFrame:
    """A tangent frame of a declared frame."""

    source: Frame
    """The frame of the block, axes in right-handed order."""
    undulation_m: float
    """Added to heights in place of a geoid grid; 0 none."""
    body: Ellipsoid
    origin_m: Float
    """(3,), m. Geocentric."""
    axes: Float
    """(3, 3). Grid east, grid north, up at the origin, columns, geocentric."""

    @property
    def geocentric(self) -> bool:
        """Whether the block's own coordinates are geocentric."""
        return "x" in self.source.axes

    def from_block(self, xyz: Float) -> Float:
        """Coordinates of the tangent frame, (n, 3) m; rows that are not finite stay NaN."""
        converted = np.full(xyz.shape, np.nan)
        finite = np.isfinite(xyz).all(axis=1)
        coordinates = xyz[finite]
        G = coordinates if self.geocentric else ellipsoid.geocentric(self._to_geographic(coordinates), self.body)
        converted[finite] = (G - self.origin_m) @ self.axes
        return converted

    def to_block(self, xyz_m: Float) -> Float:
        """Coordinates of the block, (n, 3) m: the inverse of `from_block`."""
        converted = np.full(xyz_m.shape, np.nan)
        finite = np.isfinite(xyz_m).all(axis=1)
        G = xyz_m[finite] @ self.axes.T + self.origin_m
        converted[finite] = G if self.geocentric else self._from_geographic(ellipsoid.geographic(G, self.body))
        return converted

    def derivatives_at(self, xyz_m: Float) -> Float:
        """D: derivatives of the coordinates of the block at places of the tangent frame, (n, 3, 3)."""
        if self.geocentric:
            return np.broadcast_to(self.axes, (len(xyz_m), 3, 3)).copy()
        steps = STEP_M * np.concatenate([np.eye(3), -np.eye(3)])
        ahead, behind = self.to_block((xyz_m + steps[:, None]).reshape(-1, 3)).reshape(2, 3, -1, 3)
        return np.moveaxis(ahead - behind, 0, -1) / (2 * STEP_M)

    def axes_at(self, xyz_m: Float) -> Float:
        """B: grid east, grid north and up at places of the tangent frame, (n, 3, 3), columns.

        Grid north is the direction in which the east coordinate and the height do not change. NaN where the map has
        no such place.
        """
        return self.axes_of(self.derivatives_at(xyz_m), xyz_m)

    def axes_of(self, D: Float, xyz_m: Float) -> Float:
        """B at places of the tangent frame, where the derivatives D there are computed already."""
        if self.geocentric:
            return np.broadcast_to(self.axes.T, (len(xyz_m), 3, 3)).copy()
        with np.errstate(invalid="ignore"):
            north = np.sign(np.linalg.det(D))[:, None] * np.cross(D[:, 2], D[:, 0])
            return _frame_of(north, self.up_at(xyz_m))

    def true_axes_at(self, xyz_m: Float) -> Float:
        """East, north (true) and up at places of the tangent frame, (n, 3, 3), columns."""
        pole = np.broadcast_to(self.axes[2], xyz_m.shape)
        return _frame_of(pole, self.up_at(xyz_m))

    def up_at(self, xyz_m: Any) -> Any:
        """Ellipsoid normals at places of the tangent frame, (n, 3); also of complex numbers."""
        return ellipsoid.normal_and_height(xyz_m @ self.axes.T + self.origin_m, self.body)[0] @ self.axes

    def height_at(self, xyz_m: Any) -> Any:
        """Ellipsoidal heights of places of the tangent frame, (n,) m; also of complex numbers."""
        return ellipsoid.normal_and_height(xyz_m @ self.axes.T + self.origin_m, self.body)[1]

    def _to_geographic(self, xyz: Float) -> Float:
        raised = xyz + np.array([0.0, 0.0, self.undulation_m])
        converted = np.stack(_transformer(self.source).transform(*raised.T), axis=1)
        return np.where(np.isfinite(converted), converted, np.nan)

    def _from_geographic(self, degrees: Float) -> Float:
        converted = np.stack(_transformer(self.source).transform(*degrees.T, direction="INVERSE"), axis=1)
        converted = np.where(np.isfinite(converted), converted, np.nan)  # a place that the map does not have
        return np.asarray(converted - np.array([0.0, 0.0, self.undulation_m]))


def _frame_of(north: Float, up: Float) -> Float:
    """Right-handed axes with the given up, and north as near as can be, columns, (n, 3, 3)."""
    east = np.cross(north, up)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    return np.stack([east, np.cross(up, east), up], axis=-1)


def tangent_frame(source: Frame, centre: Float, undulation_m: float = 0.0) -> TangentFrame:
    """The tangent frame at a place of a declared frame.

    Parameters
    ----------
    source : Frame
        Right-handed; with an undulation the vertical is left aside.
    centre : (3,) float64, m
        Coordinates of the origin in the declared frame.
    undulation_m : float, m

    Raises
    ------
    InputError
        If the frame cannot be converted: an unknown code, or a missing grid.
    """
    body = crs_of(source).geodetic_crs.ellipsoid
    a, b = body.semi_major_metre, body.semi_minor_metre
    frame = TangentFrame(source, undulation_m, Ellipsoid(a, (a * a - b * b) / (a * a)), np.zeros(3), np.eye(3))
    if frame.geocentric:
        G = np.asarray(centre, dtype=np.float64)[None]
    else:
        G = ellipsoid.geocentric(frame._to_geographic(np.asarray(centre, dtype=np.float64)[None]), frame.body)
    if not np.isfinite(G).all():
        raise InputError(
            f"{centre.tolist()} has no place in frame {source.name}",
            where=source.name,
            remedy="check crs, vertical and axes of the frame in block.yaml",
        )
    longitude, latitude, _ = ellipsoid.geographic(G, frame.body)[0]
    frame = TangentFrame(source, undulation_m, frame.body, G[0], ellipsoid.local_axes(longitude, latitude))
    if frame.geocentric:
        return frame
    return replace(frame, axes=frame.axes @ frame.axes_at(np.zeros((1, 3)))[0])


@lru_cache(maxsize=8)
def _transformer(source: Frame) -> Any:
    """From a declared frame to geographic coordinates of its own datum: longitude, latitude, height."""
    body = crs_of(source).geodetic_crs
    target = Frame(f"geographic coordinates of {source.name}", ("longitude", "latitude", "height"), body.to_wkt())
    return transformer_between(source, target)


def check_convertible(source: Frame) -> None:
    """Whether coordinates of a frame can be converted to geocentric ones.

    Raises
    ------
    InputError
        Naming the grid that is missing.
    """
    _transformer(source)
