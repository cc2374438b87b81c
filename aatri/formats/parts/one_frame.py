"""Sources in different frames, brought into that of the block: coordinates, covariances and rotations.

The frame of the block is the one asked for, else that of the first source with control, else with observed positions,
else of the first that says one. Where that is in latitude and longitude, it is the UTM zone of its middle.

    x_block = block(G),  G geocentric;      R_block = T' S R_source

S and T are the axes of the source and of the block at the place of the image, as columns in geocentric axes: east,
north and up of the place for latitude and longitude, of the origin for a topocentric frame, grid east, grid north and
the normal for a map. So meridian convergence is in R, which names of angles alone would not tell.

A free model (`LOCAL`) has no place in another frame: its start values are left out, which is told. Plan control without
a height is converted at the median height of the others (a map has it as well as latitude and longitude); a height
without its place has no likeness in another frame and is an error.
"""

import re
from dataclasses import replace

import numpy as np

from aatri.arrays import Bool, Float
from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.parts.block_parts import LOCAL, PLANE, BlockParts
from aatri.frames import ellipsoid
from aatri.frames.axes import in_right_handed_order
from aatri.frames.conversion import Frame, convert, crs_of
from aatri.frames.ellipsoid import Ellipsoid
from aatri.frames.heights import is_tangent_frame
from aatri.frames.own_map import utm_of
from aatri.frames.tangent import tangent_frame
from aatri.geometry.rotations import rotation_from_angles
from aatri.ids import several
from aatri.progress import Reporter

GEOCENTRIC = Frame("geocentric", ("x", "y", "z"), "EPSG:4978")
WGS84 = Ellipsoid(6378137.0, 0.0066943799901413165)
OF_PLAN = np.outer([True, True, False], [True, True, False])
"""Of a covariance matrix: what is of X and Y alone."""
_PLACE = re.compile(r"\+(lon_0|lat_0|h_0)=(\S+)")


def topocentric(latitude_deg: float, longitude_deg: float, height_m: float) -> Frame:
    """East, north and up at a place of WGS 84."""
    place = f"+lat_0={latitude_deg!r} +lon_0={longitude_deg!r} +h_0={height_m!r}"
    return Frame("topocentric", ("east", "north", "up"), f"+proj=topocentric +ellps=WGS84 {place}")


def block_frame(sources: list[BlockParts], asked: Frame | None) -> Frame:
    """The frame of the block."""
    named = [p for p in sources if p.frame is not None and p.frame.crs != "local"]
    frame = asked
    if frame is None:
        ranked = sorted(named, key=lambda p: (not _has_control(p), not _has_positions(p)))
        if not ranked:
            return PLANE if any(p.frame == PLANE or _has_control(p) or _has_positions(p) for p in sources) else LOCAL
        frame = ranked[0].frame
    assert frame is not None
    if not frame.geographic:
        return frame
    part = next((p for p in named if p.frame == frame), named[0] if named else None)
    if part is None:
        what = f"{frame.crs} is in latitude and longitude, and no source says where it is"
        raise InputError(what, where=str(sources[0].files[0]), remedy="name a map: EPSG:32632 ...")
    assert part.frame is not None
    columns = [part.ground_points.get("xyz_m"), part.exterior.get("position_m")]
    rows = [np.atleast_2d(np.asarray(c, dtype=np.float64)) for c in columns if c is not None]
    xyz = np.concatenate([np.zeros((0, 3)), *rows])
    degrees = geographic(np.asarray(xyz[np.isfinite(xyz[:, :2]).all(axis=1)]), part.frame)
    longitude, latitude = np.nanmedian(degrees[:, :2], axis=0)
    return utm_of(frame, float(latitude), float(longitude))


