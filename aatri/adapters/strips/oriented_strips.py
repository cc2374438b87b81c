"""Between artifacts and the methods that orient strips: strip points in, a Solution back out."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.adapters import solution as assemble
from aatri.arrays import Bool, Float, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import Iterations, Parameters, Solution, StripTransformations, VarianceComponents
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.geometry.rotations import angles_from_rotation
from aatri.geometry.similarity import Similarity
from aatri.notes import Note

SIMILARITY_PARAMETERS = ("TX_m", "TY_m", "TZ_m", "scale", "omega_rad", "phi_rad", "kappa_rad")


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
    return StripTransformations.of(
        id=name, model="similarity", parameter=SIMILARITY_PARAMETERS, value=values, sigma=sigma
    )


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
    residuals: Residuals,
    suspects: Suspects,
    transformations: StripTransformations | None = None,
    parameters: Parameters | None = None,
    point_covariance_m2: Float | None = None,
    image_covariance: Float | None = None,
    sigma0_um: float = float("nan"),
    uncontrolled: Uncontrolled | None = None,
    tests: Tests | None = None,
    components: VarianceComponents | None = None,
) -> Solution:
    """A Solution of images and points on the ground; the cameras are as given.

    Parameters
    ----------
    counts : (int, int)
        Observations and unknowns.
    point_covariance_m2 : (n_points, 3, 3) float64, m^2, optional
    image_covariance : (n_images, 6, 6) float64, m and rad, optional
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
        sigma0_um=sigma0_um,
        iterations=iterations,
        images=assemble.oriented_images(block, placed.position_m, placed.ground_from_image, rays[0], image_covariance),
        points=assemble.ground_points(block, placed.point_m, rays[1], point_covariance_m2),
        cameras=assemble.solved_cameras(block),
        transformations=StripTransformations.empty() if transformations is None else transformations,
        parameters=Parameters.empty() if parameters is None else parameters,
        residuals=residuals,
        history=Iterations.empty(),
        suspects=suspects,
        uncontrolled=uncontrolled,
        tests=tests,
        variance_components=components,
    )
