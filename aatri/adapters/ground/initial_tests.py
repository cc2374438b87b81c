"""What of control, positions, distances and attitudes fits an initial orientation: residuals, suspects and notes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from aatri.adapters.ground.initial_datum import Known
from aatri.adapters.ground.initial_observed import Ground
from aatri.adapters.solution import suspect_rows
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.geometry.rotations import log_rotation
from aatri.notes import Note
from aatri.observations.control import observed_control
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.positions import observed_positions
from aatri.orientation.bodies.absolute import OrientedComponent
from aatri.orientation.bodies.given_relations import Lengths
from aatri.orientation.graph.component import ImageComponent

STAGE = "initial_orientation"

LEAST_SIGMA = 1e-6
"""Of what is exact, m or rad."""

DEFORMED = 5.0
"""Times the standard deviation of its points that a component may be deformed by without a warning."""

OFF_SIGMAS = 5.0
"""Attitudes that are off by more than this from the common offset of their camera are told."""

SCATTER = 1.4826
"""Standard deviation of a normal variable over the median of its deviations."""


def observations_of(block: Block, ground: Ground, known: Known) -> Iterator[Observed]:
    """Control, positions and distances that are known of a component, as the bundle has them."""
    control, positions = ground.control.take(known.control), ground.positions.take(known.position)
    yield from observed_control(control, ground.origin_m, block.points.id[control.point])
    yield from observed_positions(positions, ground.origin_m, block.images.id[positions.image])
    for part, rows in known.lengths:
        yield from part.take(rows).observed()


def residuals_at(component: ImageComponent, o: Observed) -> Float:
    """A component on the ground, reduced to the origin, minus what is observed of it; NaN where not observed."""
    v = o.records.evaluate({POINT: component.xyz, POSE: component.poses}, np.arange(len(o)))[0]
    return np.where(np.isfinite(o.sigmas()), v, np.nan)


def lengths_in(component: ImageComponent, part: Lengths, rows: Int) -> Float:
    """Distances as they are in a component, of its unit."""
    s = part.sights.take(rows)
    ends = [
        np.where(
            is_image[:, None],
            component.poses.position_m[np.where(is_image, row, 0)],
            component.xyz[np.where(is_image, 0, row)],
        )
        for row, is_image in ((s.station, s.station_is_image), (s.target, s.target_is_image))
    ]
    line = ends[1] - ends[0]
    line[:, 2] += s.target_height_m - s.station_height_m
    line[part.plan[rows], 2] = 0.0
    return np.asarray(np.linalg.norm(line, axis=1))


def left_out_table(o: Observed, residual: Float) -> Suspects:
    """All of one kind, left out as it contradicts all else: the bundle begins without it and tests it again."""
    size, (image, point) = np.sqrt(np.nansum(residual**2, axis=1)), o.names(np.arange(len(o)))
    test = np.sqrt(np.nanmean((residual / np.maximum(o.sigmas(), LEAST_SIGMA)) ** 2, axis=1))
    sigma = np.where(test > 0, size / np.where(test > 0, test, 1.0), np.nan)
    return suspect_rows(
        STAGE, o.kind, image=image, point=point, row=o.row, size=size, unit=o.unit, sigma=sigma, test=test
    )


def without_one(known: Known) -> Iterator[tuple[str, Known, Known]]:
    """One kind, what is left of the known without it, and it alone: distances, positions, control."""
    none = np.zeros(0, dtype=np.int64)
    nothing = Known(none, none, (), none)
    if known.lengths:
        yield "distances", replace(known, lengths=()), replace(nothing, lengths=known.lengths)
    if len(known.control) and len(known.position):
        yield "observed positions", replace(known, position=none), replace(nothing, position=known.position)
        yield "control", replace(known, control=none), replace(nothing, control=known.control)


def contradicts(block: Block, ground: Ground, left: Known, component: ImageComponent, limit: float) -> bool:
    """Whether what is left out is off as a whole by more than `limit` times what one of it is uncertain.

    Weakly tied strips bend by less, and fit whatever is left.
    """
    for o in observations_of(block, ground, left):
        for v, sigma in zip(residuals_at(component, o).T, o.sigmas().T):
            known = np.isfinite(v) & np.isfinite(sigma)
            if known.any() and abs(float(np.median(v[known]))) > limit * float(np.median(sigma[known])):
                return True
    return False


def contradiction_note(
    block: Block, ground: Ground, left: Known, component: ImageComponent, kind: str, what: str
) -> Note:
    """What is left out as it contradicts all else; the component is on the ground without it."""
    observed = list(observations_of(block, ground, left))
    names = np.concatenate([np.char.add(*o.names(np.arange(len(o)))) for o in observed])
    if kind == "distances":
        ratios = [part.sights.value[rows] / lengths_in(component, part, rows) for part, rows in left.lengths]
        off = f"longer than in it by {1e6 * (float(np.median(np.concatenate(ratios))) - 1.0):.0f} ppm"
    else:
        residual = np.concatenate([residuals_at(component, o) for o in observed])
        off = f"shifted by {_median_shift(residual)} m"
        images = [of for o in observed for group, of in o.records.touches if group == POSE]
        camera = block.images.camera[np.concatenate(images)] if images else np.zeros(0, dtype=np.int32)
        if len(np.unique(camera)) > 1:
            by_camera = [f"{block.cameras.id[k]} {_median_shift(residual[camera == k])}" for k in np.unique(camera)]
            off += f" (by camera: {'; '.join(by_camera)})"
    text = f"{what}: {kind} ({len(names)}) contradict all else, {off} in the median: they are left out here"
    return Note("warning", text, tuple(names.tolist()))


def _median_shift(residual: Float) -> str:
    """Given less computed along X, Y, Z; a dash where no residual has the coordinate."""
    columns = [axis[np.isfinite(axis)] for axis in -residual.T]
    return ", ".join(f"{np.median(axis):.3f}" if len(axis) else "-" for axis in columns)


def deformation_notes(oriented: OrientedComponent, precision: float, what: str) -> list[Note]:
    """A component that control and positions do not fit, whatever of them is left out.

    `precision` is that of its points, in its unit.
    """
    expected = precision * oriented.ground_from_component.scale
    tau = oriented.tied.tau_m
    if tau <= DEFORMED * expected:
        return []
    text = (
        f"{what}: control and positions fit it only with {tau:.2g} m added to the standard deviations of its "
        f"points, {expected:.2g} m: a wrong principal distance, distortion, unit or id, or several gross errors"
    )
    return [Note("warning", text)]


def two_that_differ(known: Known, component: ImageComponent, precision_m: float, limit: float) -> list[Note]:
    """Where two distances alone tell the scale and differ, nobody can tell which one is wrong.

    `component` is scaled by them, its points are known to `precision_m`.
    """
    if sum(len(rows) for _, rows in known.lengths) != 2:
        return []
    sights = [part.sights.take(rows) for part, rows in known.lengths]
    value, sigma = (np.concatenate([getattr(s, name) for s in sights]) for name in ("value", "sigma"))
    ratio = value / np.concatenate([lengths_in(component, part, rows) for part, rows in known.lengths])
    error = np.hypot(sigma, np.sqrt(2.0) * precision_m) / value
    if abs(ratio[1] - ratio[0]) <= limit * float(np.hypot(*error)):
        return []
    names = np.concatenate([s.names for s in sights])
    text = (
        f"two distances alone tell the scale; they differ by {abs(ratio[1] / ratio[0] - 1):.2%}, one of them is wrong"
    )
    return [Note("warning", text, tuple(names.tolist()))]


def attitude_notes(block: Block, ground: Ground, rows: Int, poses: Poses, what: str, *, took_part: bool) -> list[Note]:
    """How attitudes agree with an orientation they took no part in: their common offset, camera by camera."""
    if took_part or not len(rows):
        return []
    a, notes = ground.attitudes, []
    image = a.image[rows]
    lacking = log_rotation(a.ground_from_image[rows].swapaxes(1, 2) @ poses.ground_from_image[image])
    camera = block.images.camera[image]
    for k in np.unique(camera).tolist():
        mine = np.flatnonzero(camera == k)
        offset = np.median(lacking[mine], axis=0)
        off = np.linalg.norm(lacking[mine] - offset, axis=1)
        sigma = np.sqrt(np.einsum("nii->n", a.covariance_rad2[rows[mine]]) / 3 + (SCATTER * np.median(off)) ** 2 / 3)
        wrong = block.images.id[image[mine[off > OFF_SIGMAS * sigma]]]
        text = (
            f"{what}: {len(mine)} attitudes of camera {block.cameras.id[k]} take no part; they differ by "
            f"{np.degrees(np.linalg.norm(offset)):.2g} deg in common, by {np.degrees(np.median(off)):.2g} deg "
            "(median) beyond that"
        )
        notes.append(Note("note", text))
        if len(wrong):
            notes.append(
                Note("warning", f"{what}: {len(wrong)} attitudes are far off the others", tuple(wrong.tolist()))
            )
    return notes
