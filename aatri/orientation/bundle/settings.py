"""How a bundle is to be adjusted: stated once, by the options of the stage."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from aatri.adjustment.settings import Settings

Datum = Literal["given", "minimal", "free"]
DatumOver = Literal["points", "images", "marked"]


@dataclass(frozen=True)
class BundleSettings:
    """Settings of a bundle adjustment.

    Attributes
    ----------
    datum : str
        `given` by control and positions, or `minimal`: the pose of the first image and one coordinate of the image
        farthest from it are held at their start, which changes no residual of a block without any datum; or `free`:
        inner constraints for what control and positions leave open, see `free_datum`.
    datum_over : str
        What a free datum rests on: all points, the projection centres of all images, or the marked points.
    covariances : bool
        There are none where observations are down-weighted.
    huber : float, optional
        Bound of Huber's loss of the image points, in their standard deviations; see `aatri.adjustment.loss`.
    loss_on_all : bool
        The loss is that of all kinds of observations but priors; what is exact has none.
    solution : Settings
        How the normal equations are solved.
    """

    datum: Datum = "given"
    datum_over: DatumOver = "points"
    covariances: bool = True
    huber: float | None = None
    loss_on_all: bool = False
    solution: Settings = field(default_factory=Settings)
