"""Direct georeferencing: orientations from GNSS and IMU alone, without tie points or control.

    X0 = X_antenna - R a,    R = R_obs exp([b]x),    C_X0 = C_antenna + [R a]x C_d [R a]x'

a is the lever arm, b the boresight, both as the block gives them; R_obs is made of the observed angles (omega, phi,
kappa; phi, omega, kappa; or roll, pitch, heading with the mount and the meridian convergence), C_d of their standard
deviations and those of the boresight. Points follow by intersection, each ray weighted by its own standard deviation
and its pose's covariance; every point for itself, so that points say nothing of the poses. Errors that all images share
(boresight, shift of the positions) are in the covariances of single poses, but not between them.

Source: Baeumker and Heimes 2001 (OEEPE, integrated sensor orientation); docs/formulas.md 5.6.
"""

from aatri.adapters.ground.direct import direct_solution
from aatri.adapters.refinement.corrections import without_distortion
from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.checks.after.rays_miss import rays_miss
from aatri.checks.finding import report
from aatri.notes import tell
from aatri.observations.attitudes import USES as OF_ATTITUDES
from aatri.plugin import SILENT, Context, stage


@stage(
    version=1,
    uses=(
        "exterior.position_m",
        "cameras.lever_arm_m",
        "cameras.distortion",
        "earth_curvature:frame",
        "undulation",
        *OF_ATTITUDES,
    ),
)
def direct(block: Block, image_points: ImagePoints | None = None, *, context: Context = SILENT) -> Solution:
    """Orient images by their observed positions and angles."""
    check_same_block(block, image_points=image_points)
    if image_points is not None:
        image_points, of_lens = without_distortion(block, image_points)
        tell(of_lens, context)
    solution, notes = direct_solution(block, image_points)
    report([*notes, *rays_miss(solution)], context)
    return solution
