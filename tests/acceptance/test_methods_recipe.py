"""The recipe of all methods with all its variants, on a small block: what `--all-variants` prints is whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from tests.acceptance.test_recipes import SMALL

RECIPE = Path(__file__).parents[2] / "docs" / "recipes" / "methods.yaml"
EVALUATED = {"accuracy_strips": "strip_block", "accuracy_models": "model_block", "accuracy": "bundle"}


def table(output: str, stage: str) -> tuple[dict[str, dict[str, str]], set[str]]:
    """Rows of the table of an evaluation, and the runs that are told to be as the first one."""
    lines = output.splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith(f"{stage}: of ") and "RMS in mm" in line)
    rest = lines[at + 1 :]
    rows = rest[: rest.index("")]
    same = {name for line in rows if line.startswith("as ") for name in line.split(": ")[1].split(", ")}
    heads = [part for group in ("check", "check theory", "truth", "theory") for part in (f"{group} XY", f"{group} Z")]
    present = sorted((h for h in heads if f"  {h}  " in f"{lines[at]}  "), key=lambda h: lines[at].index(f"  {h}  "))
    cells = [line.split() for line in rows if not line.startswith("as ")]
    return {c[0]: dict(zip(present, c[1:])) for c in cells}, same


@pytest.mark.slow
def test_every_variant_of_the_recipe_runs_and_stands_beside_the_others(tmp_path: Path) -> None:
    small = [word for setting in SMALL for word in ("--set", f"block.{setting}")]
    run: Any = CliRunner().invoke(app, ["run", "-q", str(RECIPE), "--all-variants", "--into", str(tmp_path), *small])
    assert run.exit_code == 0, run.output
    variants = {folder.name for folder in (tmp_path / "variants").iterdir()}
    assert len(variants) == 21
    truth = {}
    for stage, source in EVALUATED.items():
        assert f"{stage}: of {source}, RMS in mm" in run.output
        rows, same = table(run.output, stage)
        assert rows.keys() | same == variants | {tmp_path.name}
        assert not rows.keys() & same
        truth[stage] = {name: float(row["truth XY"]) for name, row in rows.items()}
    first = {stage: rows[tmp_path.name] for stage, rows in truth.items()}
    assert first["accuracy_strips"] > first["accuracy_models"] > first["accuracy"]
    for stage in EVALUATED:  # shear of the film is no similarity
        assert max(truth[stage], key=lambda name: truth[stage][name]) == "interior_similarity"
    assert "bundle_from_models: bundle.from initial: strip_block -> model_block" in run.output
    assert "strip_adjustment/conformal (degree: 3, narrow: False)" in run.output
    compared = CliRunner().invoke(app, ["compare", str(tmp_path), "--variants"])
    assert compared.exit_code == 0, compared.output
    for stage in EVALUATED:
        assert table(compared.output, stage) == table(run.output, stage)
