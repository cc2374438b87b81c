"""Formats are recognised by content; sources of several formats make a block, with the geoid grid that is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError, InputError
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import Reading
from aatri.formats.registry.export import written_format
from aatri.formats.registry.recognised import format_named, recognised
from aatri.formats.registry.settings import settings_of
from aatri.formats.registry.sources import read_all, read_source
from aatri.progress import SILENT
from tests.formats.lens_projection import misfit_px
from tests.formats.opensfm.made_project import write_project
from tests.formats.told import Told

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


@pytest.mark.parametrize("folder", EXPECTED)
def test_every_sample_is_recognised_by_its_content(interchange: Path, folder: str) -> None:
    assert {source.format.name for source in recognised(interchange / folder)} == EXPECTED[folder]


@pytest.mark.parametrize("said", ["columns=image X Y Z omega phi kappa camera", "format=ign_opk"])
def test_what_a_list_without_a_header_has_is_said_of_the_only_file(tmp_path: Path, said: str) -> None:
    path = tmp_path / "eo.txt"
    path.write_text("a.tif\t800000.5\t6200000.25\t2800.5\t0.5\t-0.25\t90.5\tcam\n")
    with pytest.raises(InputError, match=r'any list by its columns: --set "eo.txt:columns='):
        read_all([path], [], SILENT)
    _, (parts,) = read_all([path], settings_of([said]), SILENT)
    assert list(parts.images["camera"]) == ["cam"]
    np.testing.assert_array_equal(parts.exterior["position_m"], [[800000.5, 6200000.25, 2800.5]])


def test_of_a_folder_all_that_cannot_be_read_is_told_at_once(tmp_path: Path) -> None:
    for name, x in (("a.csv", "1.5"), ("b.csv", "1,5"), ("c.csv", "nan")):
        (tmp_path / name).write_text(f"point;X;Y;Z\nP{name[0]};{x};2;3\n")
    with pytest.raises(AatriError) as refused:
        read_all([tmp_path], [], SILENT)
    for name in ("b.csv", "c.csv"):
        assert f"{name}:2: " in str(refused.value)
        assert f"or leave it out: --without {name}" in str(refused.value)
    _, (parts,) = read_all([tmp_path], [], SILENT, without=["b.csv", "c.csv"])
    assert parts.ground_points["point"] == ["Pa"]


def test_only_lists_of_numbers_are_said_to_be_read_by_their_columns(tmp_path: Path) -> None:
    (tmp_path / "g.txt").write_text("EPSG:32617\n1 2 3 4 5 a.jpg p\n")
    (tmp_path / "measured.txt").write_text("P1 100.5 200.5 30.5\n")
    (tmp_path / "README.md").write_text("# 49 cameras, 7776 points and 31843 image points of one flight\n")
    read_all([tmp_path], [], (told := Told()))
    (line,) = [line for line in told.lines if line.startswith("lists without a header")]
    assert line.startswith("lists without a header are read by their columns: measured.txt; for example --set")


def borea(interchange: Path, reading: Reading, geoid: Path | None) -> list[BlockParts]:
    folder = interchange / "borea"
    parts = [read_source(folder / "23FD1305_alt_test.OPK", reading.model_copy(update={"geoid": geoid}), SILENT)]
    parts += [read_source(folder / "GCP_test.app", Reading(crs="EPSG:2154"), SILENT)]
    return parts + [read_source(folder / name, Reading(), SILENT) for name in ("Camera1.txt", "terrain_test.mes")]


def test_borea_sees_its_control_with_the_grid_of_the_geoid(interchange: Path) -> None:
    """Altitudes of the images above RAF20, ellipsoidal heights of the control: within 1.4 px; without, 230 px and more.

    One pixel is what adjusted residuals stay below; these are of the orientations as they were delivered.
    """
    grid = interchange / "borea" / "fr_ign_RAF20.tif"
    misfits = {}
    for name, geoid in (("with", grid), ("without", None)):
        block = assembled(borea(interchange, Reading(crs="EPSG:2154"), geoid))
        xyz = dict(zip(block.ground_points.point.tolist(), block.ground_points.xyz_m))
        misfits[name] = [
            misfit_px(block, image, block.image_points.xy[rows], [xyz[p] for p in block.image_points.point[rows]])
            for k, image in enumerate(block.images.id.tolist())
            if len(rows := np.flatnonzero(block.image_points.image == k))
        ]
    assert np.concatenate(misfits["with"]).max() < 1.4
    assert np.median(np.concatenate(misfits["with"])) < 0.6
    assert np.concatenate(misfits["without"]).min() > 200


def test_a_missing_grid_is_named(interchange: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"fr_ign_RAF\d\d.tif"):
        assembled(borea(interchange, Reading(crs="EPSG:2154", vertical="EPSG:5720"), None))
    with pytest.raises(InputError, match=r"no.tif: is no grid of a geoid"):
        borea(interchange, Reading(crs="EPSG:2154"), tmp_path / "no.tif")
    with pytest.raises(InputError, match=r"7 places lie outside of the grid fr_ign_RAF20.tif"):
        borea(interchange, Reading(crs="EPSG:32650"), interchange / "borea" / "fr_ign_RAF20.tif")
    with pytest.raises(InputError, match=r"heights above a geoid, but no coordinate system"):
        borea(interchange, Reading(), interchange / "borea" / "fr_ign_RAF20.tif")


@pytest.mark.slow
def test_the_three_files_of_one_scene_agree(interchange: Path) -> None:
    """OpenSfM's and COLMAP's are two programs' results of the same photographs: one rotation and scale between them."""
    folder = interchange / "sfm"
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
    assert refused.value.remedy.endswith("all formats: aatri formats")


