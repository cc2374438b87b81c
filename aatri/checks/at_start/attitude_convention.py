"""What attitudes tell when they are held against the orientations of the images: a wrong convention.

    exp([b]x) = R_obs' B' R      of every image: the turn of the camera that its attitude lacks

Seen: attitudes that contradict the images, all of them.
Test: the b of a camera, less `UNLIKELY_SIGMAS` of the angles, scatter by more than `WRONG_ATTITUDES_RAD` in the median,
or in nine of ten, as one strip of three flown the other way does. Then the reading is
proposed in which they agree (`angle_readings`); by nine of ten where the others agree in it as well as before, and
`FEWEST_ATTITUDES` did not: fewer are gross errors, which the adjustment looks for. What all b of a camera have in
common, its boresight, is tested after the adjustment, with the covariance of the orientations; where it is fixed, and
lacks more than `LARGEST_BORESIGHT_RAD`, no adjustment converges. Up to half that lack one turn of their own,
larger than that, in which most agree to `WRONG_ATTITUDES_RAD`, are told together.
Attitudes that no reading explains are told after the adjustment alone: a start of weak strips is as wrong itself.
"""

from functools import partial

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text, finite_rows
from aatri.checks.at_start.angle_readings import agreeing_reading, unlikely_turns
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import (
    FEWEST_ATTITUDES,
    LARGEST_BORESIGHT_RAD,
    SAME_READING,
    SHARES_OF_ATTITUDES,
    WRONG_ATTITUDES_RAD,
)
from aatri.geometry.rotations import exp_rotation, log_rotation, nearest_rotation
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.attitudes import Attitudes, attitudes_of, whole_differences
from aatri.observations.carried_vectors import BORESIGHT
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE
from aatri.orientation.bundle.block import BundleInput

MOST_CANDIDATES = 50
"""Attitudes, evenly taken, of which that is the common one which is nearest to half of all."""


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
    unknowns = [u for o in inputs.observed for u in o.unknowns if u.name == BORESIGHT]
    rotation = rows.axes.swapaxes(1, 2) @ state[POSE].ground_from_image[rows.image]
    usable = finite_rows(rotation) & finite_rows(rows.observed) & np.isin(rows.row, np.concatenate(used))
    findings = list[Finding]()
    for camera in np.unique(rows.camera[usable]).tolist():
        of_camera = np.flatnonzero(usable & (rows.camera == camera))
        if len(of_camera) < FEWEST_ATTITUDES:
            continue
        angles_rad, name = block.exterior.angles_rad[rows.row[of_camera]], str(block.cameras.id[camera])
        seen = _of_camera(block.rotation, name, angles_rad, rows.take(of_camera), rotation[of_camera], before)
        if seen is None and before and not any(u.free[camera].any() for u in unknowns):
            boresight, mount_deg = exp_rotation(block.cameras.boresight_rad[camera]), block.cameras.mount_deg[camera]
            unturned = rotation[of_camera] @ boresight.T
            seen = _turned_alike(block.rotation, name, float(mount_deg), rows.take(of_camera), unturned)
        if seen is None and before:
            seen = _some_turned_alike(block.images.id, name, rows.take(of_camera), rotation[of_camera])
        findings += [] if seen is None else [seen]
    return findings


def _turned_alike(declared: str, camera: str, mount_deg: float, rows: Attitudes, rotation: Float) -> Finding | None:
    """An error where all attitudes of a camera are turned by more than boresights and their standard deviations are."""
    about_rad = log_rotation(_lacking(rows.observed, rotation)[1])
    off = _unlikely(rows, rotation) > WRONG_ATTITUDES_RAD
    if 2 * np.count_nonzero(off) == len(off) and _agreeing(rows, rotation, np.flatnonzero(off)).mean() > 0.5:
        return None  # either half may be turned
    if unlikely_turns(about_rad, np.nanmedian(rows.sigma_rad, axis=0)) <= LARGEST_BORESIGHT_RAD:
        return None
    about_deg = np.degrees(about_rad)
    turn = ", ".join(f"{angle:.1f}" for angle in about_deg.round(1) + 0.0)
    text = f"attitudes as {declared} are turned from the orientations of all images by one rotation of {turn} deg "
    text += f"about the axes of the camera, more than a boresight can be ({np.degrees(LARGEST_BORESIGHT_RAD):.0f} deg)"
    remedy = "check the angle system and how the camera is mounted (mount, rigs in block.yaml)"
    quarter = 90.0 * np.round(about_deg[2] / 90.0)
    if np.abs(about_deg - [0.0, 0.0, quarter]).max() < 0.5 * np.degrees(LARGEST_BORESIGHT_RAD):
        by_body, mount = declared == "roll-pitch-heading", (mount_deg - quarter) % 360
        remedy = f"give `mount: {mount:.0f}`" if by_body else f"add {quarter % 360:.0f} deg to kappa"
        remedy += ", if it is image x that points another way"
    return Finding("attitude_convention", "error", text, remedy, where=f"camera {camera}")


