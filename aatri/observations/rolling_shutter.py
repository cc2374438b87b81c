"""Rolling shutters: every row of an image is exposed from where the camera is then, not from where the image stands.

    x(t) = x + (dx/dX0) V t + O(t^2),   V velocity of the camera, t row time from that of the image

The measured coordinates are corrected by -(dx/dX0) V t s: to first order in V t, the way flown between rows, by the
distance of the ground. What is left is of the order f (V t / D)^2: at 10 m/s, 30 ms and 80 m 0.02 px of 1,500. Turns of
the camera within a readout are not in it: they are not seen by the attitudes of neighbouring images.

s is 1 where the row times are known; weighted or free it is the readout of a camera, as a share of what its row times
say. V is that of the steps to the images before and after, without the step from one strip to the next; what the camera
did otherwise at an image, dV, may be unknown: -(dx/dX0) dV t. Turns of omega and phi look much the same, and go there.

Source: Ait-Aider et al., ECCV 2006 (linear motion within an image); Vautherin et al., ISPRS Annals III-3 (2016) 139
(drones: the motion along the flight is what matters).
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.collinearity import collinearity
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.limits import ALONG_STRIP
from aatri.observations.poses import Poses

ROLLING, VELOCITY = "rolling shutter", "velocity"
"""Groups of unknowns: readouts of cameras; velocities of images beside those of the steps, m/s."""


def by_velocity(rays: ImagePointRows, poses: Poses, xyz_m: Float, row_time_s: Float) -> Float:
    """Corrections of image points (n, 2, 3), mm, by the velocity of their camera, m/s.

    Parameters
    ----------
    xyz_m : (n_points, 3) float64, m
    row_time_s : (n,) float64, s
        NaN where it is not known: there is no correction there, nor where the point or the pose is not known.
    """
    by_point = collinearity(  # the negative of dx/dX0
        poses.position_m[rays.image], poses.ground_from_image[rays.image], xyz_m[rays.point], rays.c_mm
    )[2]
    return np.asarray(np.nan_to_num(by_point * row_time_s[:, None, None]))


def flown_velocities(time_s: Float, track: Int, position_m: Float) -> Float:
    """Velocities (n, 3), m/s, by the steps to the images before and after; NaN where there are none.

    Parameters
    ----------
    time_s : (n,) float64, s
    track : (n,) int
        Images of one camera and flight.
    position_m : (n, 3) float64, m
    """
    velocity_m_per_s = np.full((len(time_s), 3), np.nan)
    usable = np.isfinite(time_s) & np.isfinite(position_m).all(axis=1)
    for one_track in np.unique(track[usable]):
        rows = np.flatnonzero(usable & (track == one_track))
        rows = rows[np.argsort(time_s[rows], kind="stable")]
        rows = rows[np.append(True, np.diff(time_s[rows]) > 0)]
        if len(rows) < 2:
            continue
        step = np.diff(position_m[rows], axis=0) / np.diff(time_s[rows])[:, None]
        length = np.linalg.norm(step, axis=1)
        onward = (step[1:] * step[:-1]).sum(axis=1) > ALONG_STRIP * length[1:] * length[:-1]
        in_strip = np.append(onward, False) | np.append(False, onward)
        # a step across to the next strip counts only where an image has no other
        weight = np.where(in_strip, 1.0, 1e-9)
        both = np.zeros((len(rows), 3))
        total = np.zeros(len(rows))
        for side in (slice(None, -1), slice(1, None)):
            both[side] += weight[:, None] * step
            total[side] += weight
        velocity_m_per_s[rows] = both / total[:, None]
    return velocity_m_per_s
