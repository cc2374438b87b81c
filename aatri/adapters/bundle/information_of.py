"""From an adjusted bundle to its Information: all unknowns eliminated but those that other blocks share."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.elimination.onto import reduced_onto
from aatri.adjustment.problem import Problem, SolverSettings
from aatri.adjustment.structure.index_problem import indexed
from aatri.adjustment.structure.indexed_problem import counts
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.artifacts.information import (
    CameraDigests,
    CountedObservations,
    EliminatedObjects,
    Information,
    KeptImages,
    KeptUnknowns,
    Normals,
)
from aatri.artifacts.solution import CalibratedSets
from aatri.errors import GeometryError
from aatri.observations.geodetic.covariances import KINDS as GEODETIC
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.orientation.bundle.shared_equations import INFORMATION, EquationsOfShared

VALUES: Mapping[str, tuple[str, str]] = {
    "image_point": ("image_points", "xy"),
    "control": ("ground_points", "xyz_m"),
    "position": ("exterior", "position_m"),
    "attitude": ("exterior", "angles_rad"),
    **dict.fromkeys(GEODETIC, ("geodetic", "value")),
}
"""Table and column of the block with the observed values of a kind."""


def information_of(
    source: ObservationSource,
    done: AdjustedBlock,
    equations: EquationsOfShared,
    sets: CalibratedSets | None,
) -> Information:
    """The reduced normal equations of an adjusted block.

    Parameters
    ----------
    equations : EquationsOfShared
        Images and points whose unknowns stay; those of cameras, drifts ... always do.

    Raises
    ------
    GeometryError
        If conditions hold exactly, or what is to be eliminated is not determined.
    """
    block, adjusted, state, keep = source.block, done.result.adjusted, equations.state, equations.keep
    if adjusted.problem.constraints:
        raise GeometryError(
            f"{adjusted.problem.constraints[0].name} holds exactly, and normal equations alone do not say so",
            where=f"block {block.name}",
            remedy="give it a small standard deviation",
        )
    records = tuple(r for r in equations.records if r.name != INFORMATION)
    unknowns = tuple(_last(u, _kept(u, keep)) for u in equations.unknowns)
    problem = indexed(Problem(unknowns, records), SolverSettings(ordering="nested_dissection"))
    chosen, rows = [], []
    for u in unknowns:
        columns = problem.layout.columns(u.name, u.size)
        block_of, scalar = np.nonzero((columns >= 0) & _kept(u, keep)[:, None])
        chosen.append(columns[block_of, scalar])
        rows.append((u, block_of, scalar))
    N, right, cost = reduced_onto(problem, state, np.concatenate(chosen))
    observations, n_unknowns, _ = counts(problem)
    images = np.unique(np.concatenate([k for u, k, _ in rows if u.name == POSE]))
    poses: Any = state[POSE]
    frame, tangent = source.frame, np.full(3, np.nan)
    if frame is not None:
        tangent = np.round(frame.to_block(np.zeros((1, 3)))[0], 6)  # it is a round place
    return Information(
        block=block.name,
        frame=frame_text(block),
        cost=cost,
        observations=observations,
        eliminated=n_unknowns - len(right),
        **{f"tangent_{axis}_m": float(x) for axis, x in zip("xyz", tangent)},
        **{f"origin_{axis}_m": float(x) for axis, x in zip("xyz", source.origin_m)},
        unknowns=KeptUnknowns(
            group=np.concatenate([np.full(len(k), u.name) for u, k, _ in rows]),
            object=np.concatenate([np.asarray(u.ids, dtype=np.str_)[k] for u, k, _ in rows]),
            name=np.concatenate([np.array(u.labels, dtype=np.str_)[s] for u, _, s in rows]),
            value=np.concatenate([_values(state[u.name], u)[k, s] for u, k, s in rows]),
            right=right,
        ),
        images=KeptImages(
            image=block.images.id[images],
            position_m=poses.position_m[images],
            ground_from_image=poses.ground_from_image[images],
        ),
        normals=Normals(value=N[np.tril_indices(len(N))]),
        eliminated_objects=_eliminated(done, keep),
        counted=_counted(block, done, equations),
        cameras=camera_digests(block),
        calibrated_sets=sets,
    )


def _kept(u: Unknowns, keep: Mapping[str, Bool]) -> Bool:
    """Blocks of a group that stay."""
    kept = keep.get(u.joins or u.name)
    return np.ones(len(u.free), dtype=bool) if kept is None else kept


def _last(u: Unknowns, kept: Bool) -> Unknowns:
    """The group with what stays ordered last."""
    position = None if u.position is None else np.where(kept[:, None], np.nan, u.position)
    return replace(u, position=position, retained=kept if u.eliminated else None)


def _values(value: Any, u: Unknowns) -> Any:
    if u.name != POSE:
        return value
    return np.concatenate([value.position_m, np.full_like(value.position_m, np.nan)], axis=1)


def _eliminated(done: AdjustedBlock, keep: Mapping[str, Bool]) -> EliminatedObjects:
    stated, result = done.inputs, done.result
    eliminated = {
        POSE: np.asarray(stated.image_ids)[result.image_adjusted & ~keep[POSE]],
        POINT: np.asarray(stated.point_ids)[result.point_adjusted & ~keep[POINT]],
    }
    return EliminatedObjects(
        group=np.repeat(np.array(list(eliminated)), [len(ids) for ids in eliminated.values()]),
        object=np.concatenate([ids.astype(np.str_) for ids in eliminated.values()]),
    )


def counted_rows(
    block: Block, o: Observed, used: Bool, keep: Mapping[str, Bool]
) -> list[tuple[int, tuple[str, str, str], int]]:
    """Rows that touch kept images and points alone: row, kind with names of image and point, digest of the values."""
    own = used.copy()
    for group, touched in o.records.touches:
        if group in keep:
            own &= keep[group][touched]
    rows = np.flatnonzero(own)
    image, point = (names.tolist() for names in o.names(rows))
    return [(k, (o.kind, i, p), _digest(block, o.kind, int(o.row[k]))) for k, i, p in zip(rows.tolist(), image, point)]


def _counted(block: Block, done: AdjustedBlock, equations: EquationsOfShared) -> CountedObservations:
    rows = [
        row
        for o, used in zip(done.result.observations, equations.used, strict=True)
        if o.observed.kind != INFORMATION
        for row in counted_rows(block, o.observed, used, equations.keep)
    ]
    return CountedObservations(
        kind=np.array([key[0] for _, key, _ in rows], dtype=np.str_),
        image=np.array([key[1] for _, key, _ in rows], dtype=np.str_),
        point=np.array([key[2] for _, key, _ in rows], dtype=np.str_),
        digest=np.array([digest for _, _, digest in rows], dtype=np.int64),
    )


def _digest(block: Block, kind: str, row: int) -> int:
    """Of the values observed; 0 where they stand in no row of their own."""
    if row < 0 or kind not in VALUES:
        return 0
    table, column = VALUES[kind]
    values = np.ravel(getattr(getattr(block, table), column)[row]).tolist()
    text = " ".join(f"{v:.12g}" for v in values)
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=7).digest(), "big") + 1


def camera_digests(block: Block) -> CameraDigests:
    """A digest of all figures of each camera, not of its name."""
    texts = []
    for camera in range(len(block.cameras)):
        own_columns = [name for name in vars(block.cameras) if name != "id"]
        parts: list[Any] = [getattr(block.cameras, name)[camera].tolist() for name in own_columns]
        for name in ("camera_parameters", "distortion_table", "fiducials"):
            table: Any = getattr(block, name)
            own = table.camera == camera
            parts += [getattr(table, column)[own].tolist() for column in vars(table) if column != "camera"]
        texts.append(hashlib.sha256(repr(parts).encode()).hexdigest())
    return CameraDigests(id=block.cameras.id, digest=np.array(texts, dtype=np.str_))


def frame_text(block: Block) -> str:
    """What coordinates of a block mean."""
    f = block.frames
    parts = [f.axes[0], f.crs[0], f.vertical[0], f"undulation {block.undulation_m}", block.earth_curvature]
    return "; ".join(str(part) for part in parts if str(part))