def _some_turned_alike(images: Text, camera: str, rows: Attitudes, rotation: Float) -> Finding | None:
    """A warning where up to half of the attitudes lack one turn beside the others, as of a strip flown back."""
    is_off = _unlikely(rows, rotation) > WRONG_ATTITUDES_RAD
    off = np.flatnonzero(is_off)
    if not FEWEST_ATTITUDES <= len(off) <= 0.5 * len(rotation):
        return None
    alike = off[_agreeing(rows, rotation, off)]
    if len(alike) < max(FEWEST_ATTITUDES, 0.5 * len(off)):
        return None
    others = np.flatnonzero(~is_off)
    of_part, of_others = (_lacking(rows.observed[k], rotation[k])[1] for k in (alike, others))
    if len(off) == len(others) and np.trace(of_part) > np.trace(of_others):  # the less turned ones are right
        alike, of_part, of_others = others, of_others, of_part
    turn_rad = log_rotation(of_part @ of_others.T)
    if np.linalg.norm(turn_rad) <= LARGEST_BORESIGHT_RAD:  # by less a start may be off, where control holds it badly
        return None
    turn = ", ".join(f"{angle:.1f}" for angle in np.degrees(turn_rad).round(1) + 0.0)
    text = f"{len(alike)} of {len(rotation)} attitudes are turned beside the others by one rotation of {turn} deg "
    text += "about the axes of the camera"
    remedy = "check these images: a strip flown back, or measured in photographs that lie the other way"
    names = tuple(images[rows.image[alike]].tolist())
    which = {ATTITUDE: rows.row[alike]}
    return Finding("attitude_convention", "warning", text, remedy, where=f"camera {camera}", ids=names, rows=which)


def _agreeing(rows: Attitudes, rotation: Float, chosen: Int) -> Bool:
    """Which of some attitudes lack one turn, as most of these do, (n,)."""
    return np.asarray(_unlikely(rows.take(chosen), rotation[chosen]) <= WRONG_ATTITUDES_RAD)


def _of_camera(
    declared: str, camera: str, angles_rad: Float, rows: Attitudes, rotation: Float, before: bool
) -> Finding | None:
    """What is wrong with the attitudes of a camera."""
    remedy = "check the angle system, its unit and the times of the attitudes"
    unread, unlikely = None, _unlikely(rows, rotation)
    too_many = (unlikely > WRONG_ATTITUDES_RAD).sum() >= FEWEST_ATTITUDES  # for gross errors
    for share in SHARES_OF_ATTITUDES:
        if np.quantile(unlikely, share, method="inverted_cdf") <= WRONG_ATTITUDES_RAD:
            continue
        scatter = _scatter(rows.observed, rotation, share)
        text = f"attitudes as {declared} differ from the orientations of its images by {np.degrees(scatter):.3g} deg "
        text += "beyond any common offset"
        place = f"camera {camera}"
        scatter_of = partial(_scatter, rotation=rotation, share=share)
        reading = agreeing_reading(angles_rad, rows.observed, scatter_of, declared)
        if reading is not None and (share <= 0.5 or (too_many and _suits_others(rows.observed, reading[1], rotation))):
            level: Level = "error" if before else "warning"
            text += f"; read as {reading[0]} they agree to {np.degrees(_scatter(reading[1], rotation, share)):.2g} deg"
            remedy = f"declare them as {reading[0]} (rotation, heading, mount, units in block.yaml), or convert them"
            return Finding("attitude_convention", level, text, remedy, where=place, statistic=scatter)
        if share <= 0.5 and not before:  # more than half of them
            unread = Finding("attitude_convention", "warning", text, remedy, where=place, statistic=scatter)
    return unread


def _lacking(observed: Float, rotation: Float) -> tuple[Float, Float]:
    """Turns between attitudes and orientations beyond a common one, (n,) rad, and the common one, (3, 3)."""
    lacking = observed.swapaxes(1, 2) @ rotation
    n, half = len(lacking), (len(lacking) + 1) // 2
    candidates = lacking[:: -(-n // MOST_CANDIDATES)]
    nearness = lacking.reshape(n, 9) @ candidates.reshape(-1, 9).T  # trace: 1 + 2 cos of the angle between them
    best = np.argmax(np.sort(nearness, axis=0)[n - half])  # half of them may lie elsewhere, all in one place
    common = nearest_rotation(np.median(lacking[np.argsort(-nearness[:, best], kind="stable")[:half]], axis=0))
    return np.linalg.norm(log_rotation(lacking @ common.T), axis=1), common


def _scatter(observed: Float, rotation: Float, share: float) -> float:
    """Turn between attitudes and orientations beyond a common one that this share of them does not exceed, rad."""
    return float(np.quantile(_lacking(observed, rotation)[0], share, method="inverted_cdf"))


def _suits_others(observed: Float, reading: Float, rotation: Float) -> bool:
    """Those that agree as declared do so in the reading as well."""
    return _scatter(reading, rotation, 0.5) <= SAME_READING * _scatter(observed, rotation, 0.5)


def _unlikely(rows: Attitudes, rotation: Float) -> Float:
    """Turns between attitudes and orientations beyond what standard deviations allow, (n,) rad."""
    turns, common = _lacking(rows.observed, rotation)
    v, _ = whole_differences(rotation @ common.T, rows.observed, rows.turning)
    return np.minimum(turns, unlikely_turns(v, rows.sigma_rad))
