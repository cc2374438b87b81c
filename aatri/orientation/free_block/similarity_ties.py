"""Points of strips that go to the ground by one similarity each.

    x_o = T_j + s_j R_j x + R_j b,     dx_o = dT + [s R x + R b]x' d + s R x m

with the seven unknowns of geometry.similarity per strip; x are coordinates in the strip, reduced to a centre of its
own, b lever arms along the strip's axes in metres. Covariances turn with the strip: s^2 R C R'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.records import Bind, Fill, Weigh
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import ConvergenceError
from aatri.geometry.rotations import exp_rotation, skew
from aatri.geometry.similarity import Similarity
from aatri.orientation.free_block.kernels import ties as kernels
from aatri.orientation.free_block.tie_records import POINT, STRIP, Ties, spectrum_of

FARTHEST = 20.0
"""Step of the logarithm of a scale that no start calls for: a factor of 5e8."""

RUN_AWAY = "no scale fits, it runs away from its start: what is given of the ground contradicts itself or the strips"
CONTRADICTION = (
    "are X and Y of the control exchanged, its axes left-handed, or its units or zone others than those of the "
    "observed positions?"
)

LABELS = ("X", "Y", "Z", "rotation about X", "rotation about Y", "rotation about Z", "scale")


@dataclass(frozen=True)
class Similarities:
    """One similarity per strip: shift (n, 3), scale (n,) and rotation (n, 3, 3)."""

    translation: Float
    scale: Float
    rotation: Float

    def __getitem__(self, strip: int) -> Similarity:
        """That of one strip."""
        return Similarity(self.translation[strip], float(self.scale[strip]), self.rotation[strip])


def similarities_of(single: Sequence[Similarity]) -> Similarities:
    """Similarities side by side."""
    return Similarities(
        np.stack([s.translation for s in single]),
        np.array([s.scale for s in single]),
        np.stack([s.rotation for s in single]),
    )


def moved(value: Similarities, step: Float) -> Similarities:
    """After a step, (n, 7).

    Raises
    ------
    ConvergenceError
        If a scale runs away.
    """
    if (np.abs(step[:, 6]) > FARTHEST).any():
        raise ConvergenceError(RUN_AWAY, remedy=CONTRADICTION)
    return Similarities(
        value.translation + step[:, :3],
        value.scale * np.exp(step[:, 6]),
        exp_rotation(step[:, 3:6]) @ value.rotation,
    )


def remainders(old: Similarities, new: Similarities) -> tuple[Float, Float]:
    """What linear models of s R and of R leave, norms of each, (n,).

        |s'R' - s R - s ([d]x + m I) R|,    |R' - R - [d]x R|

    d and m are the rotation and the logarithm of the ratio of the scales from old to new; infinite for turns beyond a
    quarter.
    """
    turn = new.rotation @ old.rotation.swapaxes(1, 2)
    sine = 0.5 * np.stack([turn[:, k, j] - turn[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)
    length = np.linalg.norm(sine, axis=1)
    small = (length < 1) & (np.einsum("nii->n", turn) > 1)
    angle = np.arcsin(np.where(small, length, 0.0))
    d = skew(sine * np.where(length > 0, angle / np.where(length > 0, length, 1.0), 1.0)[:, None])
    ratio = (new.scale / old.scale)[:, None, None]
    of_scaled = np.linalg.norm(ratio * turn - d - (1 + np.log(ratio)) * np.eye(3), axis=(1, 2)) * old.scale
    of_rotation = np.linalg.norm(turn - d - np.eye(3), axis=(1, 2))
    return np.where(small, of_scaled, np.inf), np.where(small, of_rotation, np.inf)


def similarity_ties(
    strip: Int, point: Int, x: Float, covariance: Float, *, names: Sequence[str] | Text, n_points: int,
    free: Bool | None = None, offset_m: Float | None = None,
) -> Ties[Similarities]:  # fmt: skip
    """Ties by similarities.

    Parameters
    ----------
    strip, point : (n,) int
    x : (n, 3) float64, unit of the strip
        Reduced to a centre of the strip.
    covariance : (n, 3, 3) float64, unit of the strip squared
    names : (n_strips,) sequence of str
    n_points : int
    free : (n_strips,) bool, optional
        False for strips that are held.
    offset_m : (n, 3) float64, m, optional
        Lever arms, along the strip's axes.
    """
    strip, point = strip.astype(np.int32), point.astype(np.int32)
    values, vectors = spectrum_of(covariance)

    def arms(state: Similarities, rows: Int) -> tuple[Float, Float]:
        """s R x, and the same with R b."""
        k = strip[rows]
        R = state.rotation[k]
        scaled = state.scale[k][:, None] * np.einsum("nij,nj->ni", R, x[rows])
        return scaled, scaled if offset_m is None else scaled + np.einsum("nij,nj->ni", R, offset_m[rows])

    def on_ground(state: Similarities, rows: Int) -> Float:
        return state.translation[strip[rows]] + arms(state, rows)[1]

    def derivatives(state: Similarities, rows: Int) -> Float:
        scaled, arm = arms(state, rows)
        J = np.empty((len(rows), 3, 7))
        J[:, :, :3] = np.eye(3)
        J[:, :, 3:6] = -skew(arm)
        J[:, :, 6] = scaled
        return J

    def compiled(order: Int, base_m: Float) -> Weigh:
        k, q, own = strip[order], point[order], np.ascontiguousarray(x[order])
        arm = np.zeros_like(own) if offset_m is None else np.ascontiguousarray(offset_m[order])

        def weigh(T: Float) -> Bind:
            def bind(state: State) -> Fill:
                poses: Similarities = state[STRIP]
                moved_by = (np.ascontiguousarray(poses.translation), np.ascontiguousarray(poses.scale))
                R, X = np.ascontiguousarray(poses.rotation), np.ascontiguousarray(state[POINT])
                given = (k, q, np.ascontiguousarray(T), X, base_m, own, arm, *moved_by, R)
                return lambda first, last, v, J: kernels.similarity(first, last, *given, v, *J)

            return bind

        return weigh

    def spectrum(state: Similarities) -> tuple[Float, Float]:
        return state.scale[strip][:, None] ** 2 * values, state.rotation[strip] @ vectors

    reach = np.zeros(len(names))
    np.maximum.at(reach, strip, np.linalg.norm(x, axis=1))
    arm_m = 0.0 if offset_m is None else float(np.linalg.norm(offset_m, axis=1).max(initial=0.0))

    def bend_m(old: Similarities, new: Similarities) -> float:
        of_scaled, of_rotation = remainders(old, new)
        with np.errstate(invalid="ignore"):  # an infinite turn of no arm: NaN, no bound
            return float((of_scaled * reach + of_rotation * arm_m).max(initial=0.0))

    moving = np.ones(len(names), dtype=bool) if free is None else free
    unknowns = Unknowns(STRIP, np.repeat(moving[:, None], 7, axis=1), LABELS, list(map(str, names)), moved)
    return Ties(strip, point, on_ground, derivatives, spectrum, unknowns, n_points, bend_m, compiled)
