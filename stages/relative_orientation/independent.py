"""Independent relative orientation: both images turn, the base stays along the X axis of the model.

Unknowns are phi1 and kappa1 of the left image, phi2, omega2 and kappa2 of the right one (Chinese system); the base is
(1, 0, 0). Every point measured in both images gives the condition that base and rays are coplanar,

    e_x . (R1 u1 x R2 u2) = 0,   R1 = R(phi1, 0, kappa1),   R2 = R(phi2, omega2, kappa2),   u = (x, y, -c).

With rigorous weights the five angles are another set of parameters of the model that the dependent method finds: the
shape of the model, the y-parallaxes and the statistics are the same, and the angles and their standard deviations
follow exactly from R = R1' R2 and b = R1' e_x. `models` stay in the frame of the left image, as the next stages take
them; the angles stand in the table `elements`. With `equation: q` or `determinant` the equations of equal weight are
formed in the frame along the base, and the model differs from the dependent one.

Pairs, start values, gross errors and what makes no model: as in relative_orientation/dependent.

Source: docs/formulas.md 3.3; see aatri/orientation/relative/elements.py, equal_weights.py and pairs.py.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.plugin import SILENT, Context, stage

from ._pairs import ClassicalOptions, oriented


@stage(version=1, uses=("images.strip", "cameras.distortion"))
def independent(
    block: Block,
    image_points: ImagePoints,
    *,
    options: ClassicalOptions = ClassicalOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient the consecutive images of every strip, in frames along their bases."""
    return oriented(block, image_points, "independent", options, context)
