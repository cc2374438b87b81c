"""An oriented block as layers: images, footprints, strips, points, ellipses, control, in the frame of the block.

    images      projection centres; angles of R = Rx(omega) Ry(phi) Rz(kappa), standard deviations, rays
    footprints  outline of each image on the level of the terrain: the mean height of the points, or the block's
    strips      projection centres of each strip, in their sequence
    points      adjusted points with standard deviations and the ellipse of east and north: semi-axes and azimuth
    ellipses    the same as outlines, enlarged by `factor`
    control     control and check points as given, their standard deviations, and adjusted minus given coordinates

A standard deviation that is not known is empty.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.formats.limits import STEEPEST
from aatri.formats.parts.format import Content
from aatri.formats.results.column_names import angle_sigmas_deg, standard_deviations
from aatri.formats.results.exported_files import control_points
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.geometry.rotations import angles_from_rotation

PAGE = "docs/formats.md#geopackage-and-geojson"
CARRIES: tuple[Content, ...] = ("control", "check points", "start values of points", "start orientations", "strips",
                                "frame", "standard deviations")  # fmt: skip
"""What the layers have of a block."""

PER_SIDE = 8
"""Points of a footprint along a side: a distorted side is no line."""

AROUND = 36
"""Points of an ellipse."""

SHARE = 0.02
"""Share of the extent of the block that the median semi-major axis is enlarged to, at most."""


@dataclass
class Layer:
    """Features of one kind."""

    name: str
    geometry: str
    """Point, LineString or Polygon; all with heights."""
    fields: dict[str, type]
    """Columns: str, int or float."""
    shapes: list[Float] = field(default_factory=list)
    """List of (k, 3), m. Vertices of each feature; an outline ends where it begins."""
    rows: list[tuple[Any, ...]] = field(default_factory=list)
    """Values of the fields; None: not known."""

    def add(self, shape: Float, *values: Any) -> None:
        """Add a feature."""
        plain = (None if isinstance(v, float) and not np.isfinite(v) else v for v in values)
        self.shapes.append(np.atleast_2d(shape))
        self.rows.append(tuple(plain))


def layers_of(oriented: OrientedBlock) -> list[Layer]:
    """The layers of a block that have features."""
    made = [
        _footprints(oriented),
        _strips(oriented),
        _ellipses(oriented),
        _points(oriented),
        _images(oriented),
        _control(oriented),
    ]
    return [layer for layer in made if layer.shapes]


def _floats(*names: str) -> dict[str, type]:
    return dict.fromkeys(names, float)


def _images(oriented: OrientedBlock) -> Layer:
    block, solution = oriented.block, oriented.solution
    layer = Layer(
        "images",
        "Point",
        {
            "image": str,
            "camera": str,
            "strip": str,
            **_floats("omega_deg", "phi_deg", "kappa_deg"),
            **_floats("sX_m", "sY_m", "sZ_m", "somega_deg", "sphi_deg", "skappa_deg"),
            "rays": int,
        },
    )
    R, n = oriented.ground_from_image, len(block.images)
    angles, sigma = np.degrees(angles_from_rotation(R)), np.full((n, 6), np.nan)
    if solution is not None:
        of_angles = angle_sigmas_deg(solution.images, "omega-phi-kappa")
        sigma = np.column_stack([standard_deviations(solution.images.covariance)[:, :3], *of_angles.values()])
    rays = np.bincount(oriented.rays.image, minlength=n).tolist()
    for row in np.flatnonzero(np.isfinite(oriented.position_m).all(axis=1)).tolist():
        camera = str(block.cameras.id[block.images.camera[row]])
        layer.add(
            oriented.position_m[row],
            str(block.images.id[row]),
            camera,
            _strip(oriented, row),
            *angles[row].tolist(),
            *sigma[row].tolist(),
            rays[row],
        )
    return layer


def _strip(oriented: OrientedBlock, row: int) -> str | None:
    strip = int(oriented.block.images.strip[row])
    return str(oriented.block.strips.id[strip]) if strip >= 0 else None


def terrain_height_m(oriented: OrientedBlock) -> float:
    """Height of the level that footprints lie on."""
    heights = oriented.xyz_m[np.isfinite(oriented.xyz_m).all(axis=1), 2]
    return float(np.median(heights)) if len(heights) else float(oriented.block.terrain_height_m)


def _footprints(oriented: OrientedBlock) -> Layer:
    block, height_m = oriented.block, terrain_height_m(oriented)
    layer = Layer("footprints", "Polygon", {"image": str, "strip": str, **_floats("gsd_m", "height_m")})
    t = np.linspace(-1, 1, PER_SIDE, endpoint=False)
    one = np.ones(PER_SIDE)
    around = np.concatenate([np.stack(side, axis=1) for side in ((t, -one), (one, t), (-t, one), (-one, -t))])
    outlines = []
    for lens in oriented.lenses:
        uv = lens.ideal(around * np.array(lens.size_px) / 2)
        outlines.append(np.column_stack([uv * [1.0, -1.0], -np.ones(len(uv))]))
    for row in np.flatnonzero(oriented.oriented).tolist():
        lens = oriented.lenses[int(block.images.camera[row])]
        directions = outlines[int(block.images.camera[row])] @ oriented.ground_from_image[row].T
        below_m = oriented.position_m[row, 2] - height_m
        steep = -directions[:, 2] / np.linalg.norm(directions, axis=1)
        if not (np.isfinite(below_m) and below_m > 0 and (steep > STEEPEST).all()):
            continue  # sees the horizon, or stands below the terrain
        ground = oriented.position_m[row] + directions * (below_m / -directions[:, 2])[:, None]
        layer.add(
            np.vstack([ground, ground[:1]]),
            str(block.images.id[row]),
            _strip(oriented, row),
            float(below_m / lens.focal_px[0]),
            float(below_m),
        )
    return layer


def _strips(oriented: OrientedBlock) -> Layer:
    block = oriented.block
    layer = Layer("strips", "LineString", {"strip": str, "images": int})
    placed = np.isfinite(oriented.position_m).all(axis=1)
    for k, name in enumerate(block.strips.id.tolist()):
        rows = np.flatnonzero((block.images.strip == k) & placed)
        rows = rows[np.argsort(block.images.sequence[rows], kind="stable")]
        if len(rows) > 1:
            layer.add(oriented.position_m[rows], name, len(rows))
    return layer


def _covariances(oriented: OrientedBlock) -> Float:
    if oriented.solution is None:
        return np.full((len(oriented.xyz_m), 3, 3), np.nan)
    return oriented.solution.points.covariance_m2


def ellipse(covariance_m2: Float) -> tuple[float, float, float]:
    """Semi-axes a and b, m, of the standard ellipse of east and north; azimuth of a from north, degrees in [0, 180).

    Source: Mikhail and Gracie 1981, Analysis and Adjustment of Survey Measurements, 6.4.
    """
    (e, en), (_, n) = covariance_m2[:2, :2]
    half, spread = (e + n) / 2, float(np.hypot((e - n) / 2, en))
    azimuth = np.degrees(np.arctan2(2 * en, n - e)) / 2 % 180.0
    return float(np.sqrt(half + spread)), float(np.sqrt(max(half - spread, 0.0))), float(azimuth)


def _points(oriented: OrientedBlock) -> Layer:
    block, covariance = oriented.block, _covariances(oriented)
    layer = Layer(
        "points",
        "Point",
        {
            "point": str,
            "rays": int,
            **_floats("sX_m", "sY_m", "sZ_m", "a_m", "b_m", "azimuth_deg"),
        },
    )
    rays = np.bincount(oriented.rays.point, minlength=len(block.points)).tolist()
    for row in np.flatnonzero(np.isfinite(oriented.xyz_m).all(axis=1)).tolist():
        has_covariance = np.isfinite(covariance[row]).all()
        sigma = np.sqrt(np.diag(covariance[row])).tolist() if has_covariance else [np.nan] * 3
        axes = ellipse(covariance[row]) if has_covariance else (np.nan,) * 3
        layer.add(oriented.xyz_m[row], str(block.points.id[row]), rays[row], *sigma, *axes)
    return layer


def _ellipses(oriented: OrientedBlock) -> Layer:
    layer = Layer("ellipses", "Polygon", {"point": str, **_floats("a_m", "b_m", "azimuth_deg", "factor")})
    covariance, xyz = _covariances(oriented), oriented.xyz_m
    has_ellipse = np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(xyz).all(axis=1)
    axes = {row: ellipse(covariance[row]) for row in np.flatnonzero(has_ellipse).tolist()}
    drawn = {row: ellipse for row, ellipse in axes.items() if ellipse[0] > 0}
    if not drawn:
        return layer
    extent_m = float(np.ptp(xyz[has_ellipse, :2], axis=0).max())
    largest = max(SHARE * extent_m / float(np.median([a for a, _, _ in drawn.values()])), 1.0)
    factor = 10.0 ** np.floor(np.log10(largest))
    turn = np.linspace(0.0, 2 * np.pi, AROUND + 1)
    for row, (a, b, azimuth) in drawn.items():
        along = np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))])
        across = np.array([along[1], -along[0]])
        plan = factor * (np.outer(a * np.cos(turn), along) + np.outer(b * np.sin(turn), across))
        shape = xyz[row] + np.column_stack([plan, np.zeros(len(plan))])
        shape[-1] = shape[0]
        layer.add(shape, str(oriented.block.points.id[row]), a, b, azimuth, float(factor))
    return layer


def _control(oriented: OrientedBlock) -> Layer:
    layer = Layer(
        "control",
        "Point",
        {
            "point": str,
            "role": str,
            "known": str,
            "rays": int,
            **_floats("X_m", "Y_m", "Z_m", "sX_m", "sY_m", "sZ_m", "vX_m", "vY_m", "vZ_m"),
        },
    )
    rays = np.bincount(oriented.rays.point, minlength=len(oriented.block.points)).tolist()
    for p in control_points(oriented):
        given_m = np.where(p.known, p.xyz_m, np.nan)
        sigma = np.where(p.known, p.sigma_m, np.nan)
        adjusted = oriented.xyz_m[p.row] if oriented.solution is not None else np.full(3, np.nan)
        place = np.where(np.isfinite(given_m), given_m, adjusted)
        if np.isfinite(place[:2]).all():
            known_axes = "".join(axis for axis, k in zip("XYZ", p.known) if k)
            layer.add(
                np.nan_to_num(place),
                p.id,
                "check" if p.is_check else "control",
                known_axes,
                rays[p.row],
                *given_m.tolist(),
                *sigma.tolist(),
                *(adjusted - given_m).tolist(),
            )
    return layer
