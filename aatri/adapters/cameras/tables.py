"""Adjusted camera parameters in a Solution: values, covariances, calibrated sets and image errors.

How the parameters of a group stand there is said once (`TabledGroup`): name, offset and factor of each,

    p' = offset + factor p,     C' = factor C factor'

so that additional parameters are told in their classical units and principal points from the origin of the block. The
covariances between units need a solve per unit; with more than `MOST` parameters only those between units that images
share are found, and of each image with itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from aatri.adapters.cameras.unknowns import PRINCIPAL_POINT, SetPart, camera_scale, nominal_point_mm, units_of
from aatri.adapters.solution import stacked
from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.solution import CalibratedSets, ErrorFields, ParameterCovariances, Parameters
from aatri.camera.models import calibration
from aatri.camera.parameters.error_field import image_error_field
from aatri.notes import Note
from aatri.observations.poses import ADDITIONAL, CAMERA
from aatri.orientation.bundle.result import AdjustedParameters, BundleResult

MOST = 400
"""With more parameters than this, those of single images are not held against other units."""

GRID = 11
"""Grid points of an image-error field in each direction."""


@dataclass(frozen=True)
class ParameterTables:
    """What a Solution tells of camera parameters."""

    parameters: tuple[Parameters, ...] = ()
    """A table a group."""
    covariances: ParameterCovariances | None = None
    """Where there are camera parameters."""
    sets: CalibratedSets | None = None
    """Of a self-calibration, for other blocks."""
    fields: ErrorFields | None = None
    """Its image errors."""


def parameter_tables(
    block: Block, result: BundleResult, parts: Sequence[SetPart] = (), name: str = "", interior: bool = False
) -> tuple[ParameterTables, tuple[Note, ...]]:
    """Adjusted parameters as tables.

    Parameters
    ----------
    parts : sequence of SetPart
        Of a self-calibration.
    name, interior
        Of its set, and whether c, x0, y0 were put before it.
    """
    of_group = {part.group: part for part in parts}
    groups = [tabled_group(block, p, of_group.get(p.given.group)) for p in result.parameters]
    covariances, notes = parameter_covariances(result, groups)
    adjusted = [(of_group[p.given.group], p) for p in result.parameters if p.given.group in of_group]
    calibrated = calibration_tables(block, adjusted, name, interior) if parts else (None, None)
    return ParameterTables(tuple(g.table() for g in groups), covariances, *calibrated), notes


@dataclass(frozen=True)
class TabledGroup:
    """How the parameters of a group stand in the tables."""

    adjusted: AdjustedParameters
    group: str
    """What the tables call it."""
    name: Text
    """(n, s) str."""
    listed: Bool
    """(n, s). Which have a row."""
    with_covariances: Bool
    """(n, s)."""
    offset: Float
    factor: Float
    """(n, s)."""

    def table(self) -> Parameters:
        """Values and standard deviations; 0 where held."""
        rows, p = self.adjusted.given, self.adjusted
        row, column = np.nonzero(self.listed)
        sigma = np.abs(self.factor) * np.sqrt(np.einsum("nii->ni", p.covariance))
        return Parameters(
            group=np.full(len(row), self.group),
            object=np.asarray(rows.ids, dtype=np.str_)[row],
            name=self.name[row, column],
            value=(self.offset + self.factor * p.value)[row, column],
            sigma=np.where(rows.free, sigma, 0.0)[row, column],
        )


def tabled_group(block: Block, adjusted: AdjustedParameters, part: SetPart | None) -> TabledGroup:
    """How parameters are told: of a part of a set in classical units, of camera models all, of others the free."""
    rows, shape = adjusted.given, adjusted.given.free.shape
    name = np.array([rows.labels] * shape[0], dtype=np.str_).reshape(shape)
    offset, factor, listed = np.zeros(shape), np.ones(shape), np.zeros(shape, dtype=bool)
    if part is not None:
        cameras = units_of(block, part.per).camera
        for camera in np.unique(cameras):
            factor[cameras == camera] = part.parameters.classical_factors(camera_scale(block, int(camera)))
        return TabledGroup(adjusted, ADDITIONAL, name, ~listed, ~listed, offset, factor)
    if rows.group != CAMERA:
        return TabledGroup(adjusted, rows.group, name, rows.free, listed, offset, factor)
    for k, model in enumerate(rows.model):
        own = calibration.PARAMETERS[model]
        name[k, : len(own)], listed[k, : len(own)] = own, True
        for axis, label in enumerate(PRINCIPAL_POINT):
            offset[k, name[k] == label] = nominal_point_mm(block.cameras, str(rows.ids[k]))[axis]
    return TabledGroup(adjusted, CAMERA, name, listed, listed & rows.free, offset, factor)


class _Unit(NamedTuple):
    """The parameters of a camera, session or image."""

    row: Int
    """In the table, -1 for none."""
    block: tuple[str, int]
    """Group and number of the block of unknowns."""
    factor: Float
    free: Bool
    covariance: Float
    per_image: bool


def parameter_covariances(
    result: BundleResult, groups: Sequence[TabledGroup]
) -> tuple[ParameterCovariances | None, tuple[Note, ...]]:
    """Covariances of the parameters of all groups, each pair once; None where there are no parameters.

    Parameters
    ----------
    groups : sequence of TabledGroup
        All that the table has, in its order.
    """
    units, first = [], 0
    for g in groups:
        row = np.where(g.with_covariances, first + np.cumsum(g.listed).reshape(g.listed.shape) - 1, -1)
        p = g.adjusted
        units += [
            _Unit(row[k], (p.given.group, k), g.factor[k], p.given.free[k], p.covariance[k], p.given.per_image)
            for k in np.flatnonzero((row >= 0).any(axis=1)).tolist()
        ]
        first += int(g.listed.sum())
    if not units:
        return None, ()
    tables = [_pair(u, u, u.covariance) for u in units]
    pairs, notes = _between(units, result)
    if pairs:
        crossed = covariances_of_pairs(result.adjusted, [(a.block, b.block) for a, b in pairs])
        tables += [_pair(a, b, cross) for (a, b), cross in zip(pairs, crossed)]
    return stacked(tables), notes


def _between(units: Sequence[_Unit], result: BundleResult) -> tuple[list[tuple[_Unit, _Unit]], tuple[Note, ...]]:
    """Pairs of units whose covariances are asked for, in an order in which one second unit follows itself."""
    determined = [u for u in units if u.free.any() and np.isfinite(u.covariance[np.ix_(u.free, u.free)]).all()]
    if not result.adjusted.has_factor or result.adjusted.down_weighted or len(determined) < 2:
        return [], ()
    pairs = [(a, b) for b, a in combinations(determined, 2)]
    if sum(int(u.free.sum()) for u in determined) <= MOST:
        return pairs, ()
    shared = [pair for pair in pairs if not any(u.per_image for u in pair)]
    text = (
        f"covariances of camera parameters: more than {MOST}; those of single images are told within each image, not "
        "with other images and cameras"
    )
    return shared, (Note("note", text),)


def _pair(a: _Unit, b: _Unit, covariance: Float) -> ParameterCovariances:
    """Covariances of two units, or of one with itself, the earlier row first."""
    first, second = np.meshgrid(a.row, b.row, indexing="ij")
    values = covariance * np.outer(a.factor, b.factor)
    listed = (first >= 0) & (second >= 0) & ((first <= second) | np.bool_(a is not b))
    low, high = np.minimum(first, second)[listed], np.maximum(first, second)[listed]
    return ParameterCovariances(low, high, values[listed])


def calibration_tables(
    block: Block, groups: Sequence[tuple[SetPart, AdjustedParameters]], name: str, interior: bool
) -> tuple[CalibratedSets, ErrorFields]:
    """What a self-calibration leaves for the report and other blocks: its sets, and image errors of all but images.

    Parameters
    ----------
    groups : sequence of (SetPart, AdjustedParameters)
    name : str
        Of the set.
    interior : bool
        Whether c, x0, y0 were put before the set.
    """
    sets, fields = [CalibratedSets.empty()], [ErrorFields.empty()]
    for part, adjusted in groups:
        units = units_of(block, part.per)
        n, scales = len(units.id), [camera_scale(block, int(k)) for k in units.camera]
        sets.append(
            CalibratedSets.of(
                object=units.id,
                camera=block.cameras.id[units.camera],
                per=part.per,
                set=name,
                parameters=len(part.parameters),
                interior=interior,
                principal_distance_mm=np.array([s.principal_distance_mm for s in scales]),
                principal_point_mm=block.cameras.principal_point_mm[units.camera],
                half_format_mm=np.array([s.half_format_mm for s in scales]).reshape(n, 2),
                base_mm=np.array([s.base_mm for s in scales]),
                distortion=np.array([known_distortion(block, k) for k in units.camera.tolist()], dtype=np.str_),
            )
        )
        for k in range(n) if part.per != "image" else ():
            f = image_error_field(part.parameters, scales[k], adjusted.value[k], adjusted.covariance[k], GRID)
            unit_id = np.full(len(f.xy_mm), units.id[k])
            fields.append(ErrorFields(unit_id, f.xy_mm, 1e3 * f.error_mm, 1e3 * f.sigma_mm, 1e3 * f.shape_mm))
    return stacked(sets), stacked(fields)


def known_distortion(block: Block, camera: int) -> str:
    """Distortion of a camera that is not estimated: `brown k1=-1.2e-08`, `table 20:0.001 40:0.004`, `none`."""
    model, own, table = block.cameras.distortion[camera], block.camera_parameters, block.distortion_table
    fixed = np.flatnonzero((own.camera == camera) & np.isfinite(own.value) & ~own.free & ~(own.sigma > 0))
    of_table = np.flatnonzero(table.camera == camera)
    values = [f"{own.name[k]}={own.value[k]:.9g}" for k in fixed.tolist() if not own.name[k].startswith("principal")]
    values += [f"{table.radius_mm[k]:.9g}:{table.correction_mm[k]:.9g}" for k in of_table.tolist()]
    if model != "none" and block.cameras.symmetry_point_mm[camera].any():
        values.append("symmetry point " + ", ".join(f"{v:.9g}" for v in block.cameras.symmetry_point_mm[camera]))
    return " ".join([str(model), *values])
