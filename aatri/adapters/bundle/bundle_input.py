"""From artifacts to a bundle adjustment: observations of all kinds, start values, what was rejected before."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from aatri.adapters.bundle.block_start import given_orientations, given_points, network_start, start_origin
from aatri.adapters.frame.adjustment_frame import frame_of, geodesy_of, points_into, poses_into
from aatri.adjusting.adjusted_observations import classes_of
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.ids import rows_of
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.image_points import image_points as observed_image_points
from aatri.observations.image_points import rays_of
from aatri.observations.kinds.catalogue import KindOptions, observe
from aatri.observations.observed import ObservationSource, Observed, level_of
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.rigs import poses_by_rigs
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bundle.block import BundleInput, ImageGroups
from aatri.orientation.bundle.complete_start import complete_start
from aatri.orientation.bundle.strip_numbering import strip_numbering
from aatri.orientation.bundle.variance_groups import VarianceGroups, grouped


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
    xyz = points_into(frame, given_points(block, initial))
    if shared is not None:
        poses = poses.where(poses.oriented | ~shared[0].oriented, shared[0])
        xyz = np.where(np.isfinite(xyz), xyz, shared[1])
    origin = start_origin(poses, xyz)
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
    rows = np.flatnonzero(suspects.staying_out & (suspects.row >= 0))
    return set(zip(suspects.kind[rows].tolist(), suspects.row[rows].tolist()))


def rays_of_rejected_ties(block: Block, image_points: ImagePoints | None, suspects: Suspects) -> set[tuple[str, int]]:
    """Image points of strips to points that do not tie them: another place may carry the number there."""
    ties = np.flatnonzero((suspects.kind == STRIP_TIE) & suspects.staying_out)
    if image_points is None or not len(ties):
        return set()
    strip, point = rows_of(suspects.image[ties], block.strips.id), rows_of(suspects.point[ties], block.points.id)
    n, m, of_strip = len(block.points), image_points.measurements, (strip >= 0) & (point >= 0)
    rejected = (strip.astype(np.int64) * n + point)[of_strip]
    rows = np.flatnonzero(np.isin(block.images.strip[m.image].astype(np.int64) * n + m.point, rejected))
    return {(IMAGE_POINT, row) for row in rows.tolist()}


GroupLevel = Literal["kind", "camera", "flight", "group"]


def variance_groups(block: Block, inputs: BundleInput, levels: Collection[GroupLevel]) -> VarianceGroups:
    """Groups of all observations: their kind and its parts always; of image points the camera, flight and group."""
    labels: list[list[str]] = []
    parts: list[Int] = []
    for o in inputs.observed:
        if o.exact or not len(o):
            labels.append([])
            parts.append(np.full((len(o), o.records.rows), -1, dtype=np.int64))
            continue
        of_rows, row = np.unique(_of_rows(block, o, levels), return_inverse=True)
        names, number = classes_of(o, of_rows.tolist(), row)
        labels.append(names)
        parts.append(number)
    return grouped(inputs.observed, labels, parts)


def _of_rows(block: Block, o: Observed, levels: Collection[GroupLevel]) -> Text:
    """What distinguishes the observations of one kind, (n,) str."""
    image, _ = o.names(np.arange(len(o)))
    row = rows_of(image, block.images.id)
    of_image = row >= 0
    texts = np.full(len(o), "", dtype="U256")
    in_image = {POSE, POINT} <= o.records.groups
    if "camera" in levels and in_image and len(block.cameras) > 1:
        camera = block.cameras.id[block.images.camera[np.maximum(row, 0)]]
        texts = np.where(of_image, np.char.add(texts, np.char.add(" camera ", camera)), texts)
    if "flight" in levels and of_image.any():
        flight = block.images.flight[np.maximum(row, 0)]
        texts = np.where(of_image & (flight != ""), np.char.add(texts, np.char.add(" flight ", flight)), texts)
    if "group" in levels and o.group is not None:
        texts = np.where(o.group != "", np.char.add(texts, np.char.add(" group ", o.group)), texts)
    return np.char.strip(texts)
