"""The recipes of docs/recipes run, here on a small block; the compensations do what they are for.

`methods` runs with all its variants: test_methods_recipe.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app

RECIPES = sorted((Path(__file__).parents[2] / "docs" / "recipes").glob("*.yaml"))
SMALL = (
    "flight.strips=3",
    "flight.images_per_strip=5",
    "flight.cross_strips=1",
    "ties.new_points=120",
    "known.full=12",
    "known.check_full=6",
)

AS_THEY_ARE = ("close_range", "network")
"""Small already: the block of one has no control; of the other 54 points are surveyed, not 132 by as many distances."""


@pytest.mark.slow
@pytest.mark.parametrize("recipe", [r for r in RECIPES if r.stem != "methods"], ids=lambda path: path.stem)
def test_a_recipe_runs(recipe: Path, tmp_path: Path) -> None:
    settings = () if recipe.stem in AS_THEY_ARE else SMALL
    small = [word for setting in settings for word in ("--set", f"block.{setting}")]
    result = CliRunner().invoke(app, ["run", str(recipe), "--into", str(tmp_path), "--json", *small])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("recipe", "variant"), [("gnss_imu", "calibrated"), ("gnss_imu", "fixed"), ("crossed_flights", "known")]
)
def test_a_variant_of_a_recipe_runs(recipe: str, variant: str, tmp_path: Path) -> None:
    """Those whose patch names one option within others: what stands beside it must stay."""
    path = next(p for p in RECIPES if p.stem == recipe)
    small = [w for s in SMALL for w in ("--set", f"block.{s}")] if recipe not in AS_THEY_ARE else []
    result = CliRunner().invoke(app, ["run", str(path), "--into", str(tmp_path), "--variant", variant, *small])
    assert result.exit_code == 0, result.output
    warned = "boresight is fixed" in result.output or "common offset" in result.output
    assert warned == (variant == "fixed"), result.output
