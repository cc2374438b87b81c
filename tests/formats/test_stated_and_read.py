"""What files say of themselves, counts, tracks and scale, is held against what was read; decimal commas are seen."""

from __future__ import annotations

from pathlib import Path

import pytest

from aatri.errors import AatriError
from aatri.formats.dbat.files import decimal_commas
from tests.campaigns.fuzz_seeds import READERS, WUCAPS
from tests.contract.made_files import colmap_model
from tests.reading import read_colmap, read_wucaps
from tests.stages.hand_block import Heard


def wucaps(folder: Path, first: str) -> Heard:
    heard = Heard()
    folder.mkdir()
    for name, text in WUCAPS.items():
        (folder / name).write_text(text.replace("1 10 25000 0", first))
    read_wucaps(folder, reporter=heard)
    return heard


@pytest.mark.parametrize(
    ("first", "what"),
    [
        ("1 2 0 0", ""),
        ("1 3 0 0", "says 3, 2 follow"),
    ],
)
def test_strips_of_wucaps_state_photos_and_scale(tmp_path: Path, first: str, what: str) -> None:
    warned = [w for w in wucaps(tmp_path / "w", first).warned if "rejected" not in w]
    assert (what in warned[0] and "PREPHI.DAT" in warned[0]) if what else not warned


def test_the_scale_of_wucaps_is_that_of_its_known_points(tmp_path: Path) -> None:
    """Two known points 245.5 m and 100.1 mm apart in the photo, a scale of 1 : 2452."""
    ground = {
        **WUCAPS,
        "PRECKI.DAT": "831000 1000 2000 5\n832000 1000 2245.5 5\n-99 0 0 0\n",
        "PRECPI.DAT": "2 0 0\n831000\n832000\n",
    }
    for stated, warns in ((24520, False), (2452, True), (245200, True)):
        folder, heard = tmp_path / f"{stated}", Heard()
        folder.mkdir()
        for name, text in ground.items():
            text = text.replace("1 10 25000 0", f"1 2 {stated} 0").replace(
                "831000 78.12 70.84", "831000 50 70\n832000 -50.1 70"
            )
            (folder / name).write_text(text)
        read_wucaps(folder, reporter=heard, max_reject_share=1.0)
        assert any("1 : 2453" in w for w in heard.warned) is warns


@pytest.mark.parametrize(
    ("name", "old", "new", "what"),
    [
        ("points3D", "0.5 1 0 2 0", "0.5 1 0 2 1", "point 1 is feature 1 of image 2: its track says so"),
        ("points3D", "0.5 1 0 2 0", "0.5 1 0", "point 1 is feature 0 of image 2: the image says so"),
        ("points3D", "0.5 1 0 2 0", "0.5 1 0 2", "3 words"),
        ("images", "529412 1 ", "529412 2 ", "contradictions"),
    ],
)
def test_tracks_of_colmap_that_contradict_features_are_errors(
    tmp_path: Path, name: str, old: str, new: str, what: str
) -> None:
    folder = colmap_model(tmp_path / "m")
    path = folder / f"{name}.txt"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(AatriError, match=what) as caught:
        read_colmap(folder)
    assert "points3D.txt:1" in str(caught.value)


def test_counts_of_colmap_and_images_that_are_left_out_are_told(tmp_path: Path) -> None:
    folder, heard = colmap_model(tmp_path / "m"), Heard()
    images = folder / "images.txt"
    images.write_text(f"# Number of images: 3, mean observations per image: 8\n{images.read_text()}")
    points = folder / "points3D.txt"
    points.write_text(points.read_text().replace("2 0\n", "2 0 9 4\n", 1))
    read_colmap(folder, reporter=heard)
    assert any("3 images, 2 follow" in w and "images.txt" in w for w in heard.warned)
    assert any("1 image that is not in images.txt: 9" in w for w in heard.warned)


def test_bytes_beyond_the_counts_of_a_binary_model_are_refused(tmp_path: Path) -> None:
    reader = READERS["colmap_binary"]
    reader.write(tmp_path)
    with (tmp_path / "points3D.bin").open("ab") as file:
        file.write(bytes(8))
    with pytest.raises(AatriError, match="8 bytes more"):
        reader.read(tmp_path)


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        (["1, a, 10,5, 20, 30", "2, b, 1, 2, 3"], ["10,5", ""]),
        (["1,a,4505,079,446,263,6,378"] * 2, ["4505,079"] * 2),
        (["1,a,0,25,1.5,0.5", "2,b,1.5,2,3", "3,b,1.5,2,3"], ["0,25", "", ""]),
        (["1,a,0,1,0", "2,b,1,1,0"], ["", ""]),
        (["1,a,0,1,0,1e-3", "2,b,1,1,0,1e-3"], ["", ""]),
        (["1, a, 0, 1, 0, 1, 1, 2", "2, b, 1, 1, 0"], ["", ""]),
        (["1,a,1.5,2,3,1,1,1", "2,a,1.5,2,3,1,1,1"], ["", ""]),
    ],
)
def test_decimal_commas_between_commas(lines: list[str], found: list[str]) -> None:
    assert decimal_commas(lines) == found
