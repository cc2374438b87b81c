"""Points of strips that go to the ground by one similarity each.

    x_o = T_j + s_j R_j x,     dx_o = dT + [s R x]x' d + s R x m

with the seven unknowns of geometry.similarity per strip; x are coordinates in the strip, reduced to a centre of its
own. Covariances turn with the strip: s^2 R C R'.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.kernels.spectra import eigen, turn
from aatri.adjustment.records import Bind, Fill, Weigh
from aatri.adjustment.threads import in_threads
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import ConvergenceError
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import Similarity, motions
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, Ties
from aatri.orientation.bodies.kernels import ties as kernels

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


def similarity_ties(
    strip: Int,
    point: Int,
    x: Float,
    covariance: Float,
    *,
    names: Sequence[str] | Text,
    free: Bool | None = None,
    group: str = POINT,
) -> Ties[Similarities]:
    """Ties by similarities.

    Parameters
    ----------
    strip, point : (n,) int
    x : (n, 3) float64, unit of the strip
        Reduced to a centre of the strip.
    covariance : (n, 3, 3) float64, unit of the strip squared
    names : (n_strips,) sequence of str
    free : (n_strips,) bool, optional
        False for strips that are held.
    group : str
        Ground points, or images: of projection centres.
    """
    strip, point = strip.astype(np.int32), point.astype(np.int32)
    values, vectors = spectrum_of(covariance)

    def arms(state: Similarities, rows: Int) -> Float:
        """s R x."""
        k = strip[rows]
        turned: Float = np.einsum("nij,nj->ni", state.rotation[k], x[rows])
        return np.asarray(state.scale[k][:, None] * turned)

    def on_ground(state: Similarities, rows: Int) -> Float:
        return np.asarray(state.translation[strip[rows]] + arms(state, rows))

    def derivatives(state: Similarities, rows: Int) -> Float:
        return motions(arms(state, rows))

    def compiled(order: Int) -> Weigh:
        k, q, own = strip[order], point[order], np.ascontiguousarray(x[order])

        def weigh(T: Float) -> Bind:
            def bind(state: State) -> Fill:
                poses: Similarities = state[BODY]
                moved_by = (np.ascontiguousarray(poses.translation), np.ascontiguousarray(poses.scale))
                R, X = np.ascontiguousarray(poses.rotation), np.ascontiguousarray(state[POINT])
                arguments = (k, q, np.ascontiguousarray(T), X, own, *moved_by, R)
                return lambda first, last, v, J: kernels.similarity(first, last, *arguments, v, *J)

            return bind

        return weigh

    def spectrum(state: Similarities) -> tuple[Float, Float]:
        return turned_spectrum(strip, state, values, vectors)

    moving = np.ones(len(names), dtype=bool) if free is None else free
    unknowns = Unknowns(BODY, np.repeat(moving[:, None], 7, axis=1), LABELS, list(map(str, names)), moved)
    lane = compiled if group == POINT else None
    return Ties(strip, point, on_ground, derivatives, spectrum, unknowns, compiled=lane, group=group)


def turned_spectrum(body: Int, state: Similarities, values: Float, vectors: Float) -> tuple[Float, Float]:
    """Eigenvalues (n, 3) and eigenvectors (n, 3, 3) of covariances after the similarity of their body, (n,) int32."""
    turned = np.empty_like(values), np.empty_like(vectors)
    pose = np.ascontiguousarray(state.scale), np.ascontiguousarray(state.rotation)
    in_threads(len(body), lambda first, last: turn(first, last, body, *pose, values, vectors, *turned))
    return turned


def spectrum_of(covariance: Float) -> tuple[Float, Float]:
    """Eigenvalues (n, 3), none negative, and eigenvectors by columns (n, 3, 3) of covariances (n, 3, 3)."""
    values, vectors = np.empty(covariance.shape[:2]), np.empty(covariance.shape)
    eigen(0, len(values), np.require(covariance, np.float64, ["C", "W"]), values, vectors)
    return np.maximum(values, 0.0), vectors