def test_a_standard_deviation_whose_square_vanishes_is_refused_and_not_taken_for_exact(tmp_path: Path) -> None:
    (tmp_path / "l.csv").write_text("image,X,Y,Z,sX,sY,sZ\na,1,2,3,1,1,1\nb,2,2,3,1,1e-200,1\n")
    with pytest.raises(InputError, match=r"l.csv:3: '1e-200': too small for a quantity, and not 0"):
        read_source(tmp_path / "l.csv", Reading(), SILENT)


def test_a_name_of_many_characters_is_refused_with_its_line_before_all_names_are_as_long(tmp_path: Path) -> None:
    """2,000 names as wide as one of 40,000 characters took 1 GB."""
    (tmp_path / "geo.txt").write_text(
        f"EPSG:4326\na.jpg 8.5 47.2 490\n{'x' * 300}.jpg 8.6 47.2 490\nb.jpg 8.7 47.2 490\n"
    )
    with pytest.raises(InputError, match=r"geo.txt:3: 'x{100}... \(304 characters\)' is no id or name"):
        read_source(tmp_path / "geo.txt", Reading(), SILENT)


def test_lists_are_found_by_the_name_that_people_give_them() -> None:
    assert format_named("opk").name == written_format("opk").name == "table"


@pytest.mark.slow
def test_of_a_folder_with_several_forms_of_one_block_the_fuller_one_is_taken(shared_data: Path) -> None:
    """Of five exports and control lists of DBAT one of each; of COLMAP, NVM and OpenSfM of one scene one."""
    told = Told()
    sources, parts = read_all([shared_data / "dbat" / "sxb"], [], told)
    assert [s.path.name for s in sources] == ["w-op1-no-orient-pmexport.txt"]
    assert sources[0].reading().control == shared_data / "dbat" / "sxb" / "ctrlpts-weighted.txt"
    assert len(parts[0].image_points["image"]) == 51, "the other two have 47"
    text = "\n".join(told.lines)
    assert "f-op0-no-orient-pmexport.txt is left out" in text
    assert "47 of 51 image points" in text
    assert "to take it: --without ctrlpts-weighted.txt" in text
    (source,), _ = read_all([shared_data / "interchange" / "sfm"], [], SILENT)
    assert source.format.name == "colmap"


def test_what_is_left_out_for_a_fuller_file_can_be_chosen(shared_data: Path) -> None:
    without = ["w-op1-no-orient-pmexport.txt", "w-op0-no-orient-pmexport.txt", "ctrlpts-weighted.txt"]
    (source,), _ = read_all([shared_data / "dbat" / "sxb"], [], SILENT, without=without)
    assert source.path.name == "f-op0-no-orient-pmexport.txt"
    assert source.reading().control == shared_data / "dbat" / "sxb" / "ctrlpts-fixed.txt"


