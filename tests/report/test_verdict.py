"""The lights of the verdict strip."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from aatri.report.verdict import internal_lights


@pytest.mark.parametrize(
    ("figures", "state"),
    [
        ({"redundancy": 30}, "good"),
        ({"redundancy": 300}, "look"),
        ({"redundancy": 300, "sigma0_redundancy": 29.6}, "good"),
        ({"redundancy": 30, "sigma0_redundancy": 300.2}, "look"),
    ],
)
def test_sigma0_is_tested_with_the_redundancy_that_it_counts(figures: dict[str, float], state: str) -> None:
    """95 % limits: 0.748 to 1.252 for a redundancy of 30, 0.920 to 1.080 for 300 (tables of chi-square)."""
    stage = SimpleNamespace(name="bundle", metrics={"sigma0": 1.20, **figures}, status="done")
    run = SimpleNamespace(stages=[stage], of_kind=lambda kind: [stage])
    (light,) = [x for x in internal_lights(run, None) if x.title == "sigma0"]  # type: ignore[arg-type]
    assert light.state == state
    assert f"redundancy {round(figures.get('sigma0_redundancy', figures['redundancy']))}," in light.words
