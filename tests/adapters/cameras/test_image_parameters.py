"""Film corrections are unknowns of images with measured fiducials only."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adapters.cameras.image_parameters import film_parameters
from aatri.pipeline.methods.registry import find_stages
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.affine import affine
from aatri.tables.digest import content_digest
from tests.stages.chain import run_chain, simulated

THREE_IMAGES = {"strips": 1, "images_per_strip": 3, "cross_strips": 0}


def test_pixel_cameras_carry_no_film_unknowns() -> None:
    made = run_chain(
        simulated(preset="uav", flight={"strips": 2, "images_per_strip": 4}, ties={"random_per_image": 60.0})
    )
    assert film_parameters(made.block, made.refined) is None
    asked = bundle(made.block, made.refined, made.strip_block, options=BundleOptions(interior_unknowns=True))
    assert content_digest(asked) == content_digest(made.bundle)


def test_film_with_measured_fiducials_carries_six_an_image() -> None:
    block = simulated(preset="rc30", flight=THREE_IMAGES, ties={"new_points": 60})
    rows = film_parameters(block, affine(block))
    assert rows is not None
    assert rows.free.shape == (3, 6)
    assert rows.free.all()


@pytest.mark.parametrize(("model", "open_"), [("similarity", 4), ("affine", 6), ("bilinear", 8), ("projective", 8)])
def test_as_many_are_weighted_as_the_transformation_leaves_open(model: str, open_: int) -> None:
    block = simulated(preset="rc30", flight=THREE_IMAGES, ties={"new_points": 60}, camera={"fiducials": 8})
    rows = film_parameters(block, find_stages().card(f"interior_orientation/{model}").function(block))
    assert rows is not None
    assert rows.free.shape == (3, open_)
    assert rows.free.all()
    assert rows.weighted.all()
    assert rows.basis is not None
    # a correction of one standard deviation moves no point of the format by more than some micrometres
    sigma = np.sqrt(np.einsum("nii->ni", rows.covariance))
    assert np.abs(rows.basis * sigma[rows.block][:, None]).max() < 0.02
