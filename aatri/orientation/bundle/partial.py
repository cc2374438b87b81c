"""Bundles of which a part is known: resection of images on known points, intersection of points from known images.

What is not adjusted is held at its value, or is an observation of itself with the covariance it came with:

    points    v = X - X_known
    images    v = (X0 - X0_known, log(R R_known'))           dv = (dX0, d): exact for small corrections

Held, every image (resection) or point (intersection) is a problem of its own; weighted, what is known is corrected too.
Observations of what is known alone, positions of known images or control among known points, take no part: they say
nothing of the rest, and are in the covariance already. They are no redundancy either.

Source: Kraus, Photogrammetry 1, resection and intersection; docs/formulas.md 3.4, 3.7.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.arrays import Bool, Float, Int
from aatri.geometry.rotations import log_rotation
from aatri.notes import Note
from aatri.observations.given_coordinates import value_records
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle.block import BundleInput


def of_unknown(inputs: BundleInput, group: str) -> BundleInput:
    """The block with the observations that see images or points, `group`; others are switched off.

    What observes further unknowns of these, priors of cameras or film, stays.
    """
    touched = [o.records.groups for o in inputs.observed]
    unknown_groups = {name for names in touched if group in names for name in names} - ({POSE, POINT} - {group})
    observed = tuple(
        o
        if group in names or names <= unknown_groups
        else replace(o, records=replace(o.records, active=np.zeros(len(o), dtype=bool)))
        for o, names in zip(inputs.observed, touched)
    )
    return replace(inputs, observed=observed)


def switched_off(before: BundleInput, after: BundleInput) -> list[Note]:
    """A note of the kinds of observation that were in use before and are not after."""
    used = [{o.kind: int(o.records.active.sum()) for o in block.observed} for block in (before, after)]
    kinds = [f"{n} of kind {kind}" for kind, n in used[0].items() if n and not used[1].get(kind)]
    text = "observations of what is known alone take no part: " + ", ".join(kinds)
    return [Note("note", text)] if kinds else []


def with_known_points(inputs: BundleInput, points: Bool, covariance_m2: Float | None) -> BundleInput:
    """The block with points held, or observed with their covariances; other points take no part.

    Parameters
    ----------
    points : (n_points,) bool
    covariance_m2 : (n_points, 3, 3) float64, m^2, or None
        None: held.
    """
    inputs = replace(of_unknown(inputs, POSE), xyz_m=np.where(points[:, None], inputs.xyz_m, np.nan))
    if covariance_m2 is None:
        return replace(inputs, held_points=points)
    rows = np.flatnonzero(points)
    records = value_records("point_prior", POINT, rows.astype(np.int32), inputs.xyz_m[rows], covariance_m2[rows])
    names = named(point=np.asarray(inputs.point_ids, dtype=np.str_)[rows])
    return replace(inputs, observed=(*inputs.observed, Observed(records, np.full(len(rows), -1), names, "m")))


def with_known_images(inputs: BundleInput, images: Bool, covariance: Float | None) -> BundleInput:
    """The block with images held, or observed with their covariances; other images take no part.

    Parameters
    ----------
    images : (n_images,) bool
    covariance : (n_images, 6, 6) float64, m and rad, or None
        Of position and rotation increment. None: held.
    """
    poses = inputs.poses.where(images)
    inputs = replace(of_unknown(inputs, POINT), poses=poses)
    if covariance is None:
        return replace(inputs, held_images=images)
    rows = np.flatnonzero(images)
    position, rotation = poses.position_m[rows], poses.ground_from_image[rows]

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        now: Poses = state[POSE]
        turned = log_rotation(now.ground_from_image[rows[chosen]] @ rotation[chosen].swapaxes(1, 2))
        v = np.concatenate([now.position_m[rows[chosen]] - position[chosen], turned], axis=1)
        return v, (np.broadcast_to(np.eye(6), (len(chosen), 6, 6)),)

    whitener = whitener_of_covariances(covariance[rows], np.ones((len(rows), 6), dtype=bool))
    touches = ((POSE, rows.astype(np.int32)),)
    records = Records("image_prior", touches, evaluate, whitener, np.ones(len(rows), dtype=bool))
    names = named(image=np.asarray(inputs.image_ids, dtype=np.str_)[rows])
    components = ("X0", "Y0", "Z0", "rotation about X", "rotation about Y", "rotation about Z")
    return replace(
        inputs, observed=(*inputs.observed, Observed(records, np.full(len(rows), -1), names, "", components=components))
    )
