"""Rotations of images as programs state them, and positions.

Two camera systems are in use. In the *photogrammetric* one x is right, y up, and the camera looks along -z; in that of
*vision* x is right, y down, and it looks along +z. So, with D = diag(1, -1, -1) = D^-1,

    R_photogrammetric = R_vision D,    where both map image to ground

A program gives R (ground from image) or R' (image from ground); as a matrix, a unit quaternion w x y z, a rotation
vector, or three angles. A translation t of `u = R' X + t` belongs to the position X0 = -R t. `CONVENTIONS` says which
program does what; each row has been tried by projecting a point (tests/formats/conventions).

Sources: the programs' manuals, named in docs/formats.md.

Whether the matrices of a list map image to ground or ground to image, where its format does not say.

In a flight an axis of the image lies along the line, or across it. With h the direction of flight and a that of the
image x axis on the ground, the columns of R, cos 4(h - a) is about 1 for the true sense; for the other one a has the
other sign, and cos 4(h + a) scatters, unless the lines run along the axes of the ground system. There both senses are
the same but for small angles, and as start values one is as good as the other.
"""

from typing import Literal, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.limits import ALONG_FLIGHT, APART_SENSES, FEWEST_NEIGHBOURS, LONG_STEP, NOT_ORTHOGONAL
from aatri.geometry.rotations import ENU_FROM_NED, angle_axes, angles_from_rotation, body_from_mount

Y_UP = np.array([1.0, -1.0, -1.0])
"""Diagonal of D: camera axes of vision to photogrammetric ones, and back."""

Sense = Literal["ground_from_image", "image_from_ground"]
SENSES: tuple[Sense, Sense] = ("ground_from_image", "image_from_ground")


class PoseConvention(NamedTuple):
    """Camera axes of a program, and which way its rotations map."""

    axes: Literal["photogrammetric", "vision"]
    maps: Literal["ground_from_image", "image_from_ground"]


CONVENTIONS = {
    "bal": PoseConvention("photogrammetric", "image_from_ground"),
    "blocksexchange": PoseConvention("vision", "image_from_ground"),
    "bundler": PoseConvention("photogrammetric", "image_from_ground"),
    "colmap": PoseConvention("vision", "image_from_ground"),
    "inpho": PoseConvention("photogrammetric", "image_from_ground"),
    "metashape": PoseConvention("vision", "ground_from_image"),
    "micmac": PoseConvention("vision", "ground_from_image"),
    "nvm": PoseConvention("vision", "image_from_ground"),
    "opensfm": PoseConvention("vision", "image_from_ground"),
    "opf": PoseConvention("photogrammetric", "ground_from_image"),
    "opk": PoseConvention("photogrammetric", "ground_from_image"),
    "patb": PoseConvention("photogrammetric", "ground_from_image"),
    "pix4d": PoseConvention("vision", "image_from_ground"),
}
"""What a rotation matrix means, by program. Angles omega, phi, kappa are those of `opk`: R = Rx Ry Rz."""

UPPER_EDGE_AHEAD_DEG = 90
"""Mount of a camera that looks straight down with its upper edge ahead: image x is to the right of the nose."""


def ground_from_image(stated: Float, program: str) -> Float:
    """Our rotations of those that a program states.

    Parameters
    ----------
    stated : (n, 3, 3) float64
    program : str
        One of `CONVENTIONS`.

    Returns
    -------
    (n, 3, 3) float64
        Photogrammetric axes, image to ground.
    """
    axes, maps = CONVENTIONS[program]
    rotation = stated if maps == "ground_from_image" else stated.swapaxes(-1, -2)
    return np.asarray(rotation * Y_UP if axes == "vision" else rotation)


def stated_rotation(ground_from_image: Float, program: str) -> Float:
    """The rotations as a program states them, of ours (n, 3, 3)."""
    axes, maps = CONVENTIONS[program]
    rotation = ground_from_image * Y_UP if axes == "vision" else ground_from_image
    return np.asarray(rotation if maps == "ground_from_image" else rotation.swapaxes(-1, -2))


def position_of(ground_from_image: Float, translation: Float, program: str) -> Float:
    """Projection centres X0 = -R t (n, 3) of translations t in the camera axes of a program."""
    in_our_axes = translation * Y_UP if CONVENTIONS[program].axes == "vision" else translation
    return np.asarray(-np.einsum("nij,nj->ni", ground_from_image, in_our_axes))


def translation_of(ground_from_image: Float, position_m: Float, program: str) -> Float:
    """Translations t = -R' X0 (n, 3) in the camera axes of a program."""
    t = -np.einsum("nji,nj->ni", ground_from_image, position_m)
    return np.asarray(t * Y_UP if CONVENTIONS[program].axes == "vision" else t)


