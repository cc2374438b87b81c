"""Control that fits a body only mirrored, or with two numbers exchanged."""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity, robust_closed_form
from aatri.observations.control import KIND as CONTROL
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.datum_start import UPWARDS
from aatri.orientation.bodies.exchanged_control import FEWEST, exchanged_control

CLEARLY_UPWARDS = 0.17
"""Sine of the elevation, 10 degrees, above which images look upwards in the mean where the control says so too."""

FEWEST_MIRRORED, CLEARLY = 5, 0.2
"""Fewer full points say nothing of whether mirrored ones fit better: whether their misfit is less than this share."""

FLAT = 1e-3
"""Misfit, as a share of the extent, of points that are not mirrored: they fit, or lie in a plane and fit either way."""


def exchanged_of(places: GivenPlaces, fewest: int = FEWEST) -> Int:
    """Two control points with each other's number, among places known in full; none otherwise."""
    full = np.flatnonzero(places.given.all(axis=1) & np.isin(places.kind, [CONTROL, POSITION]))
    full = full[np.argsort(places.kind[full] != CONTROL, kind="stable")]
    n_control = int((places.kind[full] == CONTROL).sum())
    return full[exchanged_control(places.xyz[full], places.observed_m[full], n_control, fewest)]


def refuse_mirrored(places: GivenPlaces, used: Bool, to: Similarity, up: Float, what: str) -> None:
    """Raise if control or images must be mirrored.

    Parameters
    ----------
    places : GivenPlaces
    used : (n,) bool
        Those that are not rejected.
    to : Similarity
        Ground from body.
    up : (3,) float64
        Direction against the mean viewing direction, in the body.

    Raises
    ------
    GeometryError
    """
    reason = _mirrored(places.take(used), to, up)
    if not reason:
        return
    two = places.name[exchanged_of(places, 3)].tolist()
    if two:
        text = f"{what}: {reason}, unless {' and '.join(two)} have each other's number"
        raise GeometryError(text, remedy="exchange the two numbers in the control, or leave both out")
    raise GeometryError(
        f"{what}: {reason}",
        remedy="declare the axes of the control in their true order, [north, east, up] or [east, north, up]; check "
        "the y axis of the image coordinates (pixel: y)",
    )


def _mirrored(kept: GivenPlaces, to: Similarity, up: Float) -> str:
    """Why control or images must be mirrored: control fits much better mirrored, or the images look upwards.

    Images of facades, or of what stands above them, may look upwards rightly. Points in a plane fit as well when they
    are mirrored; of these it counts how steeply the images look upwards.
    """
    steep = -float((to.rotation @ up)[2]) / float(np.linalg.norm(up))
    text = "oriented by its control the images look upwards, so the control is mirrored"
    full = kept.given.all(axis=1)
    if full.sum() >= FEWEST_MIRRORED:
        x, X = kept.xyz[full], kept.observed_m[full]
        as_it_is, other = (np.median(robust_closed_form(x, X * [1.0, 1.0, sign])[1]) for sign in (1.0, -1.0))
        if other < CLEARLY * as_it_is and as_it_is > FLAT * float(np.linalg.norm(np.ptp(X, axis=0))):
            return text if steep > CLEARLY_UPWARDS else "control and positions fit it mirrored only"
        if as_it_is < CLEARLY * other:
            return ""
    return text if steep > UPWARDS else ""
