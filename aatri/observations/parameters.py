"""Unknown parameters of images or cameras beside the poses, and what is known of them beforehand.

Film corrections, sets of additional parameters, parameters of camera models: each is a group of unknowns that image
points touch. A weighted parameter is an observation of its own, v = p - p_prior, with the covariance of the group.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from aatri.adjustment.unknowns import Ids, Unknowns, add_step
from aatri.arrays import Bool, Float, Int
from aatri.camera.models.distortion import MODELS
from aatri.observations.poses import POSE


def uses_of_vector(name: str) -> tuple[str, ...]:
    """Names of the components of a vector of cameras (lever_arm, boresight) among what a block offers."""
    return tuple(f"camera_parameters:{model}.{name}.{axis}" for model in MODELS for axis in "xyz")


@dataclass(frozen=True)
class ParameterRows:
    """A group of unknown parameters of images or cameras, beside the poses."""

    group: str
    """FILM, ADDITIONAL or CAMERA."""
    ids: Ids
    """(n,) str. Names of the blocks."""
    labels: tuple[str, ...]
    """Names of the s parameters of a block."""
    start: Float
    """(n, s)."""
    free: Bool
    """(n, s)."""
    prior: Float
    """(n, s). Observed values of the weighted parameters."""
    covariance: Float
    """(n, s, s). Their covariance."""
    weighted: Bool
    """(n, s)."""
    block: Int
    """(n_rays,). Block of each ray."""
    basis: Float | None = None
    """(n_rays, 2, s). Correction of the measured coordinate per parameter; None where `model` tells the equations."""
    model: tuple[str, ...] = ()
    """Camera model of each block, for CAMERA."""
    per_image: bool = False
    """The blocks are those of the images, one by one."""
    calibrated: bool = False
    """What weights them is the result of another block."""
    terms: Callable[[Float], Float] | None = None
    """The basis at any coordinates, (n_rays, 2) mm; None where it is what it is."""
    ideal: bool = False
    """Its coordinates are those that the parameters have corrected."""
    formed_by: Float | None = None
    """(n, s). Values of the adjustment at whose coordinates the basis is; None: at the measured ones."""

    def take(self, rays: Int | Bool) -> ParameterRows:
        """With the chosen rays only."""
        basis = None if self.basis is None else self.basis[rays]
        return replace(self, block=self.block[rays], basis=basis, terms=None)


def parameter_unknowns(rows: ParameterRows) -> Unknowns:
    """The group of unknowns; parameters of single images stand and fall with them."""
    return Unknowns(rows.group, rows.free, rows.labels, rows.ids, add_step, joins=POSE if rows.per_image else "")
