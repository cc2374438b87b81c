"""What of control, positions, distances and attitudes fits an initial orientation: residuals, suspects and notes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.initial_datum import Known
from aatri.adapters.ground.initial_observed import Ground, Lengths
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.geometry.rotations import log_rotation
from aatri.notes import Note
from aatri.observations.poses import Poses
from aatri.orientation.bodies.absolute import OrientedComponent
from aatri.orientation.graph.component import Component

STAGE = "initial_orientation"

LEAST_SIGMA = 1e-6
"""Of what is exact, m or rad."""

DEFORMED = 5.0
"""Times the standard deviation of its points that a component may be deformed by without a warning."""

OFF_SIGMAS = 5.0
"""Attitudes that are off by more than this from the common offset of their camera are told."""

SCATTER = 1.4826
"""Standard deviation of a normal variable over the median of its deviations."""


@dataclass(frozen=True)
class Held:
    """Observations of one kind, held against a component.

    Attributes
    ----------
    kind : str
    row : (n,) int
        In its table of the Block.
    image, point : (n,) str
    residual, sigma : (n, k) float64
        Component on the ground minus given.
    unit : str
    """

    kind: str
    row: Int
    image: Text
    point: Text
    residual: Float
    sigma: Float
    unit: str


def held_against(
    block: Block, ground: Ground, known: Known, component: Component, *, attitudes: bool
) -> Iterator[Held]:
    """What is known of a component on the ground, kind by kind.

    Parameters
    ----------
    component : Component
        On the ground, reduced to the origin.
    attitudes : bool
        Attitudes are among it.
    """
    c, p, poses = ground.control, ground.positions, component.poses
    control, position = known.control, known.position
    image = p.image[position]
    arm = np.einsum("nij,nj->ni", poses.ground_from_image[image], p.lever_arm_m[position])
    off = component.xyz[c.point[control]] + ground.origin_m - c.xyz_m[control]
    of_control = np.where(c.given[control], off, np.nan)
    of_position = poses.position_m[image] + arm + ground.origin_m - p.position_m[position]
    for kind, row, covariance, images, points, value in (
        ("control", c.row[control], c.covariance_m2[control], None, block.points.id[c.point[control]], of_control),
        ("position", p.row[position], p.covariance_m2[position], block.images.id[image], None, of_position),
    ):
        n, none = len(row), np.full(len(row), "")
        sigma = np.where(np.isfinite(value), np.sqrt(np.einsum("nii->ni", covariance)), np.nan)
        if n:
            yield Held(kind, row, none if images is None else images, none if points is None else points, value,
                       sigma, "m")  # fmt: skip
    for part, rows in known.lengths:
        s = part.sights.take(rows)
        off = (lengths_in(component, part, rows) - s.value)[:, None]
        yield Held(part.kind, s.row, np.full(len(s), ""), s.names, off, s.sigma[:, None], "m")
    if attitudes:
        a, rows = ground.attitudes, known.attitude
        R = poses.ground_from_image[a.image[rows]] @ a.ground_from_image[rows].swapaxes(1, 2)
        w = np.einsum("nij,nj->ni", np.linalg.inv(a.turning[rows]), log_rotation(R))
        sigma = np.sqrt(np.einsum("nii->ni", a.covariance_rad2[rows]))
        yield Held("attitude", a.row[rows], block.images.id[a.image[rows]], np.full(len(rows), ""), w, sigma, "rad")


def lengths_in(component: Component, part: Lengths, rows: Int) -> Float:
    """Distances as they are in a component, of its unit."""
    s = part.sights.take(rows)
    ends = [np.where(is_image[:, None], component.poses.position_m[np.where(is_image, row, 0)],
                     component.xyz[np.where(is_image, 0, row)])
            for row, is_image in ((s.station, s.station_is_image), (s.target, s.target_is_image))]  # fmt: skip
    line = ends[1] - ends[0]
    line[:, 2] += s.target_height_m - s.station_height_m
    line[part.plan[rows], 2] = 0.0
    return np.asarray(np.linalg.norm(line, axis=1))


def left_out_table(held: Held) -> Suspects:
    """All of one kind, left out as it contradicts all else: the bundle begins without it and tests it again."""
    n, size = len(held.row), np.sqrt(np.nansum(held.residual**2, axis=1))
    with np.errstate(divide="ignore"):
        test = np.sqrt(np.nanmean((held.residual / np.maximum(held.sigma, LEAST_SIGMA)) ** 2, axis=1))
    known = np.isfinite(test) & (test > 0)
    return Suspects(
        kind=np.full(n, held.kind), row=held.row.astype(np.int32), image=held.image, point=held.point,
        stage=np.full(n, STAGE), size=size, unit=np.full(n, held.unit),
        sigma=np.where(known, size / np.where(known, test, 1.0), np.nan), test=test, verdict=np.full(n, "rejected"),
    )  # fmt: skip


def without_one(known: Known) -> Iterator[tuple[str, Known, Known]]:
    """One kind, what is left of the known without it, and it alone: distances, positions, control."""
    none = np.zeros(0, dtype=np.int64)
    nothing = Known(none, none, (), none)
    if known.lengths:
        yield "distances", replace(known, lengths=()), replace(nothing, lengths=known.lengths)
    if len(known.control) and len(known.position):
        yield "observed positions", replace(known, position=none), replace(nothing, position=known.position)
        yield "control", replace(known, control=none), replace(nothing, control=known.control)


def contradicts(block: Block, ground: Ground, left: Known, component: Component, limit: float) -> bool:
    """Whether what is left out is off as a whole by more than `limit` times what one of it is uncertain.

    Weakly tied strips bend by less, and fit whatever is left.
    """
    for table in held_against(block, ground, left, component, attitudes=False):
        for v, sigma in zip(table.residual.T, table.sigma.T):
            known = np.isfinite(v) & np.isfinite(sigma)
            if known.any() and abs(float(np.median(v[known]))) > limit * float(np.median(sigma[known])):
                return True
    return False


def contradiction_note(block: Block, ground: Ground, left: Known, component: Component, kind: str, what: str) -> Note:
    """What is left out as it contradicts all else; the component is on the ground without it."""
    tables = list(held_against(block, ground, left, component, attitudes=False))
    names = np.concatenate([t.point if kind != "observed positions" else t.image for t in tables])
    if kind == "distances":
        value = np.concatenate([part.sights.value[rows] for part, rows in left.lengths])
        ratio = value / (value + np.concatenate([t.residual[:, 0] for t in tables]))
        off = f"longer than in it by {1e6 * (float(np.median(ratio)) - 1.0):.0f} ppm"
    else:
        off = f"shifted by {_median_shift(tables[0].residual)} m"
        camera = block.images.camera[ground.positions.image[left.position]]
        if len(np.unique(camera)) > 1:
            each = [
                f"{block.cameras.id[k]} {_median_shift(tables[0].residual[camera == k])}" for k in np.unique(camera)
            ]
            off += f" (by camera: {'; '.join(each)})"
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


def two_that_differ(known: Known, component: Component, precision_m: float, limit: float) -> list[Note]:
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
        text = (f"{what}: {len(mine)} attitudes of camera {block.cameras.id[k]} take no part; they differ by "
                f"{np.degrees(np.linalg.norm(offset)):.2g} deg in common, by {np.degrees(np.median(off)):.2g} deg "
                "(median) beyond that")  # fmt: skip
        notes.append(Note("note", text))
        if len(wrong):
            notes.append(
                Note("warning", f"{what}: {len(wrong)} attitudes are far off the others", tuple(wrong.tolist()))
            )
    return notes
