"""The whole chain as plain function calls, for tests that look at every stage."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.block.wucaps import WucapsOptions, wucaps
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer


@dataclass(frozen=True)
class Chain:
    """Results of all stages, and the options of the last."""

    block: Block
    interior: ImagePoints
    refined: ImagePoints
    models: Models
    strips: Strips
    absolute: Solution
    strip_block: Solution
    options: BundleOptions

    @cached_property
    def bundle(self) -> Solution:
        """Made when it is asked for: most tests adjust with options of their own."""
        return bundle(self.block, self.refined, self.strip_block, options=self.options)


def simulated(seed: int = 1, **options: object) -> Block:
    """A simulated block."""
    return simulate(options=SimulateOptions(**options), rng=np.random.default_rng(seed))  # type: ignore[arg-type]


def run_chain(block: Block, bundle_options: BundleOptions = BundleOptions(), *, refraction: bool = True) -> Chain:  # noqa: B008
    """All stages on a block of film or digital images with all corrections, refraction where the block has it."""
    interior = affine(block) if (block.cameras.kind == "film").any() else calibrated(block)
    refined = systematic(block, interior, options=SystematicOptions(refraction=refraction))
    return from_refined(block, interior, refined, bundle_options)


def run_rc30_2x3(shared_data: Path) -> Chain:
    """All stages on the real block of six photographs, refraction and curvature off."""
    folder = shared_data / "rc30_2x3" / "Data" / "bundle_ajustment"
    block = wucaps(options=WucapsOptions(path=folder))
    interior = calibrated(block)
    refined = systematic(block, interior, options=SystematicOptions(refraction=False, earth_curvature=False))
    return from_refined(block, interior, refined, BundleOptions())


def from_refined(block: Block, interior: ImagePoints, refined: ImagePoints, options: BundleOptions) -> Chain:
    models = dependent(block, refined)
    strips = scale_transfer(block, models)
    absolute = similarity(block, strips, refined)
    strip_block = polynomial(block, refined, strips, absolute)
    return Chain(block, interior, refined, models, strips, absolute, strip_block, options)
