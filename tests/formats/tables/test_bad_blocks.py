"""Bad input: every fault is found with its place, the value, a remedy and exit code 3, and never a traceback."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aatri.errors import AatriError, InputError
from tests.bad_inputs.changes import apply
from tests.formats.tables.block_folder import FILES, replaced, write_folder
from tests.reading import read_block

Change = dict[str, str | bytes | None]
POINTS, IMAGES, GROUND, YAML = "image_points.csv", "images.csv", "ground_points.csv", "block.yaml"


CASES: dict[str, dict[str, Any]] = {
    row["case"]: row for row in yaml.safe_load((Path(__file__).parent / "bad_blocks.yaml").read_text(encoding="utf-8"))
}


def _added(name: str, rows: str) -> Change:
    return {name: FILES[name] + rows}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_told_with_place_remedy_and_exit_code(tmp_path: Path, case: str) -> None:
    row, tables = CASES[case], dict[str, str | bytes](FILES)
    apply(row, tables)
    folder = write_folder(tmp_path / "block", {name: tables.get(name) for name in FILES})
    with pytest.raises(AatriError) as caught:
        read_block(folder)
    message = str(caught.value)
    assert caught.value.exit_code == 3
    assert str(folder / row["at"]) in message
    assert row["what"] in message
    assert "fix: " in message
    assert row.get("remedy", "") in message


def test_all_faults_come_at_once(tmp_path: Path) -> None:
    changes = {
        **replaced(POINTS, "1,a1,10.5,", "1,a1,abc,"),
        **replaced(GROUND, "approximate", "aproximate"),
        **replaced(IMAGES, "d2,uav", "d2,xx"),
    }
    with pytest.raises(AatriError) as caught:
        read_block(write_folder(tmp_path / "block", changes))
    for place in ("image_points.csv:2:6", "ground_points.csv:6:", "images.csv:6:4"):
        assert place in str(caught.value)


def test_a_missing_folder_names_the_nearest_one(tmp_path: Path) -> None:
    write_folder(tmp_path / "rc30_block")
    with pytest.raises(InputError, match="did you mean 'rc30_block'"):
        read_block(tmp_path / "rc30_blok")
    with pytest.raises(InputError, match="is a file"):
        read_block(tmp_path / "rc30_block" / "block.yaml")


def test_many_faults_of_one_kind_are_counted(tmp_path: Path) -> None:
    rows = "".join(f"p{k},a1,x{k},1,,,,\n" for k in range(300))
    with pytest.raises(AatriError) as caught:
        read_block(write_folder(tmp_path / "block", _added(POINTS, rows)))
    assert "280 more cells" in str(caught.value)
    assert len(str(caught.value).splitlines()) < 60


def test_points_seen_once_and_images_without_points_are_set_aside_however_many(tmp_path: Path) -> None:
    rows = "".join(f"once{k},a1,{k},1,,,,\n" for k in range(30))
    changes = {**_added(POINTS, rows), **_added(IMAGES, "z9,uav,,,,,\n")}
    rejects = read_block(write_folder(tmp_path / "block", changes)).rejects
    assert (rejects.reason == "seen in one image only").sum() == 30
    assert rejects.id[rejects.kind == "image"].tolist() == ["z9"]


def test_a_wrong_unit_of_image_coordinates_is_an_error(tmp_path: Path) -> None:
    changes = replaced(YAML, "format: [6000, 4000]", "format: [20, 13]")
    with pytest.raises(InputError, match=r"outside the image format; at most 5%"):
        read_block(write_folder(tmp_path / "block", changes))


def test_another_frame_needs_pyproj_or_a_crs(tmp_path: Path) -> None:
    yaml = (
        FILES[YAML]
        .replace("frames:\n", "frames:\n")
        .replace("crs: EPSG:32650}\n", "crs: EPSG:32650}\n  wgs: {axes: [latitude, longitude, height]}\n")
    )
    ground = FILES[GROUND].replace("datum\n", "datum,frame\n").replace("\n", ",\n").replace("frame,\n", "frame\n")
    ground += "far,40.5,116.5,100,1,1,1,,check,,wgs\n"
    with pytest.raises(InputError, match=r"aatri\[crs\]|local"):
        read_block(write_folder(tmp_path / "block", {YAML: yaml, GROUND: ground}))


_mutations = st.tuples(st.sampled_from(sorted(FILES)), st.integers(0, 10_000), st.integers(0, 6), st.binary(max_size=6))


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutations=st.lists(_mutations, min_size=1, max_size=3))
def test_mutated_files_give_a_block_or_an_error_of_ours(tmp_path: Path, mutations: list[Any]) -> None:
    changes: Change = {}
    for name, place, length, new in mutations:
        text = FILES[name].encode()
        k = place % len(text)
        changes[name] = text[:k] + new + text[k + length :]
    exit_code = 0
    try:
        read_block(write_folder(tmp_path / "block", changes))
    except AatriError as error:
        exit_code = error.exit_code
    assert exit_code in (0, 3)


def test_a_block_of_photographs_needs_no_image_points_yet(tmp_path: Path) -> None:
    (tmp_path / "block.yaml").write_text(
        "aatri_block: 1\nframes: {map: {axes: [east, north, up], crs: local}}\nearth_curvature: ignore\n"
        "units: {sigma_image: px}\nsigma: {image: 0.5}\n"
        "cameras: {c: {kind: digital, image_coordinates: pixel, format: [6000, 4000], principal_distance: 35, "
        "pixel: {size: 0.004, origin: top-left-corner, y: down}}}\n"
    )
    (tmp_path / "images.csv").write_text("image,camera,path\n1,c,1.jpg\n2,c,2.jpg\n")
    block = read_block(tmp_path)
    assert block.images.active.tolist() == [True, True]
    assert len(block.image_points) == 0
    (tmp_path / "images.csv").write_text("image,camera\n1,c\n2,c\n")
    with pytest.raises(InputError, match=r"image_points\.csv"):
        read_block(tmp_path)
