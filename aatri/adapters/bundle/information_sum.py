"""Two Informations as one: normal equations added at one place, what nobody else has eliminated.

    N = N1 + T'N2 T,    g = g1 + T'(N2 d + g2),    c = c1 + c2 + 2 g2'd + d'N2 d,    d = x1 - x2

T are the derivatives of the differences d by a step at x1: the unit matrix, for rotations the inverse left Jacobian.
Unknowns that the first does not have stay where the second has them.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adapters.bundle.information_observed import POSE_LABELS
from aatri.adapters.solution import stacked
from aatri.adjustment.elimination.onto import without
from aatri.arrays import Bool, Int
from aatri.artifacts.information import EliminatedObjects, Information, KeptUnknowns, Normals
from aatri.errors import ArtifactError
from aatri.geometry.rotations import left_jacobian, log_rotation
from aatri.ids import printable
from aatri.observations.poses import POINT, POSE


def added(own: Information, other: Information, stays: Callable[[str, str], bool]) -> Information:
    """The sum of two Informations of one frame, at the unknowns of the first.

    Parameters
    ----------
    own, other : Information
        No observation stands in both.
    stays : callable
        Group and id -> whether an image or point of the first stays; all of the second that it does not have do.

    Raises
    ------
    ArtifactError
        If both have parameters of one object, but not the same.
    """
    other = _shifted(other, other.origin_m - own.origin_m)
    own_keys, theirs = _keys(own.unknowns), _keys(other.unknowns)
    place = {key: k for k, key in enumerate(own_keys)}
    objects = {key[:2] for key in own_keys}
    foreign = np.array([key not in place for key in theirs], dtype=bool)
    for key in (theirs[k] for k in np.flatnonzero(foreign)):
        if key[:2] in objects:
            what = f"{key[2]} of {key[0]} {printable(key[1])} is unknown in block {other.block}, not in {own.block}"
            raise ArtifactError(what, remedy="adjust both with the same set and camera model")
    column = np.empty(len(theirs), dtype=np.int64)
    column[~foreign] = [place[key] for key in theirs if key in place]
    column[foreign] = len(own_keys) + np.arange(int(foreign.sum()))
    d, T = _differences(own, other, column, foreign)
    n, N2 = len(own_keys) + int(foreign.sum()), other.matrix
    N, g = np.zeros((n, n)), np.zeros(n)
    N[: len(own_keys), : len(own_keys)], g[: len(own_keys)] = own.matrix, own.unknowns.right
    N[np.ix_(column, column)] += T.T @ N2 @ T
    g[column] += T.T @ (N2 @ d + other.unknowns.right)
    cost = own.cost + other.cost + float(d @ (N2 @ d) + 2 * d @ other.unknowns.right)
    unknowns: KeptUnknowns = stacked([own.unknowns, other.unknowns.take(np.flatnonzero(foreign))])
    kept = np.array(
        [
            group not in (POSE, POINT) or k >= len(own_keys) or stays(group, name)
            for k, (group, name, _) in enumerate(_keys(unknowns))
        ],
        dtype=bool,
    )
    N, g, fall, rank = without(N, g, np.flatnonzero(kept), np.flatnonzero(~kept))
    eliminated = list(dict.fromkeys(key[:2] for key, stay in zip(_keys(unknowns), kept) if not stay))
    images = stacked([own.images, other.images.take(np.flatnonzero(~np.isin(other.images.image, own.images.image)))])
    left = np.isin(images.image, unknowns.object[kept & (unknowns.group == POSE)])
    more = np.flatnonzero(~np.isin(other.cameras.id, own.cameras.id))
    return replace(
        own,
        cost=cost - fall,
        observations=own.observations + other.observations,
        eliminated=own.eliminated + other.eliminated + rank,
        unknowns=replace(unknowns.take(np.flatnonzero(kept)), right=g),
        images=images.take(np.flatnonzero(left)),
        normals=Normals(value=N[np.tril_indices(len(N))]),
        eliminated_objects=stacked([own.eliminated_objects, other.eliminated_objects, _objects(eliminated)]),
        counted=stacked([own.counted, other.counted]),
        cameras=stacked([own.cameras, other.cameras.take(more)]),
        calibrated_sets=own.calibrated_sets if own.calibrated_sets is not None else other.calibrated_sets,
    )


def _keys(unknowns: KeptUnknowns) -> list[tuple[str, str, str]]:
    return list(zip(unknowns.group.tolist(), unknowns.object.tolist(), unknowns.name.tolist()))


def _objects(eliminated: list[tuple[str, str]]) -> EliminatedObjects:
    names = np.array(eliminated, dtype=np.str_).reshape(-1, 2)
    return EliminatedObjects(group=names[:, 0], object=names[:, 1])


def _shifted(information: Information, by: np.ndarray) -> Information:
    """The same with coordinates reduced by another origin."""
    unknowns, value = information.unknowns, information.unknowns.value.copy()
    for group, names in ((POSE, POSE_LABELS[:3]), (POINT, ("X", "Y", "Z"))):
        for axis, name in enumerate(names):
            value[(unknowns.group == group) & (unknowns.name == name)] += by[axis]
    images = replace(information.images, position_m=information.images.position_m + by)
    return replace(information, unknowns=replace(unknowns, value=value), images=images)


def _differences(own: Information, other: Information, column: Int, foreign: Bool) -> tuple[np.ndarray, np.ndarray]:
    """d, zero where the first does not have the unknown, and T."""
    u, value = other.unknowns, np.append(own.unknowns.value, 0.0)
    d = np.where(foreign, 0.0, value[np.where(foreign, -1, column)] - u.value)
    T, here = np.eye(len(d)), {name: k for k, name in enumerate(own.images.image.tolist())}
    for k, name in enumerate(other.images.image.tolist()):
        turned = np.flatnonzero((u.group == POSE) & (u.object == name) & np.isnan(u.value))
        if name not in here:
            d[turned] = 0.0
        elif len(turned):
            turn = log_rotation(own.images.ground_from_image[here[name]] @ other.images.ground_from_image[k].T)
            axis = np.array([POSE_LABELS.index(label) - 3 for label in u.name[turned].tolist()])
            d[turned] = turn[axis]
            T[np.ix_(turned, turned)] = np.linalg.inv(left_jacobian(turn[None])[0])[np.ix_(axis, axis)]
    return d, T
