"""Errors of an adjusted block against its truth, and their whole covariance matrix by a dense inverse.

Nothing of it is shared with the core but the Jacobians of the observations.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.geometry.rotations import log_rotation
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.adjusted_terms import adjusted_with_terms, with_converged_terms
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.orientation.bundle.settings import BundleSettings
from aatri.stages.bundle_adjustment._self_calibration import chosen_set, parameters_of
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.adjustment.reference import dense_jacobian, free_columns

Float = np.ndarray

Own = list[tuple[slice, Float]]
"""Place of each pose and point among the errors, and its covariance as the solution has it."""


def dense_errors(
    block: Block, points: ImagePoints, solution: Solution, options: BundleOptions
) -> tuple[Float, Float, int, Own]:
    """Errors of all poses and points, their covariance by a dense inverse, its rank, and single covariances.

    A free datum says nothing of the similarity between block and truth: it is fitted to all points, on which such a
    datum rests, and the covariance is brought to the datum of all points by a projection of its own.
    """
    chosen = chosen_set(block, options.self_calibration, observed_positions(block, options))
    parameters = parameters_of(block, points, options.interior_unknowns, chosen)
    given = bundle_input(observation_source(block, points, solution, parameters), options, solution.suspects)
    adjust = partial(adjust_bundle, settings=BundleSettings(options.datum, covariances=False))
    formed = AdjustedBlock(given, adjusted_with_terms(given, adjust, adjust))
    adjusted = with_converged_terms(formed, adjust, adjust).result.adjusted
    problem = adjusted.problem
    J, _ = dense_jacobian(problem.unknowns, [r.take(np.flatnonzero(r.active)) for r in problem.records], adjusted.state)
    Q = np.linalg.inv(J.T @ J)
    columns = free_columns(problem.unknowns)
    place = np.concatenate([columns[POSE].ravel(), columns[POINT].ravel()])
    both = (place >= 0)[:, None] & (place >= 0)[None, :]
    C = np.where(both, Q[np.ix_(place, place)], 0.0)
    truth, stations = block.true_points, block.true_images
    assert truth is not None
    assert stations is not None
    X, X0, R = solution.points.xyz_m, solution.images.position_m, solution.images.ground_from_image
    rank = len(place)
    true_X, true_X0 = truth.xyz_m[np.argsort(truth.point)], stations.position_m[np.argsort(stations.image)]
    true_R = stations.ground_from_image[np.argsort(stations.image)]
    if options.datum == "free":
        s, turn, shift = _similarity(true_X, X)
        true_X, true_X0, true_R = s * true_X @ turn.T + shift, s * true_X0 @ turn.T + shift, turn @ true_R
        P = _onto_points(X, X0)
        C, rank = P @ C @ P.T, rank - 7
    d_pose = np.concatenate([X0 - true_X0, log_rotation(R @ true_R.swapaxes(1, 2))], axis=1)
    d = np.concatenate([d_pose.ravel(), (X - true_X).ravel()])
    n = 6 * len(X0)
    own = [(slice(6 * i, 6 * i + 6), S) for i, S in enumerate(solution.images.covariance)]
    own += [(slice(n + 3 * i, n + 3 * i + 3), S) for i, S in enumerate(solution.points.covariance_m2)]
    return d, C, rank, own


def observed_positions(block: Block, options: BundleOptions) -> bool:
    """Whether positions of the block are observations."""
    return bool(np.isfinite(block.exterior.position_covariance_m2).all()) and len(block.exterior) > 0


def _similarity(x: Float, X: Float) -> tuple[float, Float, Float]:
    """Scale, rotation and shift that bring x nearest to X (Umeyama 1991)."""
    a, b = x - x.mean(axis=0), X - X.mean(axis=0)
    U, _, Vt = np.linalg.svd(b.T @ a)
    turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    s = float(np.trace(turn.T @ b.T @ a) / (a**2).sum())
    return s, turn, X.mean(axis=0) - s * turn @ x.mean(axis=0)


def _onto_points(X: Float, X0: Float) -> Float:
    """I - H (H_p'H_p)^-1 H_p', to the datum of all points, p; H what a similarity does to poses and points."""
    middle = X.mean(axis=0)

    def moved(at: Float) -> Float:
        a, zero = (at - middle) / 100.0, np.zeros(len(at))
        turn = np.stack(
            [
                np.stack([zero, a[:, 2], -a[:, 1]], 1),
                np.stack([-a[:, 2], zero, a[:, 0]], 1),
                np.stack([a[:, 1], -a[:, 0], zero], 1),
            ],
            1,
        )
        return np.concatenate([np.broadcast_to(np.eye(3), (len(at), 3, 3)), turn, a[:, :, None]], axis=2)

    turned = np.concatenate([np.zeros((3, 3)), np.eye(3) / 100.0, np.zeros((3, 1))], axis=1)
    poses = np.concatenate([moved(X0), np.broadcast_to(turned, (len(X0), 3, 7))], axis=1).reshape(-1, 7)
    H = np.concatenate([poses, moved(X).reshape(-1, 7)])
    G = H * (np.arange(len(H)) >= len(poses))[:, None]
    return np.asarray(np.eye(len(H)) - H @ np.linalg.solve(G.T @ H, G.T))
