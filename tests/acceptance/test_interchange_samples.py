"""Files that people hold, by the command line: every sample folder ends in a run, or in what is missing by name.

What each sample proves of a convention stands beside its reader: MicMac's ten pairs and both versions
(tests/formats/micmac), Pix4D's matrices (pix4d), SOCET's tables (socet), the grid of the geoid (registry).
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tests.acceptance.small_block import aatri

MISSING = {
    "bingo": r"image point B1_1.JPG/31 measured twice, 1.28777 mm apart",
    "borea": r"terrain_test0.mes:2: 7 of its image points have other coordinates in",
    "micmac": r"no image in common: GroundMeasure.xml, Ori-Ground_mm3d (4 images); Ori-MMV1 (7 images)",
    "micmac/Ori-MMV1": r"7 images, but no image points",
    "odm": r"no source says which camera took 4 images",
    "opensfm_berlin/ground_control_points.json": r"no source says which camera took 3 images",
    "opf/examples": r"'point_cloud/sparse.gltf' does not exist",
    "pix4d": r"168 images, but no image points",
    "socet": r"radians, and no line of the file names the ellipsoid",
}
"""What each folder lacks, or holds twice, as a message says it."""

BOREA = """\
run: run
stages:
  block:
    use: block/combined
    with:
      sources:
        - {{path: "{0}/23FD1305_alt_test.OPK", crs: "EPSG:2154", {1}use: observed}}
        - "{0}/Camera1.txt"
        - {{path: "{0}/GCP_test.app", crs: "EPSG:2154"}}
        - "{0}/liaisons_test.mes"
        - "{0}/terrain_test.mes"
      control_sigma: [0.05, 0.05, 0.05]
      position_sigma: [0.05, 0.05, 0.05]
      attitude_sigma_deg: 0.001
      image_sigma_px: 0.5
  interior: {{use: interior_orientation/calibrated, from: {{block}}}}
  bundle:   {{use: bundle_adjustment/bundle, from: {{block, image_points: interior}}}}
"""
PIXEL_MM = 0.001


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", MISSING)
def test_a_sample_folder_is_refused_by_new_with_what_is_missing(
    interchange: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = aatri("new", "mine", "--from", interchange / name)
    assert result.exit_code == 3, "what a run would refuse, too"
    assert MISSING[name] in result.stderr
    assert "fix: " in result.stderr


def test_photographs_beside_marks_get_their_tie_points_from_the_pixels(
    interchange: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MicMac's marks and control alone orient nothing; its photographs do."""
    pytest.importorskip("PIL")
    monkeypatch.chdir(tmp_path)
    folder, photographs = interchange / "micmac" / "Saisies-MMV1", tmp_path / "photographs"
    photographs.mkdir()
    for path in folder.glob("*.JPG"):
        (photographs / path.name).symlink_to(path)
    lists = [word for name in ("GroundMeasure.xml", "Ground-Pts3D.xml") for word in ("--from", folder / name)]
    result = aatri("new", "mine", "--from", photographs, *lists)
    assert result.exit_code == 0, result.stderr
    text = (tmp_path / "mine" / "pipeline.yaml").read_text()
    assert "{use: tie_points/sift, from: {block: photos}}" in text
    assert "format: photos" in text
    assert "9 control points" in result.stderr


@pytest.mark.slow
def test_a_model_of_visualsfm_runs_and_says_that_its_principal_points_were_never_estimated(
    interchange: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """NVM has the principal point in the middle of the image: what the rays of every eighth point contradict."""
    monkeypatch.chdir(tmp_path)
    lines = (interchange / "sfm" / "VisualSFM_example.nvm").read_text().splitlines()
    at = lines.index("7817")
    some = lines[at + 1 : at + 7818 : 8]
    Path("model.nvm").write_text("\n".join([*lines[:at], f"{len(some)}", *some, *lines[at + 7818 :], ""]))
    assert aatri("new", "mine", "--from", "model.nvm").exit_code == 0
    result = aatri("run", "mine/pipeline.yaml", "-q")
    assert result.exit_code == 6
    assert "the results are written" in result.stderr
    assert "ask for a principal point" in result.stderr
    assert "estimate it (`self_calibration`)" in result.stderr


@pytest.mark.slow
def test_borea_adjusts_with_the_grid_of_the_geoid(interchange: Path, tmp_path: Path) -> None:
    """Altitudes above RAF20 and ellipsoidal control in one block: residuals below 1 px."""
    folder = interchange / "borea"
    (tmp_path / "pipeline.yaml").write_text(BOREA.format(folder, f"geoid: '{folder}/fr_ign_RAF20.tif', "))
    result = aatri("run", tmp_path / "pipeline.yaml", "-q")
    assert result.exit_code == 0, result.stderr
    assert aatri("export", f"{tmp_path}/run", "tables", tmp_path / "out").exit_code == 0
    with (tmp_path / "out" / "residuals.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] == "image_point"]
    assert len(rows) == 24
    assert {(row["unit"], row["active"]) for row in rows} == {("mm", "yes")}
    assert max(abs(float(row[v])) for row in rows for v in ("vx", "vy")) < 1.0 * PIXEL_MM


def test_borea_without_the_grid_names_it(interchange: Path, tmp_path: Path) -> None:
    """EPSG:5720 are altitudes of France: PROJ knows by which grid they become ellipsoidal, and does not have it."""
    (tmp_path / "pipeline.yaml").write_text(BOREA.format(interchange / "borea", 'vertical: "EPSG:5720", '))
    result = aatri("run", tmp_path / "pipeline.yaml", "-q")
    assert result.exit_code != 0
    assert "fr_ign_RAF" in result.stderr
    assert ".tif" in result.stderr
