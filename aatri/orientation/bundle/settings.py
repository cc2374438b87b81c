"""How a bundle is to be adjusted: stated once, by the options of the stage."""

from dataclasses import dataclass, field
from typing import Literal

from aatri.adjustment.problem import SolverSettings
from aatri.arrays import Float

Datum = Literal["given", "minimal", "free"]
DatumOver = Literal["points", "images", "marked"]


@dataclass(frozen=True)
class BundleSettings:
    """Settings of a bundle adjustment."""

    datum: Datum = "given"
    """`given` by control and positions, or `minimal`: the pose of the first image and one coordinate of the image
    farthest from it are held at their start, which changes no residual of a block without any datum; or `free`: inner
    constraints for what control and positions leave open, see `free_datum`."""
    datum_over: DatumOver = "points"
    """What a free datum rests on: all points, the projection centres of all images, or the marked points."""
    covariances: bool = True
    """There are none where observations are down-weighted."""
    keep_factor: bool = False
    """Of the covariances, for score tests after the adjustment."""
    keep_cheap_factor: bool = False
    """Of the covariances where it takes little memory (`is_cheap`): the next adjustment of a search gives it back."""
    huber: float | None = None
    """Bound of Huber's loss of all kinds but priors, in standard deviations; what is exact has none. See
    `aatri.adjustment.loss`."""
    weights: tuple[Float, ...] = ()
    """Tuple of (n,). Weights of all observations, kind by kind; empty: 1."""
    solution: SolverSettings = field(default_factory=SolverSettings)
    """How the normal equations are solved."""
