"""The diffs of docs/architecture.md, on how to add something, apply to this tree and do what they say."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.camera.parameters.parameter_set import correction, scale_of_format
from aatri.errors import InputError
from aatri.formats.parts.format import AS_USUAL
from aatri.formats.registry.catalogue import FORMATS
from aatri.formats.registry.export import write_as
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.observations.kinds import catalogue as kinds
from aatri.progress import SILENT
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.testing.check import check_stage
from tests.made_solutions import made_block, made_solution

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def _diffs(title: str) -> dict[str, str]:
    """Texts of the files that the diff under a heading makes or changes, applied to those of the tree."""
    section = PAGE[PAGE.index(f"### {title}") :]
    diff = section[section.index("```diff\n") + 8 :]
    diff = diff[: diff.index("\n```")]
    found = {}
    for part in re.split(r"^--- .*\n", diff, flags=re.M)[1:]:
        name, body = part.split("\n", 1)
        path = name.removeprefix("+++ b/")
        text = (ROOT / path).read_text(encoding="utf-8") if (ROOT / path).exists() else ""
        for hunk in re.split(r"^@@ .*\n", body, flags=re.M)[1:]:
            lines = hunk.rstrip("\n").split("\n")
            old = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("+"))
            new = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("-"))
            assert (text.count(old) == 1) if old else (text == ""), f"the diff no longer applies to {path}:\n{old}"
            text = text.replace(old, new) if old else new
        found[path] = text
    return found


def _module(path: str, text: str, folder: Path, monkeypatch: pytest.MonkeyPatch, name: str = "") -> ModuleType:
    """A text as the module that it would be, or under another name."""
    file = folder / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    name = name or path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


LEVELLED = {"AB": 1.503, "BC": -0.702, "AC": 0.806}
NETWORK = """aatri_block: 1
name: levelling
terrain_height: 10.0
frames: {local: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
"""


def _levelling(folder: Path) -> Block:
    """A, B and C levelled in a loop that misses by 5 mm; no height is given."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "block.yaml").write_text(NETWORK)
    (folder / "ground_points.csv").write_text(
        "point,X,Y,Z,role\nA,,,10,approximate\nB,,,11,approximate\nC,,,9,approximate\n"
    )
    rows = [f"height_difference,{line[0]},{line[1]},{value},0.001" for line, value in LEVELLED.items()]
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    return tables(options=TablesOptions(path=folder))


def test_the_observation_is_one_file_and_one_line_and_is_adjusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = _diffs("An observation")
    new = [path for path in files if not (ROOT / path).exists()]
    assert len(new) == 1
    listed = "aatri/observations/kinds/catalogue.py"
    assert set(files) == {*new, listed}
    _module(new[0], files[new[0]], tmp_path, monkeypatch)
    patched = _module(listed, files[listed], tmp_path, monkeypatch, "kinds_of_docs")
    assert len(patched.KINDS) == len(kinds.KINDS) + 1
    monkeypatch.setattr(kinds, "KINDS", patched.KINDS)
    solution = bundle(_levelling(tmp_path / "block"), options=BundleOptions(tolerance=1e-8))
    heights = dict(zip(solution.points.id.tolist(), solution.points.xyz_m[:, 2].tolist()))
    misclosure = LEVELLED["AB"] + LEVELLED["BC"] - LEVELLED["AC"]
    assert heights["B"] - heights["A"] == pytest.approx(LEVELLED["AB"] - misclosure / 3, abs=1e-6)
    assert heights["C"] - heights["A"] == pytest.approx(LEVELLED["AC"] + misclosure / 3, abs=1e-6)
    assert sum(heights.values()) / 3 == pytest.approx(10.0, abs=1e-6)


def test_the_parameter_set_is_one_file_and_one_line_and_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is an option at once, and gives back a scanner that stretches x by 2e-4 and shears it by 1e-4."""
    files = _diffs("A parameter set")
    catalogue = "aatri/camera/parameters/catalogue.py"
    (new,) = (path for path in files if path != catalogue)
    _module(new, files[new], tmp_path, monkeypatch)
    _module(catalogue, files[catalogue], tmp_path, monkeypatch)
    stage = "stages/bundle_adjustment/_self_calibration.py"
    patched = _module(stage, (ROOT / stage).read_text(encoding="utf-8"), tmp_path, monkeypatch, "calibration_of_docs")
    wanted = patched.SelfCalibration(set="scanner", sigma_um=None)
    block = made_block(columns=5)
    parameters = patched.chosen_set(block, wanted, False).parts[0].parameters
    scale = scale_of_format((115.0, 115.0), 150.0)
    xy_mm = np.array([[100.0, 50.0], [-20.0, 80.0]])
    true, dx_mm = np.array([2e-4, 1e-4]), xy_mm @ [2e-4, 1e-4]
    values_mm = np.linalg.lstsq(parameters.basis(xy_mm, scale)[:, 0], dx_mm, rcond=None)[0]
    assert parameters.classical_factors(scale) * values_mm == pytest.approx(true)
    assert correction(parameters, scale, values_mm, xy_mm) == pytest.approx(np.stack([dx_mm, 0 * dx_mm], axis=1))


@pytest.mark.slow
def test_the_variant_keeps_its_contract(tmp_path: Path) -> None:
    ((path, text),) = _diffs("A variant of a role").items()
    file = tmp_path / path
    file.parent.mkdir(parents=True)
    file.write_text(text, encoding="utf-8")
    _, role, name = Path(path).with_suffix("").parts
    check_stage(f"{role}/{name}", local=tmp_path / "stages")


BINGO = """\
P1 lens
A 1.5 2.5
B -1 0.25
C 4 5
-99

P2 lens
A -3.5 2.4
B -6 0.2
C -1 5.1
"""


def test_the_format_is_one_file_of_60_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ((path, text),) = _diffs("A format").items()
    assert text.count("\n") <= 60
    module = _module(path, text, tmp_path, monkeypatch)
    (tmp_path / "images.txt").write_text(BINGO)
    (tmp_path / "control.txt").write_text("A 100 200 30\nB 110 200 31\n")
    options = {"principal_distance": 153.0, "control": tmp_path / "control.txt", "control_sigma": 0.02}
    block = module.bingo(options=module.BingoOptions(path=tmp_path / "images.txt", **options))
    measured = block.image_points
    assert block.images.id[measured.image].tolist() == ["P1", "P1", "P1", "P2", "P2", "P2"]
    assert block.points.id[measured.point].tolist() == ["A", "B", "C", "A", "B", "C"]
    assert measured.xy[3].tolist() == [-3.5, 2.4]
    assert measured.line.tolist() == [2, 3, 4, 8, 9, 10]
    assert block.ground_points.xyz_m.tolist() == [[100.0, 200.0, 30.0], [110.0, 200.0, 31.0]]
    assert np.diagonal(block.ground_points.covariance_m2, axis1=1, axis2=2) == pytest.approx(0.02**2)
    for wrong, message in (("B -1 0,25", "images.txt:3"), ("B -1 0.25 7", "images.txt:3: 4 words")):
        (tmp_path / "images.txt").write_text(BINGO.replace("B -1 0.25", wrong))
        with pytest.raises(InputError, match=message):
            module.bingo(options=module.BingoOptions(path=tmp_path / "images.txt", **options))


def test_the_export_writes_the_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = _diffs("An export")
    contracts = files.pop("pyproject.toml")
    rooms = {Path(path).parent.name for path in files if path.startswith("aatri/formats/")}
    assert all(re.search(rf"^layers = \[.*\b{room}\b", contracts, re.M) for room in rooms)
    for path in (path for path in files if path.startswith("aatri/formats/")):
        _module(path, files[path], tmp_path, monkeypatch)
    listed = "aatri/formats/registry/catalogue.py"
    patched = _module(listed, files[listed], tmp_path, monkeypatch, "catalogue_of_docs")
    (ply,) = set(patched.FORMATS) - set(FORMATS)
    block = made_block()
    solution = made_solution(block)
    write_as(ply, OrientedBlock(block, solution), tmp_path / "out", AS_USUAL, SILENT)
    head, _, rows = (tmp_path / "out" / "points.ply").read_text().partition("end_header\n")
    xyz_m = np.array([[float(word) for word in row.split()] for row in rows.splitlines()])
    assert f"element vertex {len(xyz_m)}\n" in head
    np.testing.assert_array_equal(xyz_m, solution.points.xyz_m[np.isfinite(solution.points.xyz_m).all(axis=1)])


def test_the_section_has_its_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = _diffs("A section of the report")
    *new, changed = sorted(files, key=lambda path: (ROOT / path).exists())
    for path in new:
        _module(path, files[path], tmp_path, monkeypatch)
    patched = _module(changed, files[changed], tmp_path, monkeypatch, "section_of_docs")
    (strips,) = (t for t in patched.camera_tables(made_block(columns=5)) if t.caption.startswith("Strips"))
    assert [tuple(row) for row in strips.rows] == [("1", "5"), ("2", "5")]
