"""Parameters of camera models that another block has determined, as weighted unknowns of this one.

    v = p - p_calibration,    covariance that of the calibration, of all parameters of a camera together

What the calibration has held is held here, at its values. The adjustment has principal points from the nominal ones;
the nominal points of the two blocks may differ.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.bundle.camera_parameters import PRINCIPAL_POINT, nominal_point_mm
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.camera.models import calibration
from aatri.errors import InputError
from aatri.ids import shown
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import CAMERA


def has_camera_models(solution: Solution) -> bool:
    """Whether a finished adjustment has estimated parameters of camera models."""
    p = solution.parameters
    return bool(((p.group == CAMERA) & (p.sigma != 0)).any())


def calibrated_cameras(block: Block, rows: ParameterRows, solution: Solution) -> ParameterRows:
    """Unknowns of camera models, weighted by a calibration: its values, its whole covariance.

    Parameters
    ----------
    block : Block
    rows : ParameterRows
        Of the cameras as the block has them.
    solution : Solution
        The calibration.

    Raises
    ------
    InputError
        If a camera is not in the calibration, has another model there, or the calibration has no covariances.
    """
    p, covariances = solution.parameters, solution.parameter_covariances
    mine = p.group == CAMERA
    missing = [name for name in rows.ids if not (mine & (p.object == name)).any()]
    if missing:
        known = shown(np.unique(p.object[mine]))
        raise InputError(f"the calibration does not have {shown(missing)}", where=f"block {block.name}",
                         remedy=f"it has {known}; ids of cameras must agree in both blocks")  # fmt: skip
    start, C = np.zeros_like(rows.start), np.zeros_like(rows.covariance)
    for k, (name, model) in enumerate(zip(rows.ids, rows.model)):
        at = np.flatnonzero(mine & (p.object == name))
        names = calibration.PARAMETERS[model]
        if tuple(p.name[at].tolist()) != names:
            raise InputError(
                f"camera {name} has the parameters {', '.join(names)}, in the calibration {', '.join(p.name[at])}",
                where=f"block {block.name}", remedy="give the camera the distortion model of its calibration",
            )  # fmt: skip
        start[k, : len(at)] = p.value[at] - _nominal(block, str(name), names)
        if covariances is not None:
            C[k, : len(at), : len(at)] = _among(at, covariances.first, covariances.second, covariances.covariance)
        if not np.allclose(np.diag(C[k])[: len(at)], p.sigma[at] ** 2, rtol=1e-6, atol=0.0):
            raise InputError("the solution given as calibration has no standard deviations",
                             remedy="adjust the test field with `standard_deviations: true`")  # fmt: skip
    free = np.einsum("nii->ni", C) > 0
    return replace(rows, start=start, prior=start, covariance=C, free=free, weighted=free, calibrated=True)


def _among(at: np.ndarray, first: np.ndarray, second: np.ndarray, covariance: Float) -> Float:
    """Covariance matrix of some rows of the parameters; zero where nothing is told."""
    place = {int(row): k for k, row in enumerate(at)}
    C = np.zeros((len(at), len(at)))
    for k in np.flatnonzero(np.isin(first, at) & np.isin(second, at)):
        i, j = place[int(first[k])], place[int(second[k])]
        C[i, j] = C[j, i] = covariance[k]
    return C


def _nominal(block: Block, camera: str, names: tuple[str, ...]) -> Float:
    """The nominal principal point at its places among the parameters, zero elsewhere."""
    point = dict(zip(PRINCIPAL_POINT, nominal_point_mm(block.cameras, camera).tolist()))
    return np.array([point.get(name, 0.0) for name in names])
