"""What attitudes tell when they are held against the orientations of the images: a wrong convention.

    exp([b]x) = R_obs' B' R      of every image: the turn of the camera that its attitude lacks

Seen: attitudes that contradict the images, all of them.
Test: the b of a camera scatter by more than `WRONG_ATTITUDES_RAD` in the median, or in nine of ten, as one strip of
three flown the other way does. Then the angles are tried in the other conventions in use: the other system, opposite
signs, the transposed matrix, another unit; the one in which as many agree is proposed. What all b of a camera have in
common, its boresight, is tested after the adjustment, with the covariance of the orientations.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, finite_rows
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import (
    AGREEING_READING,
    FEWEST_ATTITUDES,
    SAME_READING,
    SHARES_OF_ATTITUDES,
    WRONG_ATTITUDES_RAD,
)
from aatri.geometry.rotations import angle_axes, body_from_mount, log_rotation, nearest_rotation
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.attitudes import attitudes_of
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE
from aatri.orientation.bundle.block import BundleInput

NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
UNITS = {
    "gon, declared as degrees": 0.9,
    "degrees, declared as gon": 1 / 0.9,
    "radians, declared as degrees": 180 / np.pi,
    "radians, declared as gon": 200 / np.pi,
    "thousandths of the unit declared": 1e-3,
}
"""What angles may be in instead, and their factor."""


def attitude_conventions(
    source: ObservationSource, inputs: BundleInput, state: State, *, before: bool
) -> list[Finding]:
    """Attitudes in another convention than declared: an error before the adjustment, if the right one is found.

    Parameters
    ----------
    source : ObservationSource
        What the attitudes were taken from.
    state : mapping
        Orientations: those that an earlier stage has made, or the adjusted ones.
    before : bool
        It is before the adjustment.
    """
    used = [o.row[o.records.active] for o in inputs.observed if o.kind == ATTITUDE and not o.exact]
    if not used:
        return []
    block, rows = source.block, attitudes_of(source)
    rotation = rows.axes.swapaxes(1, 2) @ state[POSE].ground_from_image[rows.image]
    usable = finite_rows(rotation) & finite_rows(rows.observed) & np.isin(rows.row, np.concatenate(used))
    findings = list[Finding]()
    for camera in np.unique(rows.camera[usable]).tolist():
        of_camera = np.flatnonzero(usable & (rows.camera == camera))
        if len(of_camera) < FEWEST_ATTITUDES:
            continue
        angles, name = block.exterior.angles_rad[rows.row[of_camera]], str(block.cameras.id[camera])
        seen = _of_camera(block.rotation, name, angles, rows.observed[of_camera], rotation[of_camera], before)
        findings += [] if seen is None else [seen]
    return findings


def _of_camera(
    declared: str, camera: str, angles: Float, observed: Float, rotation: Float, before: bool
) -> Finding | None:
    """What is wrong with the attitudes of a camera."""
    remedy = "check the angle system, its unit and the times of the attitudes"
    unread: Finding | None = None
    for share in SHARES_OF_ATTITUDES:
        scatter = _scatter(observed, rotation, share)
        if scatter <= WRONG_ATTITUDES_RAD:
            continue
        readings = [(_scatter(R, rotation, share), what) for what, R in readings_of(angles)]
        least = min(readings)[0]
        best, what = next(reading for reading in readings if reading[0] <= SAME_READING * least)
        text = f"attitudes as {declared} differ from the orientations of its images by {np.degrees(scatter):.3g} deg "
        text += "beyond any common offset"
        place = f"camera {camera}"
        if best <= AGREEING_READING * scatter:
            level: Level = "error" if before else "warning"
            text += f"; read as {what} they agree to {np.degrees(best):.2g} deg"
            remedy = f"declare them as {what} (rotation, heading, mount, units in block.yaml), or convert them"
            return Finding("attitude_convention", level, text, remedy, where=place, statistic=scatter)
        if share <= 0.5:  # more than half of them
            unread = Finding("attitude_convention", "warning", text, remedy, where=place, statistic=scatter)
    return unread


def _scatter(observed: Float, rotation: Float, share: float) -> float:
    """Turn between attitudes and orientations beyond a common one that this share of them does not exceed, rad."""
    lacking = observed.swapaxes(1, 2) @ rotation
    common = nearest_rotation(np.median(lacking, axis=0))
    return float(np.quantile(np.linalg.norm(log_rotation(lacking @ common.T), axis=1), share))


def readings_of(angles: Float) -> Iterator[tuple[str, Float]]:
    """The same angles in other conventions: what it is called, and R_obs; the simplest first."""
    names = {
        "omega-phi-kappa": ("omega", "phi", "kappa"),
        "phi-omega-kappa": ("phi", "omega", "kappa"),
        "roll-pitch-heading": ("roll", "pitch", "heading"),
    }

    def observed(angles_rad: Float, system: str, *, transposed: bool = False) -> Float:
        R, _ = angle_axes(angles_rad, system)
        R = R.swapaxes(1, 2) if transposed else R
        return NED @ R @ body_from_mount(np.zeros(len(R))) if system == "roll-pitch-heading" else R

    flips = sorted(itertools.product((1, -1), repeat=3), key=lambda s: -sum(s))
    for transposed, signs, system in itertools.product((False, True), flips, names):
        turned = [name for name, sign in zip(names[system], signs) if sign < 0]
        what = system + (f" with {', '.join(turned)} of opposite sign" if turned else "")
        what += ", the transposed matrix (image from ground)" if transposed else ""
        yield what, observed(angles * np.array(signs), system, transposed=transposed)
    for unit, factor in UNITS.items():
        yield from ((f"{system} in {unit}", observed(factor * angles, system)) for system in names)
    for a, b in ((0, 1), (1, 2), (0, 2)):
        order = [0, 1, 2]
        order[a], order[b] = order[b], order[a]
        for system in names:
            yield f"{system} with a{a + 1} and a{b + 1} exchanged", observed(angles[:, order], system)
