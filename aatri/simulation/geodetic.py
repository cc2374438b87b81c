"""The real earth under the block: an ellipsoid and a map of it, by pyproj alone.

Local coordinates (E, N, h) are those of the map about the false origin and ellipsoidal heights less the undulation.
The truth is Cartesian, topocentric at the false origin: PROJ's own inverse projection, geocentric and topocentric
conversion. East, north and up of a place are its grid axes: true north from the displacement of a place by latitude,
turned by PROJ's meridian convergence. Nothing here is shared with the frames of the adjustment.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aatri.arrays import Float

STEP_DEG = 1e-3


@dataclass(frozen=True)
class GeodeticEarth:
    """A map of the ellipsoid."""

    crs: str
    """A projected CRS as pyproj reads it."""
    false_origin_m: tuple[float, float]
    """(float, float), m. Its coordinates at (0, 0) of the local ones."""
    undulation_m: float = 0.0
    """Ellipsoidal heights less heights of the block."""

    def cartesian(self, local_m: Float) -> Float:
        """Topocentric coordinates of local (E, N, h), (n, 3) m."""
        return self._topocentric_of(self._geographic(local_m))

    def local(self, cartesian_m: Float) -> Float:
        """Local (E, N, h) of topocentric coordinates: the inverse of `cartesian`."""
        longitude, latitude, height = self._topocentric.transform(*cartesian_m.T, direction="INVERSE")
        east, north = self._projection(longitude, latitude)
        origin = np.array([*self.false_origin_m, self.undulation_m])
        return np.asarray(np.stack([east, north, height], axis=1) - origin)

    def convergence_rad(self, local_m: Float) -> Float:
        """Meridian convergence at places: grid north from true north, clockwise, rad."""
        return np.asarray(np.radians(self.convergence_deg(self._geographic(local_m))))

    def on_ellipsoid(self, start_m: Float, end_m: Float) -> Float:
        """Lengths of geodesics between the places below, m, by PROJ."""
        import pyproj

        (a, b, _), (c, d, _) = self._geographic(start_m).T, self._geographic(end_m).T
        body: Any = pyproj.CRS(self.crs).ellipsoid
        return np.asarray(pyproj.Geod(a=body.semi_major_metre, rf=body.inverse_flattening).inv(a, b, c, d)[2])

    def axes(self, local_m: Float) -> Float:
        """Grid east, grid north and up of places, in the topocentric axes, (n, 3, 3), columns."""
        place = self._geographic(local_m)
        step = np.array([[0.0, STEP_DEG, 0.0]])
        north = self._topocentric_of(place + step) - self._topocentric_of(place - step)
        up = self._topocentric_of(place + np.array([[0.0, 0.0, 100.0]])) - self._topocentric_of(place)
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        north -= np.einsum("ni,ni->n", north, up)[:, None] * up
        north /= np.linalg.norm(north, axis=1, keepdims=True)
        east = np.cross(north, up)
        angle = np.radians(self.convergence_deg(place))[:, None]
        return np.stack(
            [np.cos(angle) * east - np.sin(angle) * north, np.sin(angle) * east + np.cos(angle) * north, up], axis=2
        )

    def convergence_deg(self, place: Float) -> Float:
        """Meridian convergence: grid north from true north, clockwise, degrees."""
        return np.asarray(self._projection.get_factors(place[:, 0], place[:, 1]).meridian_convergence)

    @cached_property
    def _projection(self) -> Any:
        import pyproj

        return pyproj.Proj(self.crs)

    def _geographic(self, local_m: Float) -> Float:
        """Longitude, latitude (degrees) and ellipsoidal height."""
        east, north = local_m[:, 0] + self.false_origin_m[0], local_m[:, 1] + self.false_origin_m[1]
        longitude, latitude = self._projection(east, north, inverse=True)
        return np.stack([longitude, latitude, local_m[:, 2] + self.undulation_m], axis=1)

    def _topocentric_of(self, place: Float) -> Float:
        return np.stack(self._topocentric.transform(*place.T), axis=1)

    @cached_property
    def _topocentric(self) -> Any:
        import pyproj

        longitude, latitude, _ = self._geographic(np.zeros((1, 3)))[0]
        body: Any = pyproj.CRS(self.crs).ellipsoid
        size = f"+a={body.semi_major_metre!r} +rf={body.inverse_flattening!r}"
        return pyproj.Transformer.from_pipeline(
            "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
            f"+step +proj=cart {size} +step +proj=topocentric {size} +lon_0={longitude!r} +lat_0={latitude!r} +h_0=0"
        )
