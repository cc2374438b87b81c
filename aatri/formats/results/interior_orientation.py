"""Interior orientations of a Solution: absolute values, their covariance, and the convention they are told in."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.camera.models.forward_models import PARAMETERS as FORWARD
from aatri.camera.parameters.brown import interior_orientation
from aatri.camera.parameters.catalogue import is_ideal
from aatri.observations.poses import ADDITIONAL, CAMERA

NAMES = {CAMERA: ("principal_distance", "principal_point.x", "principal_point.y"), ADDITIONAL: ("c", "x0", "y0")}
"""Parameters of camera models, and of sets of additional parameters, that are interior orientation."""

LABELS = ("principal_distance", "principal_point_x", "principal_point_y")


def interior_columns(solution: Solution, block: Block) -> Mapping[str, npt.NDArray[Any]]:
    """c and principal point of each camera, standard deviations, covariances, and what they count from."""
    cameras, covariance = solution.cameras, interior_covariances(solution)
    values = np.column_stack([cameras.principal_distance_mm, cameras.principal_point_mm])
    pairs = ((0, 1), (0, 2), (1, 2))
    return {
        "camera": cameras.id,
        **{f"{name}_mm": values[:, k] for k, name in enumerate(LABELS)},
        **interior_sigmas(solution),
        **{f"covariance_{LABELS[i]}_{LABELS[j]}_mm2": covariance[:, i, j] for i, j in pairs},
        "convention": np.array([convention(block, k) for k in range(len(cameras))], dtype=np.str_),
    }


def interior_sigmas(solution: Solution) -> dict[str, Float]:
    """Standard deviations of c and principal point of each camera, mm, by column; zero where held, NaN not known."""
    sigma = np.sqrt(np.einsum("nii->ni", interior_covariances(solution)))
    return {f"s{name}_mm": sigma[:, k] for k, name in enumerate(LABELS)}


def interior_covariances(solution: Solution) -> Float:
    """Covariances of c, x0, y0 of each camera, (n, 3, 3) mm^2; zero where held, NaN where not adjusted or not known."""
    p, pairs, cameras = solution.parameters, solution.parameter_covariances, solution.cameras.id
    of_cameras = np.full((len(cameras), 3, 3), np.nan)
    place = {
        (str(p.object[row]), name): row
        for names in NAMES.values()
        for name in names
        for row in np.flatnonzero(np.isin(p.group, list(NAMES)) & (p.name == name)).tolist()
    }
    covariances: dict[tuple[int, int], float] = {}
    if pairs is not None:
        covariances = dict(zip(zip(pairs.first.tolist(), pairs.second.tolist()), pairs.covariance.tolist()))
    for k, camera in enumerate(cameras.tolist()):
        for names in NAMES.values():
            for i, j in ((i, j) for i in range(3) for j in range(3)):
                a, b = (place.get((camera, names[axis])) for axis in (i, j))
                if a is None or b is None:
                    continue
                is_fixed = p.sigma[a] == 0 or p.sigma[b] == 0
                missing = p.sigma[a] ** 2 if a == b else 0.0 if is_fixed else np.nan
                of_cameras[k, i, j] = covariances.get((min(a, b), max(a, b)), missing)
    return _of_changed_distance(solution, of_cameras, place)


def _of_changed_distance(solution: Solution, covariance: Float, place: Mapping[tuple[str, str], int]) -> Float:
    """With the derivatives of c, x0, y0 by the parameters of a set, which are linear in the nominal camera."""
    sets = solution.calibrated_sets
    nominal = (
        {}
        if sets is None
        else {
            name: c0
            for name, c0, set_name in zip(sets.object.tolist(), sets.principal_distance_mm.tolist(), sets.set.tolist())
            if not is_ideal(set_name)
        }
    )
    for k, camera in enumerate(solution.cameras.id.tolist()):
        rows = [place.get((camera, name), -1) for name in NAMES[ADDITIONAL]]
        if camera in nominal and min(rows) >= 0:
            D = interior_orientation(nominal[camera], solution.parameters.value[rows])[1]
            covariance[k] = D @ covariance[k] @ D.T
    return covariance


def convention(block: Block, camera: int) -> str:
    """What principal point and distortion of a camera mean, in words."""
    distortion = str(block.cameras.distortion[camera])
    origin = "fiducial centre" if block.cameras.kind[camera] == "film" else "image centre"
    form = "corrections added to measured coordinates"
    if distortion in FORWARD:
        form = "forward model, added to the projection"
    lens = "" if distortion == "none" else f"; distortion {distortion}: {form}"
    return f"principal point from the {origin}, x right, y up{lens}"
