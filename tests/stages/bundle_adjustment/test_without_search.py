"""`blunders: none`: nothing is left out, and what stands out is named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from aatri.errors import ConvergenceError
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

FLIGHT = {"strips": 2, "images_per_strip": 5, "cross_strips": 0}


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(simulated(2, preset="rc30", flight=FLIGHT, known={"full": 8}, ties={"new_points": 100}))


@pytest.mark.parametrize("sigmas", [0.0, pytest.param(20.0, marks=pytest.mark.slow)])
def test_the_largest_misfits_are_named_where_they_stand_out(chain: Chain, sigmas: float) -> None:
    m, told = chain.refined.measurements, Told()
    xy, row = m.xy_mm.copy(), len(m) // 2
    xy[row] += sigmas * 0.005
    wrong = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    bundle(chain.block, wrong, chain.absolute, options=BundleOptions(blunders="none"), context=told)  # type: ignore[arg-type]
    texts = [text for text in told.warnings if "largest tests: " in text]
    assert len(texts) == (sigmas > 0)
    name = f"image_point {chain.block.images.id[m.image[row]]}/{chain.block.points.id[m.point[row]]}"
    assert all(name in text for text in texts)


def test_a_failure_names_the_search(chain: Chain) -> None:
    options = BundleOptions(blunders="none", max_iterations=1)  # type: ignore[arg-type]
    with pytest.raises(ConvergenceError) as failure:
        bundle(chain.block, chain.refined, None, options=options)
    assert failure.value.remedy.startswith("`blunders: none` looks for no gross errors")
