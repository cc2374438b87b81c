"""Between artifacts and the methods that orient strips: strip points in, a Solution back out."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.adapters import solution as assemble
from aatri.arrays import Bool, Float, Text, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import Iterations, Parameters, Solution, StripTransformations, VarianceComponents
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects, Uncontrolled, staying_out
from aatri.geometry.rotations import angles_from_rotation
from aatri.geometry.similarity import Similarity
from aatri.notes import Note
from aatri.observations.control import Control
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.component_growth import BodyPoints

SIMILARITY_PARAMETERS = ("TX_m", "TY_m", "TZ_m", "scale", "omega_rad", "phi_rad", "kappa_rad")


def origin_of(control: Control, position_m: Float) -> Float:
    """A round place near the block, (3,) m: coordinates are reduced to it before any arithmetic."""
    observed_m = np.concatenate([np.where(control.given, control.xyz_m, np.nan), position_m])
    sums, counts = np.nansum(observed_m, axis=0), np.isfinite(observed_m).sum(axis=0)
    return np.asarray(np.round(sums / np.maximum(counts, 1)))


def strip_points_of(strips: Strips) -> BodyPoints:
    """Points of free strips."""
    table = strips.strip_points
    return BodyPoints(table.strip.astype(np.int64), table.point.astype(np.int64), table.xyz, table.covariance)


def usable_ties(strips: Strips) -> Bool:
    """Strip points that no earlier stage has rejected, (n,) bool."""
    table = strips.strip_points
    if not len(strips.suspects):
        return np.ones(len(table), dtype=bool)
    return ~named_by_suspects(strips.suspects, STRIP_TIE, strips.strips.id[table.strip], strips.points.id[table.point])


def named_by_suspects(suspects: Suspects, kind: str, image: Text, point: Text) -> Bool:
    """Observations of a kind, (n,), that suspects which stay out name by the ids of image (or body) and point."""
    out = suspects.take(np.flatnonzero((suspects.kind == kind) & staying_out(suspects)))
    names = set(zip(out.image.tolist(), out.point.tolist()))
    return np.array([pair in names for pair in zip(image.tolist(), point.tolist())], dtype=bool)


def most_models(strips: Strips) -> int:
    """Models of the longest strip."""
    return int(np.bincount(strips.strip_images.strip).max(initial=1)) - 1


def distance_m(position_m: Float, point_m: Float) -> float:
    """From the middle of the projection centres to that of the points, m."""
    return float(np.linalg.norm(np.nanmean(position_m, axis=0) - np.nanmean(point_m, axis=0)))


def left_out(block: Block, oriented: Bool) -> list[Note]:
    """A warning that names the images in use that are not oriented."""
    left = np.flatnonzero(~oriented & block.images.active)
    text = f"not oriented ({len(left)} of {len(block.images)} images)"
    return [Note("warning", text, tuple(block.images.id[left].tolist()))] if len(left) else []


def similarity_rows(
    name: str, similarity: Similarity, origin_m: Float, sigma: npt.ArrayLike = np.nan
) -> StripTransformations:
    """The seven parameters from the free strip to the ground; angles omega, phi, kappa of the rotation."""
    values = [
        *(similarity.translation + origin_m),
        similarity.scale,
        *angles_from_rotation(similarity.rotation, "omega-phi-kappa"),
    ]
    return transformation_rows(name, "similarity", SIMILARITY_PARAMETERS, values, sigma)


def transformation_rows(
    name: str, model: str, parameters: tuple[str, ...], values: npt.ArrayLike, sigma: npt.ArrayLike = np.nan
) -> StripTransformations:
    """Parameters of one strip's transformation."""
    return StripTransformations.of(id=name, model=model, parameter=parameters, value=values, sigma=sigma)


def precision_row(name: str, tau_m: float) -> Parameters:
    """The deformation of strips that was added to the standard deviation of their points."""
    return Parameters.of(group="strip_precision", object=[name], name="tau_m", value=tau_m, sigma=np.nan)


@dataclass(frozen=True)
class Placed:
    """Images and points of a block on the ground."""

    position_m: Float
    """(n_images, 3), m. NaN where not oriented."""
    ground_from_image: Float
    """(n_images, 3, 3)."""
    point_m: Float
    """(n_points, 3), m. NaN where not determined."""


def solution_of(
    block: Block,
    image_points: ImagePoints | None,
    placed: Placed,
    *,
    method: str,
    counts: tuple[int, int],
    sigma0: float,
    iterations: int,
    transformations: StripTransformations,
    parameters: Parameters,
    residuals: Residuals,
    suspects: Suspects,
    point_covariance_m2: Float | None = None,
    uncontrolled: Uncontrolled | None = None,
    tests: Tests | None = None,
    components: VarianceComponents | None = None,
) -> Solution:
    """A Solution without covariances of its orientations.

    Parameters
    ----------
    counts : (int, int)
        Observations and unknowns.
    point_covariance_m2 : (n_points, 3, 3) float64, m^2, optional
    uncontrolled : Uncontrolled, optional
    tests : Tests, optional
        Of the observations in the order of the residuals.
    components : VarianceComponents, optional
    """
    oriented, solved = finite_rows(placed.position_m), finite_rows(placed.point_m)
    rays = np.zeros(len(oriented), dtype=np.int64), np.zeros(len(solved), dtype=np.int64)
    if image_points is not None:
        measured = image_points.measurements
        used = measured.active & finite_rows(measured.xy_mm) & oriented[measured.image] & solved[measured.point]
        rays = (
            np.bincount(measured.image[used], minlength=len(oriented)),
            np.bincount(measured.point[used], minlength=len(solved)),
        )
    return Solution(
        method=method,
        observations=counts[0],
        unknowns=counts[1],
        redundancy=counts[0] - counts[1],
        sigma0=sigma0,
        sigma0_um=float("nan"),
        iterations=iterations,
        images=assemble.oriented_images(block, placed.position_m, placed.ground_from_image, rays[0]),
        points=assemble.ground_points(block, placed.point_m, rays[1], point_covariance_m2),
        cameras=assemble.solved_cameras(block),
        transformations=transformations,
        parameters=parameters,
        residuals=residuals,
        history=Iterations.empty(),
        suspects=suspects,
        uncontrolled=uncontrolled,
        tests=tests,
        variance_components=components,
    )
