"""Writing a block and reading it again gives the same content, to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aatri.artifacts.block import TRUTH, Block
from aatri.formats.tables.writer import write_block
from aatri.ids import is_valid
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.block.tables import TablesOptions, tables
from aatri.tables.digest import content_digest
from tests.formats.tables.block_folder import FILES, write_folder
from tests.reading import read_block, read_wucaps


def _digest(block: Block) -> str:
    return content_digest(block, without=TRUTH)


@pytest.mark.parametrize("axes", ["[north, east, up]", "[east, north, up]", "[up, north, east]"])
def test_a_written_block_reads_back_the_same(tmp_path: Path, axes: str) -> None:
    yaml = FILES["block.yaml"].replace("[north, east, up]", axes)
    block = read_block(write_folder(tmp_path / "block", {"block.yaml": yaml}))
    write_block(block, tmp_path / "copy")
    assert _digest(read_block(tmp_path / "copy")) == _digest(block)


def test_rejects_are_found_again(tmp_path: Path) -> None:
    points = FILES["image_points.csv"] + "".join(
        f"t{k},{i},{k},{k}\n".replace("\n", ",,,,\n") for k in range(60) for i in ("a1", "a2")
    )
    points += "lonely,a1,3,3,,,,\nfar,d2,9000,100,,,,\nfar,a1,9,9,,,,\n"
    ground = FILES["ground_points.csv"] + "unseen,1,2,3,1,1,1,,,\n"
    block = read_block(write_folder(tmp_path / "b", {"image_points.csv": points, "ground_points.csv": ground}))
    found = sorted(zip(block.rejects.kind.tolist(), block.rejects.id.tolist(), block.rejects.reason.tolist()))
    assert found == [
        ("geodetic", "distance 3 3", "from a station to itself"),
        ("ground_point", "unseen", "seen in no image"),
        ("image_point", "a1/far", "seen in one image only"),
        ("image_point", "a1/lonely", "seen in one image only"),
        ("image_point", "d2/far", "outside the image format"),
    ]
    assert (~block.image_points.active).sum() == 4  # three rejects and one switched off in the file
    write_block(block, tmp_path / "copy")
    assert _digest(read_block(tmp_path / "copy")) == _digest(block)


def test_the_real_rc30_block_goes_through_the_folder_unchanged(tmp_path: Path, shared_data: Path) -> None:
    block = read_wucaps(shared_data / "rc30_2x3/Data/bundle_ajustment", control_sigma_m=0.1)
    write_block(block, tmp_path / "copy")
    assert _digest(read_block(tmp_path / "copy")) == _digest(block)


names = st.text(min_size=1, max_size=12).filter(is_valid)
numbers = st.floats(-1e7, 1e7).filter(lambda value: value == 0 or abs(value) >= 1e-100)  # smaller ones are refused


@pytest.mark.slow
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ids=st.lists(names, min_size=4, max_size=4, unique=True), values=st.lists(numbers, min_size=3, max_size=3))
def test_any_ids_and_numbers_survive(tmp_path: Path, ids: list[str], values: list[float]) -> None:
    def quoted(text: str) -> str:
        return '"' + text.replace('"', '""') + '"'

    rows = "".join(f"{quoted(i)},{quoted(p)},{k},{values[k]!r}\n" for i in ("u", "v") for k, p in enumerate(ids[:3]))
    ground = "".join(f"{quoted(p)},{values[0]!r},{values[1]!r},{v!r}\n" for p, v in zip(ids, values))
    folder = tmp_path / "small"
    folder.mkdir(exist_ok=True)
    (folder / "block.yaml").write_text(
        "aatri_block: 1\nframes: {f: {axes: [north, east, up]}}\nsigma: {image: 5, control: 0.07}\n"
        "cameras: {c: {kind: film, image_coordinates: photo, principal_distance: 150}}\n"
    )
    (folder / "images.csv").write_text("image,camera,strip\nu,c,\nv,c,\n")
    (folder / "image_points.csv").write_text("image,point,x,y\n" + rows, encoding="utf-8")
    (folder / "ground_points.csv").write_text("point,X,Y,Z\n" + ground, encoding="utf-8")
    block = read_block(folder)
    assert set(ids[:3]) == set(block.points.id.tolist())
    assert np.sort(block.ground_points.xyz_m[:, 2]).tolist() == sorted(values)
    write_block(block, tmp_path / "copy")
    assert _digest(read_block(tmp_path / "copy")) == _digest(block)


def test_a_simulated_block_goes_through_the_folder_unchanged(tmp_path: Path) -> None:
    block = simulate(options=SimulateOptions(), rng=np.random.default_rng(1))
    write_block(block, tmp_path / "copy")
    assert _digest(read_block(tmp_path / "copy")) == _digest(block)
    assert _digest(tables(options=TablesOptions(path=tmp_path / "copy"))) == _digest(block)