def rotation_of_carrier(roll_pitch_yaw_rad: Float) -> tuple[Float, Float]:
    """The rotation of a camera whose attitude is told as that of a carrier, and the axes of the three angles.

    Parameters
    ----------
    roll_pitch_yaw_rad : (n, 3) float64, rad
        Of a camera that looks straight down at 0 0 0, its upper edge ahead; yaw clockwise from north.

    Returns
    -------
    ground_from_image, axes : (n, 3, 3) float64
        East, north, up; a change da of the angles turns by exp([axes da]x).
    """
    R, axes = angle_axes(roll_pitch_yaw_rad, "roll-pitch-heading")
    return ENU_FROM_NED @ R @ body_from_mount(UPPER_EDGE_AHEAD_DEG), ENU_FROM_NED @ axes


def carrier_angles(ground_from_image: Float) -> Float:
    """Roll, pitch and yaw (n, 3), rad, of a camera told as a carrier: the inverse of `rotation_of_carrier`."""
    body = ENU_FROM_NED.T @ ground_from_image @ body_from_mount(UPPER_EDGE_AHEAD_DEG).T
    return angles_from_rotation(body, "roll-pitch-heading")


def matrix_of_quaternion(wxyz: Float) -> Float:
    """Rotation matrices (n, 3, 3) of quaternions w x y z (n, 4) of any length but zero."""
    from scipy.spatial.transform import Rotation  # its import takes half a second

    return np.asarray(Rotation.from_quat(np.roll(wxyz, -1, axis=-1)).as_matrix())


def quaternion_of_matrix(rotation: Float) -> Float:
    """Unit quaternions w x y z (n, 4), w >= 0."""
    from scipy.spatial.transform import Rotation

    return np.asarray(np.roll(Rotation.from_matrix(rotation).as_quat(canonical=True), 1, axis=-1))


def is_rotation(matrix: Float) -> bool:
    """Whether a 3 x 3 matrix is a rotation but for the rounding of its digits: no reflection, no scale."""
    orthogonal = np.abs(matrix @ matrix.T - np.eye(3)).max() <= NOT_ORTHOGONAL
    return bool(orthogonal and np.linalg.det(matrix) > 0)


class MatrixSense(NamedTuple):
    """The sense that a flight shows; None: it shows none. `decided`: the other one does not fit."""

    sense: Sense | None
    decided: bool


def sense_of(matrices: Float, position_m: Float, usual: Sense = "ground_from_image") -> MatrixSense:
    """The sense of some matrices.

    Parameters
    ----------
    matrices : (n, 3, 3) float64
        As stated; image axes photogrammetric (x right, y up).
    position_m : (n, 3) float64, m
        East, north, up, in the order of the flight.
    usual : str
        Taken where both senses fit.
    """
    step = np.diff(position_m[:, :2], axis=0)
    length = np.linalg.norm(step, axis=1)
    median = float(np.median(length[length > 0])) if (length > 0).any() else 0.0
    pairs = np.flatnonzero((length > 0) & (length <= LONG_STEP * median))
    if len(pairs) < FEWEST_NEIGHBOURS:
        return MatrixSense(None, decided=False)
    heading = np.arctan2(step[pairs, 1], step[pairs, 0])
    fits: dict[Sense, float] = {}
    for sense, R in zip(SENSES, (matrices, matrices.swapaxes(1, 2))):
        axis = np.arctan2(R[pairs, 1, 0], R[pairs, 0, 0])
        fits[sense] = float(np.cos(4 * (heading - axis)).mean())
    best = max(fits, key=lambda sense: fits[sense])
    if fits[best] < ALONG_FLIGHT:
        return MatrixSense(None, decided=False)
    decided = fits[best] - min(fits.values()) > APART_SENSES
    return MatrixSense(best if decided else usual, decided)


def as_ground_from_image(
    stated: Float, position_m: Float, maps: Sense | None, where: str, usual: Sense = "ground_from_image"
) -> tuple[Float, str]:
    """Matrices (n, 3, 3) as image to ground, and by what that is known, in words.

    Parameters
    ----------
    stated, position_m, usual
        As `sense_of` takes them; matrices that are not known are NaN.
    maps : str, optional
        The sense, if the user says it.
    where : str
        Place of the list.

    Raises
    ------
    InputError
        If neither the user nor the flight says it.
    """
    sense, reason = maps, "as `maps` says"
    if sense is None:
        complete = np.isfinite(stated).all(axis=(1, 2)) & np.isfinite(position_m).all(axis=1)
        shown = sense_of(stated[complete], position_m[complete], usual)
        sense, reason = shown.sense, "as the lines of the flight show"
        if sense is not None and not shown.decided:
            reason = "as usual: with lines along the axes of the ground system both senses are alike"
    if sense is None:
        what = "nothing says which way the rotation matrices map, and the positions are no lines that would show it"
        raise InputError(
            what, where=where, remedy=f"say which, `--set maps=...` or in a pipeline `maps`: {' or '.join(SENSES)}"
        )
    R = stated if sense == "ground_from_image" else stated.swapaxes(1, 2)
    return R, f"matrices are read as {sense.replace('_', ' ')}, {reason}"
