"""From artifacts to a bundle adjustment: observations of all kinds, start values, what was rejected before."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.bundle.network_start import network_start
from aatri.adapters.bundle.orientations import given_orientations
from aatri.adapters.film_errors import film_errors
from aatri.adapters.frame.adjustment_frame import frame_of, geodesy_of, level_of, points_into, poses_into
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import CHECK, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects, staying_out
from aatri.errors import ArtifactError, GeometryError, InputError
from aatri.ids import rows_of, shown
from aatri.notes import Note
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.image_points import image_points as observed_image_points
from aatri.observations.image_points import rays_of
from aatri.observations.kinds.catalogue import KindOptions, observe
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import FILM, POINT, POSE, Poses
from aatri.observations.rigs import poses_by_rigs
from aatri.observations.rolling_shutter import ROLLING, VELOCITY, by_velocity, flown_velocities
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bundle.block import BundleInput, ImageGroups
from aatri.orientation.bundle.complete_start import complete_start
from aatri.orientation.bundle.strip_numbering import strip_numbering


def observation_source(
    block: Block,
    image_points: ImagePoints | None,
    initial: Solution | None,
    parameters: tuple[ParameterRows, ...] = (),
    origin: Float | None = None,
    linear_start: bool = False,
    shared: tuple[Poses, Float] | None = None,
) -> ObservationSource:
    """A block in the frame of its adjustment; missing start values are filled in by intersection and resection.

    Parameters
    ----------
    initial : Solution or None
        Start values.
    origin : (3,) float64, optional
        Of the tangent frame, in the frame of the block; default its middle.
    linear_start : bool
        Images without orientation start by the direct linear transformation where it is determined.
    shared : (Poses, (n_points, 3) float64), optional
        Images and points by another block, in the frame of the adjustment, NaN where it has none: what has no start
        otherwise begins there, and images are resected on these points.

    Raises
    ------
    GeometryError
        If no image has a starting orientation.
    ArtifactError
        If `initial` is of another block.
    """
    frame = frame_of(block, origin)
    given_poses = given_orientations(block)
    initial_poses = given_poses if initial is None else (initial.images.position_m, initial.images.ground_from_image)
    poses = poses_into(frame, *initial_poses)
    xyz = points_into(frame, _start_points(block, initial))
    if shared is not None:
        poses = poses.where(poses.oriented | ~shared[0].oriented, shared[0])
        xyz = np.where(np.isfinite(xyz), xyz, shared[1])
    origin = origin_of(poses, xyz)
    poses, xyz = poses_by_rigs(block, poses.shifted(-origin)), xyz - origin
    rays = None
    if image_points is not None:
        rays, offered = rays_of(block, image_points), poses_into(frame, *given_poses).shifted(-origin)
        poses, xyz = complete_start(rays, poses, xyz, linear=linear_start, offered=offered)
    given_values = np.isfinite(xyz)
    xyz, notes = network_start(block, xyz) if len(block.geodetic) else (xyz, ())
    if rays is not None:
        if (np.isfinite(xyz) & ~given_values).any():
            poses, xyz = complete_start(rays, poses, xyz, linear=linear_start, offered=offered)
        if not poses.oriented.any():
            raise GeometryError(
                "no image has a starting orientation, and none sees four control points to find it from",
                where=f"block {block.name}",
                remedy="give `initial` in `from:`, or positions and angles in exterior.csv",
            )
    geodesy, start = geodesy_of(block, frame), {POSE: poses, POINT: xyz}
    level = level_of(frame, geodesy, origin)
    return ObservationSource(block, image_points, origin, start, parameters, level, frame, geodesy, notes, rays)


def bundle_input(
    source: ObservationSource, options: KindOptions, suspects: Suspects | None = None, *, searched: bool = False
) -> BundleInput:
    """All observations of a block, without what earlier stages have rejected: from here on there are arrays alone.

    Parameters
    ----------
    suspects : Suspects, optional
        Of earlier stages.
    """
    block, poses = source.block, source.start[POSE]
    rejected = set[tuple[str, int]]()
    if suspects is not None:
        rejected |= suspected_rows(suspects)
    if suspects is not None and searched:
        rejected |= rays_of_rejected_ties(block, source.image_points, suspects)
    strip, n = block.images.strip, len(block.images)
    return BundleInput(
        block.images.id,
        block.points.id,
        tuple(without_rows(o, rejected) for o in observe(source, options)),
        poses,
        source.start[POINT],
        source.origin_m,
        source.rays,
        source.parameters,
        marked=np.isin(np.arange(len(block.points)), block.ground_points.point[block.ground_points.datum]),
        numbering=strip_numbering(poses.position_m, strip, block.images.sequence) if n else None,
        images=_image_groups(block),
        level=source.level,
    )


def _image_groups(block: Block) -> ImageGroups:
    images, cameras = block.images, block.cameras
    film = cameras.kind != "digital"
    corner_mm = 0.5 * np.linalg.norm(np.where(film[:, None], 1.0, cameras.pixel_size_mm) * cameras.format, axis=1)
    strip = np.append(block.strips.id, "")[images.strip]
    return ImageGroups(cameras.id, corner_mm, images.camera, strip, images.flight, images.time_s, images.sequence)


def with_parameters(
    source: ObservationSource, inputs: BundleInput, parameters: tuple[ParameterRows, ...]
) -> BundleInput:
    """The same block with other parameters of images and cameras; weights, rejections and start values stay.

    Parameters
    ----------
    parameters : tuple of ParameterRows
        The groups of `inputs` with other terms, or with others free; those that are not free begin anew.
    """
    rays, *priors = observed_image_points(replace(source, parameters=parameters))
    before, observed = {f"{p.group}_prior" for p in parameters}, list[Observed]()
    for o in inputs.observed:
        if o.kind == IMAGE_POINT:
            observed += [_of_parameters(o, rays, parameters), *priors]
        elif o.kind not in before:
            observed.append(o)
    return replace(inputs, observed=tuple(observed), parameters=parameters)


def _of_parameters(before: Observed, now: Observed, parameters: Sequence[ParameterRows]) -> Observed:
    """Rays with other parameters, of the weights they had before."""
    records = replace(now.records, whitener=before.records.whitener, active=before.records.active)
    start = {p.group: np.where(p.free, before.start[p.group], p.start) for p in parameters}
    unreduced = None if before.unreduced is None else _of_parameters(before.unreduced, now, parameters)
    return replace(before, records=records, unknowns=now.unknowns, start=start, unreduced=unreduced)


def without_rows(observed: Observed, rejected: set[tuple[str, int]]) -> Observed:
    """Without what is rejected, by kind and row of its table; a set of correlated rows goes with one of them."""
    rows = [row for kind, row in rejected if kind == observed.kind and row >= 0]
    if observed.set_rows is None:
        return observed.without(np.asarray(np.isin(observed.row, rows)))
    rejected_in_set = np.isin(observed.set_rows, rows)
    return replace(observed, rejected_in_set=rejected_in_set).without(np.asarray(rejected_in_set.any(axis=1)))


def suspected_rows(suspects: Suspects) -> set[tuple[str, int]]:
    """What earlier stages have rejected, by kind and row of its table."""
    rows = np.flatnonzero(staying_out(suspects) & (suspects.row >= 0))
    return set(zip(suspects.kind[rows].tolist(), suspects.row[rows].tolist()))


def rays_of_rejected_ties(block: Block, image_points: ImagePoints | None, suspects: Suspects) -> set[tuple[str, int]]:
    """Image points of strips to points that do not tie them: another place may carry the number there."""
    ties = np.flatnonzero((suspects.kind == STRIP_TIE) & staying_out(suspects))
    if image_points is None or not len(ties):
        return set()
    strip, point = rows_of(suspects.image[ties], block.strips.id), rows_of(suspects.point[ties], block.points.id)
    n, m, known = len(block.points), image_points.measurements, (strip >= 0) & (point >= 0)
    rejected = (strip.astype(np.int64) * n + point)[known]
    rows = np.flatnonzero(np.isin(block.images.strip[m.image].astype(np.int64) * n + m.point, rejected))
    return {(IMAGE_POINT, row) for row in rows.tolist()}


def origin_of(poses: Poses, xyz_m: Float) -> Float:
    """A round place near the block, (3,) m: coordinates are reduced to it before any arithmetic."""
    origin = np.zeros(3)
    for axis in range(3):
        for values in (xyz_m[:, axis], poses.position_m[:, axis]):
            finite = values[np.isfinite(values)]
            if len(finite):
                origin[axis] = np.round(finite.mean())
                break
    return origin


def film_parameters(block: Block, image_points: ImagePoints) -> ParameterRows | None:
    """The film corrections that the fiducials leave open, weighted by their interior orientation; None without any."""
    film = film_errors(block, image_points)
    if film is None:
        return None
    zero, image = np.zeros(film.open.shape), image_points.measurements.image
    return ParameterRows(
        FILM,
        block.images.id,
        film.labels,
        zero,
        film.open,
        zero,
        film.covariance,
        film.open,
        image,
        film.basis,
        per_image=True,
    )


def with_row_times(
    source: ObservationSource, sigma: float | None, velocity_sigma_m_s: float | None = 0.0
) -> ObservationSource:
    """The block with the motion of its cameras while rows are read out, where image points say when they were.

    Parameters
    ----------
    sigma : float, optional
        Standard deviation of the readout of a camera as a share of that of the row times: 0 as they say, None free.
    velocity_sigma_m_s : float, optional
        Standard deviation of the velocities that neighbours say: 0 as they say, None free for each image.

    Raises
    ------
    InputError
        If images with row times have no time, or no other image of their camera and flight.
    """
    block, points = source.block, source.image_points
    if points is None or not np.isfinite(block.image_points.row_time_s).any():
        chosen = [n for n, value in (("readout_sigma", sigma), ("velocity_sigma", velocity_sigma_m_s)) if value != 0]
        text = f"{', '.join(chosen)}: options are set, but no image point has a row time"
        return replace(source, notes=(*source.notes, Note("warning", text))) if chosen else source
    rays, poses = rays_of(block, points), source.start[POSE]
    row_time_s = block.image_points.row_time_s
    images = block.images
    track = np.unique(np.char.add(np.char.add(images.flight, "/"), images.camera.astype(str)), return_inverse=True)[1]
    velocity = flown_velocities(images.time_s, track.ravel(), poses.position_m)
    still = np.isin(np.arange(len(images)), rays.image[np.isfinite(row_time_s) & rays.active])
    still &= ~np.isfinite(velocity).all(axis=1) & poses.oriented
    if still.any():
        raise InputError(
            f"row_time: no velocity for images {shown(images.id[still].tolist())}: they need a time, and another image "
            "of their camera and flight at another time",
            where="images.csv",
            remedy="give `time` in images.csv, or leave out row_time in image_points.csv",
        )
    basis = by_velocity(rays, poses, source.start[POINT], row_time_s)
    along = np.einsum("nij,nj->ni", basis, np.nan_to_num(velocity)[rays.image])[:, :, None]
    camera = images.camera[rays.image]
    rows = [_weighted(ROLLING, block.cameras.id, ("readout",), 1.0, sigma, camera, along)]
    if velocity_sigma_m_s != 0:
        further = _weighted(VELOCITY, images.id, ("vx", "vy", "vz"), 0.0, velocity_sigma_m_s, rays.image, basis)
        rows.append(replace(further, per_image=True))
    return replace(source, parameters=(*source.parameters, *rows))


def _weighted(
    group: str, ids: Text, labels: tuple[str, ...], value: float, sigma: float | None, block: Int, basis: Float
) -> ParameterRows:
    """Parameters of one observed value, all of one standard deviation: 0 known, None free."""
    n, k = len(ids), len(labels)
    values = np.full((n, k), value)
    covariance = np.tile((sigma or 1.0) ** 2 * np.eye(k), (n, 1, 1))
    weighted = np.full((n, k), bool(sigma))
    return ParameterRows(
        group, ids, labels, values, np.full((n, k), sigma != 0), values, covariance, weighted, block, basis
    )


def _start_points(block: Block, initial: Solution | None) -> Float:
    """Coordinates of `initial`; where it has none, those the block gives as control or approximate values."""
    xyz = np.full((len(block.points), 3), np.nan)
    xyz[block.ground_points.point] = np.where(block.ground_points.role == CHECK, np.nan, block.ground_points.xyz_m)
    if initial is None:
        return xyz
    if not np.array_equal(initial.points.id, block.points.id):
        raise ArtifactError(
            f"`initial` belongs to another block than {block.name}: its points differ",
            remedy="check `from` in pipeline.yaml",
        )
    return np.where(np.isfinite(initial.points.xyz_m), initial.points.xyz_m, xyz)
