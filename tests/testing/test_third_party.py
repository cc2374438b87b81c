"""The third-party stage of the documentation, as an author and as a user meet it; nothing is installed."""

from __future__ import annotations

import shutil
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.errors import GeometryError, InputError
from aatri.pipeline.methods.registry import find_stages
from aatri.pipeline.spec.pipeline_file import load_spec
from aatri.tables.digest import content_digest
from aatri.testing.check import check_stage
from aatri.testing.example_inputs import example_block

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLE = DOCS / "examples" / "third_party"
NAME = "interior_orientation/helmert"


def helmert(block: Block) -> ImagePoints:
    made = find_stages(EXAMPLE / "stages").card(NAME).function(block)
    assert isinstance(made, ImagePoints)
    return made


def test_it_keeps_its_contract() -> None:
    report = check_stage(NAME, local=EXAMPLE / "stages")
    assert {"runs", "truth", "order", "rows"} <= {check.name for check in report.checks}


def test_its_pipeline_finds_it_with_local_plugins() -> None:
    spec = load_spec(EXAMPLE / "pipeline.yaml")
    registry = find_stages(spec.base / "stages")
    assert [registry.card(stage.use).name for stage in spec.stages.values()] == ["block/simulate", NAME]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """As after `pip install`: the files as pyproject.toml packs them, and its entry point. Gives the digest before."""
    before = content_digest(helmert(example_block()))
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())
    for source, target in project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"].items():
        shutil.copytree(EXAMPLE / source, tmp_path / target, ignore=shutil.ignore_patterns("__pycache__"))
    group = project["project"]["entry-points"]["aatri.stages"]
    points = EntryPoints(EntryPoint(name, value, "aatri.stages") for name, value in group.items())
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: points)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield before
    for module in [name for name in sys.modules if name.startswith("aatri_helmert")]:
        del sys.modules[module]


def test_installed_it_is_found_by_its_entry_point_and_gives_the_same(installed: str, tmp_path: Path) -> None:
    registry = find_stages()
    assert registry.origins[NAME].source == "installed"
    assert registry.origins[NAME].file == tmp_path / "aatri_helmert" / "helmert.py"
    made = registry.card(NAME).function(example_block())
    assert content_digest(made) == installed
    check_stage(NAME)


def test_its_coordinates_and_covariance_are_those_of_least_squares_image_by_image() -> None:
    block = example_block()
    made = helmert(block)
    marks = block.fiducial_points
    for image in (0, 7):
        rows = np.flatnonzero(marks.image == image)
        (u, v), (x, y) = marks.xy[rows].T, block.fiducials.xy_mm[marks.fiducial[rows]].T
        one, zero = np.ones(len(rows)), np.zeros(len(rows))
        sigma = marks.sigma_mm[rows].mean()
        design = np.vstack([np.column_stack([u, -v, one, zero]), np.column_stack([v, u, zero, one])])
        (a, b, s, t), squares, *_ = np.linalg.lstsq(design, np.concatenate([x, y]))
        np.testing.assert_allclose(made.interior.matrix[image], [[a, -b, s], [b, a, t]], rtol=0, atol=1e-11)
        freedom = 2 * len(rows) - 4
        assert made.interior.sigma0[image] == pytest.approx(np.sqrt(squares[0] / freedom) / sigma)
        turned = np.vstack([np.column_stack([x, -y, one, zero]), np.column_stack([y, x, zero, one])])
        cofactor = sigma**2 * np.linalg.inv(turned.T @ turned)  # of a, b, s, t
        by_abst = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
        expected = by_abst @ cofactor @ by_abst.T
        np.testing.assert_allclose(made.interior.covariance[image, :4, :4], expected, rtol=1e-9, atol=1e-20)
        assert not made.interior.covariance[image, 4:].any()


def test_it_refuses_what_it_cannot_take() -> None:
    with pytest.raises(InputError, match="not measured on a comparator"):
        helmert(example_block("digital"))
    block = example_block()
    single = (block.fiducial_points.image != 3) | (np.cumsum(block.fiducial_points.image == 3) == 1)
    with pytest.raises(GeometryError, match=f"in image {block.images.id[3]}"):
        helmert(replace(block, fiducial_points=block.fiducial_points.take(single)))


def test_the_documentation_shows_the_files_as_they_are() -> None:
    text = (DOCS / "plugins.md").read_text(encoding="utf-8")
    for file in ("stages/interior_orientation/helmert.py", "pyproject.toml", "tests/test_helmert.py"):
        assert (EXAMPLE / file).read_text(encoding="utf-8").strip() in text, file