def in_frame(parts: BlockParts, target: Frame, reporter: Reporter) -> BlockParts:
    """A source in the frame of the block.

    Raises
    ------
    InputError
        If a frame is not understood, or a grid is missing.
    """
    source = parts.frame
    if source == LOCAL and target == PLANE and (_has_control(parts) or _has_positions(parts)):
        source = PLANE
    if source == PLANE and target.crs != "local" and not (_has_control(parts) or _has_positions(parts)):
        source = None  # start values: if they are in another system, they are seen to be no start
    if source is None or source == target:
        if source is None and (parts.ground_points or parts.exterior) and target.crs != "local":
            reporter.log(f"{parts.files[0]}: says no coordinate system; taken to be in {target.crs}")
        return parts
    if "local" in (source.crs, target.crs):
        return _without_coordinates(parts, target, reporter)
    ground, exterior = dict(parts.ground_points), dict(parts.exterior)
    where = str(parts.files[0]) if parts.files else parts.name
    if "xyz_m" in ground:
        _move(ground, "xyz_m", "covariance_m2", source, target, where)
    if "position_m" in exterior:
        place = np.atleast_2d(np.asarray(exterior["position_m"], dtype=np.float64))
        _move(exterior, "position_m", "position_covariance_m2", source, target, where)
        if "angles_rad" in exterior and "ground_from_image" not in exterior:
            exterior["ground_from_image"] = rotation_from_angles(exterior.pop("angles_rad"))
        if "ground_from_image" in exterior and _plane(source) != _plane(target):
            S, T = _axes(source, place), _axes(target, np.atleast_2d(exterior["position_m"]))
            exterior["ground_from_image"] = T.swapaxes(1, 2) @ S @ exterior["ground_from_image"]
    return replace(parts, ground_points=ground, exterior=exterior, frame=target)


def _plane(frame: Frame) -> str:
    """What the directions of a frame hang on: not on its heights."""
    return frame.crs


def _move(
    columns: dict[str, object], name: str, covariance_name: str, source: Frame, target: Frame, where: str
) -> None:
    """Convert coordinates and their covariances."""
    xyz = np.atleast_2d(np.asarray(columns[name], dtype=np.float64))
    sigma = columns.pop("sigma_m", None)
    covariance = np.zeros((len(xyz), 3, 3))
    if sigma is not None:
        variance = np.broadcast_to(np.asarray(sigma, dtype=np.float64), (len(xyz), 3)) ** 2
        covariance = np.where(np.eye(3, dtype=bool), variance[:, :, None], 0.0)
    elif covariance_name in columns:
        covariance = np.broadcast_to(np.asarray(columns[covariance_name], dtype=np.float64), (len(xyz), 3, 3))
    elif source.geographic:
        covariance = np.full((len(xyz), 3, 3), np.nan)
    plan = _plan_alone(xyz, source, target, where)
    covariance = np.where(plan[:, None, None] & ~OF_PLAN, 0.0, covariance)
    stated = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    heights = xyz[np.isfinite(xyz[:, 2]), 2]
    xyz = np.where(plan[:, None] & np.isnan(xyz), float(np.median(heights)) if len(heights) else 0.0, xyz)
    complete = np.asarray(np.isfinite(xyz).all(axis=1))
    moved, turned = np.full_like(xyz, np.nan), np.full((len(xyz), 3, 3), np.nan)
    if complete.any():
        moved[complete], turned[complete] = _converted(
            xyz[complete], np.nan_to_num(covariance[complete]), source, target
        )
    moved[plan, 2] = np.nan
    columns[name] = moved
    if sigma is not None or covariance_name in columns:
        columns[covariance_name] = np.where(stated[:, None, None], turned, np.where(np.eye(3, dtype=bool), np.nan, 0.0))


def _plan_alone(xyz: Float, source: Frame, target: Frame, where: str) -> Bool:
    """Which rows have a place and no height; those that have but a height, or no map of theirs, are refused."""
    has_coordinate = np.isfinite(xyz)
    plan = np.asarray(has_coordinate[:, :2].all(axis=1) & ~has_coordinate[:, 2])
    maps = all(not is_tangent_frame(f.crs) and set(f.axes) != {"x", "y", "z"} for f in (source, target))
    if len(lost := np.flatnonzero(has_coordinate.any(axis=1) & ~has_coordinate.all(axis=1) & ~(plan & maps))):
        what = (
            f"{several(len(lost), 'row', 'has', 'have')} some coordinates alone, and cannot be "
            f"converted from {source.crs} to {target.crs}"
        )
        raise InputError(what, where=where, remedy="give them in the system of the block, or all three coordinates")
    return plan


