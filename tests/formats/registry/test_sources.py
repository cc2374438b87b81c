"""Formats are recognised by content; sources of several formats make a block, with the geoid grid that is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import Reading
from aatri.formats.registry.export import written_format
from aatri.formats.registry.recognised import format_named, recognised
from aatri.formats.registry.sources import read_source
from aatri.progress import SILENT
from tests.formats.lens_projection import misfit_px

EXPECTED = {
    "borea": {"ign_opk", "ign_camera", "ign_app", "ign_mes"},
    "bingo": {"bingo", "bingo_geoin", "metashape"},
    "socet": {"socet_gpf", "socet_ipf"},
    "sfm": {"opensfm", "nvm", "colmap"},
    "pix4d": {"pix4d"},
    "micmac/Ori-MMV1": {"micmac"},
    "opensfm_berlin": {"photos", "opensfm_gcp", "opensfm"},
    "odm": {"odm_gcp"},
}


@pytest.fixture
def samples(shared_data: Path) -> Path:
    folder = shared_data / "interchange"
    if not folder.is_dir():
        pytest.skip(f"real data not present: {folder}")
    return folder


@pytest.mark.parametrize("folder", EXPECTED)
def test_every_sample_is_recognised_by_its_content(samples: Path, folder: str) -> None:
    assert {source.format.name for source in recognised(samples / folder)} == EXPECTED[folder]


def borea(samples: Path, reading: Reading, geoid: Path | None) -> list[BlockParts]:
    folder = samples / "borea"
    parts = [read_source(folder / "23FD1305_alt_test.OPK", reading.model_copy(update={"geoid": geoid}), SILENT)]
    parts += [read_source(folder / "GCP_test.app", Reading(crs="EPSG:2154"), SILENT)]
    return parts + [read_source(folder / name, Reading(), SILENT) for name in ("Camera1.txt", "terrain_test.mes")]


def test_borea_sees_its_control_with_the_grid_of_the_geoid(samples: Path) -> None:
    """Altitudes of the images above RAF20, ellipsoidal heights of the control: within 1.4 px; without, 230 px and more.

    One pixel is what adjusted residuals stay below; these are of the orientations as they were delivered.
    """
    grid = samples / "borea" / "fr_ign_RAF20.tif"
    misfits = {}
    for name, geoid in (("with", grid), ("without", None)):
        block = assembled(borea(samples, Reading(crs="EPSG:2154"), geoid))
        xyz = dict(zip(block.ground_points.point.tolist(), block.ground_points.xyz_m))
        misfits[name] = [
            misfit_px(block, image, block.image_points.xy[rows], [xyz[p] for p in block.image_points.point[rows]])
            for k, image in enumerate(block.images.id.tolist())
            if len(rows := np.flatnonzero(block.image_points.image == k))
        ]
    assert np.concatenate(misfits["with"]).max() < 1.4
    assert np.median(np.concatenate(misfits["with"])) < 0.6
    assert np.concatenate(misfits["without"]).min() > 200


def test_a_missing_grid_is_named(samples: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"fr_ign_RAF\d\d.tif"):
        assembled(borea(samples, Reading(crs="EPSG:2154", vertical="EPSG:5720"), None))
    with pytest.raises(InputError, match=r"no.tif: is no grid of a geoid"):
        borea(samples, Reading(crs="EPSG:2154"), tmp_path / "no.tif")
    with pytest.raises(InputError, match=r"7 places lie outside of the grid fr_ign_RAF20.tif"):
        borea(samples, Reading(crs="EPSG:32650"), samples / "borea" / "fr_ign_RAF20.tif")
    with pytest.raises(InputError, match=r"heights above a geoid, but no coordinate system"):
        borea(samples, Reading(), samples / "borea" / "fr_ign_RAF20.tif")


def test_the_three_files_of_one_scene_agree(samples: Path) -> None:
    """OpenSfM's and COLMAP's are two programs' results of the same photographs: one rotation and scale between them."""
    folder = samples / "sfm"
    names = ("OpenSfM_example_meshed.json", "VisualSFM_example.nvm", "colmap_example_model_txt")
    blocks = [assembled([read_source(folder / name, Reading(), SILENT)]) for name in names]
    images = [[name.rpartition("/")[2] for name in block.images.id.tolist()] for block in blocks]
    assert images[0] == images[1] == images[2]
    shapes = []
    for block in blocks:
        d = np.linalg.norm(block.exterior.position_m[:, None] - block.exterior.position_m, axis=2)
        shapes.append(d / d.max())
    np.testing.assert_allclose(shapes[1], shapes[2], rtol=0, atol=0.05)
    np.testing.assert_allclose(shapes[0], shapes[2], rtol=0, atol=0.05)


def test_what_is_of_no_format_says_what_was_looked_for(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("to be done\n")
    with pytest.raises(InputError, match=r"of no known format \(notes.txt begins with 'to be done'\)") as refused:
        recognised(tmp_path)
    assert "a first line NVM_V3" in refused.value.remedy


def test_lists_are_found_by_the_name_that_people_give_them() -> None:
    assert format_named("opk").name == written_format("opk").name == "table"
