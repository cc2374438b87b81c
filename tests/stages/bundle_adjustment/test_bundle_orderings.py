"""An aerial block adjusted in every order of elimination, and what the bundle says of the textbook's band."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.solution import Orderings, Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

STRIPS, IMAGES = 5, 22


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(
        simulated(
            preset="rc30",
            flight={"strips": STRIPS, "images_per_strip": IMAGES, "cross_strips": 0},
            ties={"per_position": 2},
            known={"full": 25},
        ),
    )


def _adjusted(chain: Chain, ordering: str, told: Told | None = None) -> Solution:
    options = BundleOptions(ordering=ordering, tolerance=1e-6, interior_unknowns=True, self_calibration="ebner12")
    return bundle(chain.block, chain.refined, chain.strip_block, options=options, context=told or Told())


@pytest.mark.slow
def test_every_order_gives_the_same_solution_and_covariances(chain: Chain) -> None:
    reference = _adjusted(chain, "nested_dissection")
    sigma = np.sqrt(np.einsum("nii->ni", reference.points.covariance_m2))
    for ordering in ("minimum_degree", "across_strips", "along_strips"):
        found = _adjusted(chain, ordering)
        assert np.nanmax(np.abs(found.points.xyz_m - reference.points.xyz_m) / sigma) < 1e-6
        np.testing.assert_allclose(found.images.covariance, reference.images.covariance, rtol=1e-5, atol=1e-14)
        np.testing.assert_allclose(found.parameters.sigma, reference.parameters.sigma, rtol=1e-7)
        assert found.orderings is not None
        most = {"across_strips": 12 + STRIPS, "along_strips": 25 + 2}.get(ordering, np.inf)  # of the one in use
        assert found.orderings.images[found.orderings.used].item() <= most


@pytest.mark.slow
def test_the_band_of_the_textbook_stands_beside_the_one_found(chain: Chain) -> None:
    told = Told()
    orderings = _adjusted(chain, "across_strips", told).orderings
    assert isinstance(orderings, Orderings)
    row = {str(name): k for k, name in enumerate(orderings.ordering)}
    across, along = row["across_strips"], row["along_strips"]
    assert orderings.used.tolist() == [name == "across_strips" for name in orderings.ordering]
    # N = 5 strips of n = 22 images: 2N + 2 and n + 3
    assert (orderings.textbook_images[across], orderings.textbook_images[along]) == (12, 25)
    # strips begin and end where they like, and points of a camera's corner reach one image further
    assert 12 <= orderings.images[across] <= 12 + STRIPS
    assert 25 <= orderings.images[along] <= 25 + 2
    assert orderings.unknowns[across] == 12 * orderings.images[across]  # poses with six film corrections each
    assert (orderings.border == 15).all()  # ebner12 with c, x0, y0: the bordered band
    assert orderings.gflop[across] < orderings.gflop[along]
    assert any("the textbook numbers across the strips, n 22, 2N - 1 9" in line for line in told.lines)
    assert any("half bandwidth" in line and "(textbook 12)" in line for line in told.lines)
