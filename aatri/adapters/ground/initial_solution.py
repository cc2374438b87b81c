"""The Solution of components on the ground."""

from dataclasses import replace

import numpy as np

from aatri.adapters.ground.initial_orientation import OnGround
from aatri.adapters.ground.initial_tests import (
    STAGE,
    left_out_table,
    residuals_at,
)
from aatri.adapters.solution import solved_cameras, stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import components_of, residuals_of, suspects_of, tests_of, uncontrolled_kinds
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import (
    DatumCarriers,
    Parameters,
    Residuals,
    Solution,
    StripTransformations,
    Tests,
    VarianceComponents,
)
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.geometry.vectors import finite_rows
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.graph.component import WIDE_RAD
from aatri.orientation.graph.triangulation import contradicting, residuals_mm


def initial_solution(
    block: Block,
    image_points: ImagePoints,
    rays: ImagePointRows,
    origin_m: Float,
    parts: list[OnGround],
    method: str,
    suspects: Suspects,
    *,
    tests: bool = False,
) -> Solution:
    """The Solution of components on the ground; an image of several components is that of the first."""
    n, m = len(block.images), len(block.points)
    position, rotation, xyz = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((m, 3), np.nan)
    reliability, components, uncontrolled = [Tests.empty()], [VarianceComponents.empty()], [Uncontrolled.empty()]
    tables, moves = [Residuals.empty()], [StripTransformations.empty()]
    suspect_tables = [suspects]
    kept, own = np.zeros(len(rays.image), dtype=bool), np.zeros(len(rays.image), dtype=bool)
    free, member = parts[0].free, np.zeros(n, dtype=np.int64)
    origin = np.zeros(3) if free else origin_m
    for number, part in enumerate(parts, 1):
        c = part.component
        new, points = c.images & ~finite_rows(position), finite_rows(c.xyz) & ~finite_rows(xyz)
        member[new] = number
        position[new], rotation[new] = c.poses.position_m[new] + origin, c.poses.ground_from_image[new]
        xyz[points] = c.xyz[points] + origin
        kept |= c.kept & new[rays.image] & points[rays.point]
        own |= c.kept
        moves.append(pieces.similarity_rows(f"component {number}", part.similarity, origin))
        if part.oriented is not None:
            tied = part.oriented.tied
            tables.append(residuals_of(tied, part.oriented.state))
            reliability.append(tests_of(tied))
            components.append(components_of(tied))
            suspect_tables.append(suspects_of(tied, STAGE, part.oriented.began))
            uncontrolled.append(uncontrolled_kinds(tied))
            left_at = {**tied.problem.start, **part.oriented.state}
            suspect_tables += [left_out_table(o, residuals_at(left_at, o)) for o in part.left]
    reached = rays.active & finite_rows(position)[rays.image] & finite_rows(xyz)[rays.point]
    poses = Poses(position, rotation)
    # Components that nothing joined lie apart by more than rays do: their own rays are not to blame.
    apart = np.flatnonzero(reached & own & ~kept)
    kept[apart] = residuals_mm(rays, apart, poses, xyz) <= WIDE_RAD * rays.c_mm[apart]
    suspect_tables.append(_trimmed(block, rays, poses, xyz, np.flatnonzero(reached & ~kept), "rejected"))
    spread = max(part.component.spread for part in parts)
    contrary = _of_one(rays, contradicting(rays, poses, xyz, spread), member)
    suspect_tables.append(_trimmed(block, rays, poses, xyz, contrary, "undecidable"))
    used, solved = int(2 * kept.sum()), finite_rows(xyz)
    solution = pieces.solution_of(
        block,
        image_points,
        pieces.Placed(position, rotation, xyz),
        method=method,
        counts=(used, int(6 * finite_rows(position).sum() + 3 * solved.sum())),
        sigma0=float("nan"),
        iterations=0,
        transformations=stacked(moves),
        parameters=Parameters.empty(),
        residuals=stacked(tables),
        suspects=stacked(suspect_tables),
        uncontrolled=stacked(uncontrolled),
        tests=stacked(reliability) if tests else None,
        components=stacked(components) if tests else None,
    )
    solution = replace(solution, cameras=solved_cameras(block))
    if free:
        return replace(solution, datum=DatumCarriers(kind=np.array(["held"]), id=np.array([""])))
    return solution


def _of_one(rays: ImagePointRows, rows: Int, member: Int) -> Int:
    """The rays of points that images of one component see: between components that nothing joined none is to blame."""
    n = int(rays.point.max(initial=0)) + 1
    least, most = np.full(n, len(member) + 1), np.full(n, -1)
    np.minimum.at(least, rays.point[rows], member[rays.image[rows]])
    np.maximum.at(most, rays.point[rows], member[rays.image[rows]])
    return np.asarray(rows[(least == most)[rays.point[rows]]])


def _trimmed(block: Block, rays: ImagePointRows, poses: Poses, xyz: Float, rows: Int, verdict: str) -> Suspects:
    """Image points that do not fit the points of the others, or those of a point of which no two clearly fit."""
    n, off = len(rows), residuals_mm(rays, rows, poses, xyz)
    sigma = rays.sigma_mm[rows].mean(axis=1)
    finite: Bool = np.isfinite(off)
    return Suspects(
        kind=np.full(n, "image_point"),
        row=rows.astype(np.int32),
        image=block.images.id[rays.image[rows]],
        point=block.points.id[rays.point[rows]],
        stage=np.full(n, STAGE),
        size=np.where(finite, off, np.nan),
        unit=np.full(n, "mm"),
        sigma=sigma,
        test=np.where(finite, off / sigma, np.nan),
        verdict=np.full(n, verdict),
    )
