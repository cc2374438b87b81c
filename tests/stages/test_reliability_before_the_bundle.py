"""Redundancy numbers, tests and detectable errors of the adjustments before the bundle: in the tables of any stage."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.model_adjustment.independent_models import IndependentModelsOptions, independent_models
from aatri.stages.strip_adjustment.conformal import ConformalOptions, conformal
from aatri.stages.strip_adjustment.polynomial import PolynomialOptions, polynomial
from tests.stages.chain import Chain, run_chain, simulated


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(
        simulated(
            3,
            preset="rc30",
            flight={"strips": 2, "images_per_strip": 5},
            known={"full": 8},
            ties={"new_points": 300},
            gnss={"observed": False},
        )
    )


def adjusted(chain: Chain, stage: str) -> Solution:
    block, points, on = chain.block, chain.refined, {"reliability": True}
    made: dict[str, Any] = {
        "polynomial": lambda: polynomial(block, points, chain.strips, chain.absolute, options=PolynomialOptions(**on)),
        "conformal": lambda: conformal(block, points, chain.strips, chain.absolute, options=ConformalOptions(**on)),
        "models": lambda: independent_models(
            block, points, chain.models, chain.absolute, options=IndependentModelsOptions(centres={"sigma": 0.05}, **on)
        ),
        "similarity": lambda: similarity(block, chain.strips, points, options=SimilarityOptions(**on)),
        "graph": lambda: graph(block, points, options=GraphOptions(**on), rng=np.random.default_rng(1)),
    }
    return made[stage]()  # type: ignore[no-any-return]


@pytest.mark.parametrize("stage", ["polynomial", "conformal", "models"])
def test_redundancy_numbers_add_up_to_the_redundancy(chain: Chain, stage: str) -> None:
    """Ties of points that one strip or model holds, and that no control knows, have none and are not listed."""
    found = adjusted(chain, stage)
    assert found.tests is not None
    assert len(found.tests) == len(found.residuals)
    r = found.tests.redundancy[found.residuals.active]
    assert np.nansum(r) == pytest.approx(found.redundancy, abs=0.05 + unlisted(found))
    assert (np.nan_to_num(r) > -1e-9).all()


def unlisted(found: Solution) -> float:
    """Redundancy that ties of points with control in a single strip may have."""
    control = set(found.residuals.point[found.residuals.kind == "control"].tolist())
    tied = set(found.residuals.point[np.char.endswith(found.residuals.kind, "_tie")].tolist())
    return 3.0 * len(control - tied)


@pytest.mark.parametrize("stage", ["similarity", "graph"])
def test_control_of_a_component_has_its_tests(chain: Chain, stage: str) -> None:
    found = adjusted(chain, stage)
    assert found.tests is not None
    assert len(found.tests) == len(found.residuals)
    control = (found.residuals.kind == "control") & found.residuals.active
    assert control.sum() == 8
    # one similarity of eight full points: each is controlled by the others
    assert (found.tests.redundancy[control] > 0).all()
    assert np.isfinite(found.tests.test[control]).all()
    assert (np.abs(found.tests.test[control]) < 5.0).all()


def test_without_being_asked_for_there_are_none(chain: Chain) -> None:
    assert chain.absolute.tests is None
    assert chain.strip_block.tests is None


@pytest.mark.parametrize("stage", ["polynomial", "models"])
def test_variance_components_of_what_was_simulated_with_its_standard_deviations_fit(chain: Chain, stage: str) -> None:
    """The deformation is in the weights of the ties: their factor is 1 by its definition, v'Pv = r."""
    found = adjusted(chain, stage).variance_components
    assert found is not None
    factor = dict(zip(found.group.tolist(), found.factor.tolist()))
    assert {"control plan", "control height"} <= set(factor)
    assert factor["strip_tie" if stage == "polynomial" else "model_tie"] == pytest.approx(1.0, abs=0.1)
