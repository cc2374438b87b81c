"""The Solution of components on the ground, and what an initial orientation has to say of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.solution import stacked, suspect_rows
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import components_of, residuals_of, suspects_of, tests_of, uncontrolled_kinds
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import DatumCarriers, Solution, VarianceComponents
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.ids import shown
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows, residuals_mm
from aatri.observations.observed import Observed
from aatri.observations.poses import Poses
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.ground_tests import residuals_at
from aatri.orientation.graph.limits import WIDE_RAD
from aatri.orientation.graph.neighbouring_components import OnGround
from aatri.orientation.graph.triangulation import contradicting

STAGE = "initial_orientation"

LEAST_SIGMA = 1e-6
"""Of what is exact, m or rad."""


@dataclass(frozen=True)
class _Placed:
    """Images and points of all components on the ground."""

    poses: Poses
    xyz: Float
    """Of the block; NaN where no component has them."""
    component: Int
    """(n_images,). Number of the component that gives the image, from 1; 0 none."""
    kept: Bool
    """(n_rays,). Rays that fit."""
    reached: Bool
    """(n_rays,). Rays in use whose image and point are there."""


def initial_solution(
    block: Block,
    image_points: ImagePoints,
    rays: ImagePointRows,
    origin_m: Float,
    parts: Sequence[OnGround],
    suspects: Suspects,
    *,
    tests: bool = False,
) -> Solution:
    """The Solution of components on the ground; an image of several components is that of the first."""
    free = parts[0].free
    origin = np.zeros(3) if free else origin_m
    placed = _placed(block, rays, parts, origin)
    oriented = [part.oriented for part in parts if part.oriented is not None]
    spread = max(part.component.spread for part in parts)
    contrary = _of_one(rays, contradicting(rays, placed.poses, placed.xyz, spread), placed.component)
    position, solved = placed.poses.position_m, finite_rows(placed.xyz)
    solution = pieces.solution_of(
        block,
        image_points,
        pieces.Placed(position, placed.poses.ground_from_image, placed.xyz),
        method=f"{STAGE}/graph",
        counts=(int(2 * placed.kept.sum()), int(6 * finite_rows(position).sum() + 3 * solved.sum())),
        sigma0=float("nan"),
        iterations=0,
        transformations=stacked(
            [pieces.similarity_rows(f"component {k}", part.similarity, origin) for k, part in enumerate(parts, 1)]
        ),
        residuals=stacked([Residuals.empty(), *(residuals_of(o.tied, o.state) for o in oriented)]),
        suspects=stacked(
            [
                suspects,
                *(table for part in parts for table in _left_out_on_ground(part)),
                _trimmed(block, rays, placed, np.flatnonzero(placed.reached & ~placed.kept), "rejected"),
                _trimmed(block, rays, placed, contrary, "undecidable"),
            ]
        ),
        uncontrolled=stacked([Uncontrolled.empty(), *(uncontrolled_kinds(o.tied) for o in oriented)]),
        tests=stacked([Tests.empty(), *(tests_of(o.tied) for o in oriented)]) if tests else None,
        components=stacked([VarianceComponents.empty(), *(components_of(o.tied) for o in oriented)]) if tests else None,
    )
    marked = [part.datum for part in parts if part.datum is not None]
    carriers = np.unique(np.concatenate(marked)) if marked else np.array([""] * free)
    if not len(carriers):
        return solution
    return replace(solution, datum=DatumCarriers(np.full(len(carriers), "held" if free else "point"), carriers))


def _placed(block: Block, rays: ImagePointRows, parts: Sequence[OnGround], origin_m: Float) -> _Placed:
    n, m = len(block.images), len(block.points)
    position, rotation, xyz = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((m, 3), np.nan)
    kept, own = np.zeros(len(rays.image), dtype=bool), np.zeros(len(rays.image), dtype=bool)
    component = np.zeros(n, dtype=np.int64)
    for number, c in enumerate((part.component for part in parts), 1):
        new, points = c.images & ~finite_rows(position), finite_rows(c.xyz) & ~finite_rows(xyz)
        component[new] = number
        position[new], rotation[new] = c.poses.position_m[new] + origin_m, c.poses.ground_from_image[new]
        xyz[points] = c.xyz[points] + origin_m
        kept |= c.kept & new[rays.image] & points[rays.point]
        own |= c.kept | (new[rays.image] & ~finite_rows(c.xyz)[rays.point])  # it has nothing against the latter
    reached = rays.active & finite_rows(position)[rays.image] & finite_rows(xyz)[rays.point]
    poses = Poses(position, rotation)
    # Components that nothing joined lie apart by more than rays do: rays between them are not to blame.
    apart = np.flatnonzero(reached & own & ~kept)
    kept[apart] = residuals_mm(rays, apart, poses, xyz) <= WIDE_RAD * rays.c_mm[apart]
    return _Placed(poses, xyz, component, kept, reached)


def _left_out_on_ground(part: OnGround) -> list[Suspects]:
    """What of the observations of the ground does not fit a component."""
    if (oriented := part.oriented) is None:
        return []
    at = {**oriented.tied.problem.start, **oriented.state}
    tested = suspects_of(oriented.tied, STAGE, oriented.began)
    return [tested, *(left_out_table(o, residuals_at(at, o)) for o in part.left)]


def _of_one(rays: ImagePointRows, rows: Int, component: Int) -> Int:
    """The rays of points that images of one component see: between components that nothing joined none is to blame."""
    n = int(rays.point.max(initial=0)) + 1
    least, most = np.full(n, len(component) + 1), np.full(n, -1)
    np.minimum.at(least, rays.point[rows], component[rays.image[rows]])
    np.maximum.at(most, rays.point[rows], component[rays.image[rows]])
    return np.asarray(rows[(least == most)[rays.point[rows]]])


def _trimmed(block: Block, rays: ImagePointRows, placed: _Placed, rows: Int, verdict: str) -> Suspects:
    """Image points that do not fit the points of the others, or those of a point of which no two clearly fit."""
    off = residuals_mm(rays, rows, placed.poses, placed.xyz)
    sigma = rays.sigma_mm[rows].mean(axis=1)
    finite: Bool = np.isfinite(off)
    return suspect_rows(
        STAGE,
        "image_point",
        row=rows,
        image=block.images.id[rays.image[rows]],
        point=block.points.id[rays.point[rows]],
        size=np.where(finite, off, np.nan),
        sigma=sigma,
        test=np.where(finite, off / sigma, np.nan),
        verdict=verdict,
    )


def shown_components(components: tuple[ImageComponent, ...], block: Block) -> list[Note]:
    """Sizes of the components; the images of all but the first by name."""
    if len(components) == 1:
        return [Note("note", f"one component of {int(components[0].images.sum())} images")]
    return [
        Note(
            "warning",
            f"{len(components)} components that are not joined; number {k} has {int(c.images.sum())} "
            f"images: {shown(block.images.id[c.images])}",
        )
        for k, c in enumerate(components, 1)
        if k > 1
    ]


def left_out_table(o: Observed, residual: Float) -> Suspects:
    """All of one kind, left out as it contradicts all else: the bundle begins without it and tests it again."""
    size, (image, point) = np.sqrt(np.nansum(residual**2, axis=1)), o.names(np.arange(len(o)))
    test = np.sqrt(np.nanmean((residual / np.maximum(o.sigmas(), LEAST_SIGMA)) ** 2, axis=1))
    sigma = np.where(test > 0, size / np.where(test > 0, test, 1.0), np.nan)
    return suspect_rows(
        STAGE, o.kind, image=image, point=point, row=o.row, size=size, unit=o.unit, sigma=sigma, test=test
    )