def test_networks_and_blocks_of_other_images_in_one_folder_are_for_the_user_to_choose(shared_data: Path) -> None:
    with pytest.raises(InputError, match=r"6 blocks.*Niemeier_Height_free.gkf \(network of 6 points\)") as several:
        read_all([shared_data / "geodetic" / "1D"], [], SILENT)
    assert "--from" in several.value.remedy
    assert "--without" in several.value.remedy
    with pytest.raises(InputError, match=r"2 blocks.*camcal-pmexport.txt \(21 images\).*\(5 images\)"):
        read_all([shared_data / "dbat"], [], SILENT)


CONTROL = "point,X,Y,Z\nA,1.5,2.5,3.5\nB,10.5,20.5,30.5\n"
MARKS = "image,point,x,y\na.jpg,A,100,200\na.jpg,B,300,400\n"


@pytest.mark.parametrize(
    ("other", "names"),
    [
        ("point,X,Y,Z\nB,10.5,20.5,30.5\n", {"a.csv"}),  # a part of the list
        ("point,X,Y,Z,sX,sY,sZ\nA,1.5,2.5,3.5,0.1,0.1,0.1\nB,10.5,20.5,30.5,0.1,0.1,0.1\n", {"b.csv"}),
        ("point,X,Y,Z,sX,sY,sZ\nB,10.5,20.5,30.5,0.1,0.1,0.1\n", {"a.csv", "b.csv"}),  # each has what the other lacks
        ("point,X,Y,Z\nB,10.5,20.5,31.5\n", {"a.csv", "b.csv"}),  # the join refuses the two heights
        ("point,X,Y,Z,role\nB,10.5,20.5,30.5,check\n", {"a.csv", "b.csv"}),
    ],
)
def test_a_list_is_left_out_only_where_another_has_all_of_it(tmp_path: Path, other: str, names: set[str]) -> None:
    (tmp_path / "a.csv").write_text(CONTROL)
    (tmp_path / "b.csv").write_text(other)
    (tmp_path / "marks.csv").write_text(MARKS)
    sources, _ = read_all([tmp_path], [], SILENT)
    assert {source.path.name for source in sources} == names | {"marks.csv"}
    named, _ = read_all([tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "marks.csv"], [], SILENT)
    assert len(named) == 3, "what the user has named is not left out"


def test_marks_of_the_same_points_with_other_coordinates_are_no_part_of_each_other(tmp_path: Path) -> None:
    (tmp_path / "marks.csv").write_text(MARKS)
    (tmp_path / "older.csv").write_text("image,point,x,y\na.jpg,A,100,201\n")
    assert len(read_all([tmp_path], [], SILENT)[0]) == 2
    (tmp_path / "older.csv").write_text("image,point,x,y\na.jpg,A,100,200\n")
    assert len(read_all([tmp_path], [], SILENT)[0]) == 1


def test_positions_that_may_have_been_measured_are_no_start_values_of_a_model(tmp_path: Path) -> None:
    """A list of positions stays beside the orientations of a model, unless its places are those of another list."""
    folder = write_project(tmp_path)
    rows = "".join(f"IMG_{k}.JPG,{k}.5,{k},100\n" for k in range(3))
    (folder / "positions.csv").write_text(f"image,X,Y,Z\n{rows}")
    (folder / "some.csv").write_text("image,X,Y,Z\nIMG_1.JPG,1.5,1,100\n")
    names = {source.path.name for source in read_all([folder], [], SILENT)[0]}
    assert "positions.csv" in names
    assert "some.csv" not in names


def test_a_file_of_a_folder_that_cannot_be_read_can_be_left_out(tmp_path: Path) -> None:
    (tmp_path / "marks.csv").write_text(MARKS)
    (tmp_path / "bad.csv").write_text("point,X,Y,Z\nA,1,2,x\n")
    with pytest.raises(InputError) as refused:
        read_all([tmp_path], [], SILENT)
    assert refused.value.remedy.endswith("or leave it out: --without bad.csv")


def test_the_schema_of_a_project_is_no_project(interchange: Path) -> None:
    assert [r.path.name for r in recognised(interchange / "opf")] == ["examples"]