def _converted(xyz: Float, covariance: Float, source: Frame, target: Frame) -> tuple[Float, Float]:
    if is_tangent_frame(source.crs):
        axes, origin = _tangent(source)
        xyz, covariance = xyz @ axes.T + origin, axes @ covariance @ axes.T
        source = GEOCENTRIC
    if not is_tangent_frame(target.crs):
        if source == target:
            return xyz, covariance
        return convert(xyz, covariance, source, target)
    if source != GEOCENTRIC:
        xyz, covariance = convert(xyz, covariance, source, GEOCENTRIC)
    axes, origin = _tangent(target)
    return (xyz - origin) @ axes, axes.T @ covariance @ axes


def tangent_place(frame: Frame) -> tuple[float, float, float]:
    """Longitude, latitude and height of the origin of a topocentric frame."""
    place = {name: float(text) for name, text in _PLACE.findall(frame.crs)}
    return place.get("lon_0", 0.0), place.get("lat_0", 0.0), place.get("h_0", 0.0)


def _tangent(frame: Frame) -> tuple[Float, Float]:
    """Axes as columns, and origin, of a topocentric frame in geocentric coordinates."""
    place = np.array([tangent_place(frame)])
    return ellipsoid.local_axes(place[0, 0], place[0, 1]), ellipsoid.geocentric(place, WGS84)[0]


def _axes(frame: Frame, xyz: Float) -> Float:
    """East, north and up of a frame at places in it, columns in geocentric axes, (n, 3, 3); NaN where not known."""
    if is_tangent_frame(frame.crs):
        return np.broadcast_to(_tangent(frame)[0], (len(xyz), 3, 3))
    axes, complete = np.full((len(xyz), 3, 3), np.nan), np.isfinite(xyz).all(axis=1)
    if frame.geographic:
        ordered = in_right_handed_order(xyz, frame.axes)
        for k in np.flatnonzero(complete).tolist():
            axes[k] = ellipsoid.local_axes(ordered[k, 0], ordered[k, 1])
    elif set(frame.axes) == {"x", "y", "z"}:
        axes[complete] = np.eye(3)
    elif complete.any():
        ordered = in_right_handed_order(xyz, frame.axes)[complete]
        right_handed = replace(frame, axes=("east", "north", "up"))
        tangent = tangent_frame(right_handed, ordered.mean(axis=0))
        axes[complete] = tangent.axes @ tangent.axes_at(tangent.from_block(ordered))
    return axes


def geographic(xyz: Float, frame: Frame) -> Float:
    """Longitude, latitude, height of coordinates of a frame that is none of a map."""
    if frame.geographic:
        return in_right_handed_order(xyz, frame.axes)
    if is_tangent_frame(frame.crs):
        axes, origin = _tangent(frame)
        return ellipsoid.geographic(xyz @ axes.T + origin, WGS84)
    system = crs_of(frame)
    if system.is_geocentric:
        a_m, b_m = system.ellipsoid.semi_major_metre, system.ellipsoid.semi_minor_metre
        return ellipsoid.geographic(xyz, Ellipsoid(a_m, 1 - (b_m / a_m) ** 2))
    body = system.geodetic_crs
    degrees = Frame("degrees", ("longitude", "latitude", "height"), body.to_3d().to_wkt())
    return convert(xyz, np.zeros((len(xyz), 3, 3)), frame, degrees)[0]


def _has_control(parts: BlockParts) -> bool:
    role = parts.ground_points.get("role", CONTROL if parts.ground_points else 0)
    return bool(np.isin(role, (CONTROL, CHECK)).any())


def _has_positions(parts: BlockParts) -> bool:
    return bool((np.asarray(parts.exterior.get("position_use", 0)) == OBSERVED_VALUE).any())


def _without_coordinates(parts: BlockParts, target: Frame, reporter: Reporter) -> BlockParts:
    if _has_control(parts) or _has_positions(parts):
        what = "its control or positions have no declared frame that could be converted"
        raise InputError(
            f"{what} to {target.crs}",
            where=str(parts.files[0]),
            remedy="say its system: `--set crs=EPSG:...`, in a pipeline `crs:` beside its path",
        )
    if parts.ground_points or parts.exterior:
        reporter.log(f"{parts.files[0]}: a free model; its orientations and points are no start values here")
    return replace(parts, ground_points={}, exterior={}, frame=None)
