"""Tie points from a database of COLMAP: the same as from its features, and what is wrong with one is told."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.formats.colmap.database import read_database
from aatri.stages.block.photos import PhotosOptions, photos
from aatri.stages.tie_points.database import DatabaseOptions, database
from aatri.stages.tie_points.sift import sift
from tests.contract.made_files import colmap_database
from tests.made_photographs import flown
from tests.stages.film_blocks import Told

pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Block:
    return photos(options=PhotosOptions(path=flown(tmp_path_factory.mktemp("photos"), 1, 2).folder))


def _changed(path: Path, statement: str) -> DatabaseOptions:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(statement)
    return DatabaseOptions(path=path)


@pytest.mark.slow
def test_the_features_of_sift_by_way_of_a_database_give_the_same_block(block: Block, tmp_path: Path) -> None:
    read = database(block, options=DatabaseOptions(path=colmap_database(block, tmp_path / "a.db")))
    own = sift(block)
    assert (read.points.id == own.points.id).all()
    assert np.abs(read.image_points.xy - own.image_points.xy).max() < 1e-3  # single precision
    assert np.allclose(read.image_points.sigma_mm, own.image_points.sigma_mm, rtol=1e-6)


@pytest.mark.slow
def test_a_second_orientation_of_a_place_is_no_second_point(block: Block, tmp_path: Path) -> None:
    path = colmap_database(block, tmp_path / "a.db")
    with closing(sqlite3.connect(path)) as connection, connection:
        for table, key, width in (("keypoints", "image_id", 16), ("matches", "pair_id", 8)):
            for of, rows, data in connection.execute(f"SELECT {key}, rows, data FROM {table}").fetchall():
                twice = data + (data if width == 16 else (np.frombuffer(data, "<u4") + _counts(connection)).tobytes())
                connection.execute(f"UPDATE {table} SET rows = ?, data = ? WHERE {key} = ?", (2 * rows, twice, of))
    read = database(block, options=DatabaseOptions(path=path))
    assert len(read.points) == len(sift(block).points)


def _counts(connection: sqlite3.Connection) -> np.ndarray:
    """Features of both images before they were doubled, for each value of the matches."""
    rows = [n // 2 for (n,) in connection.execute("SELECT rows FROM keypoints ORDER BY image_id")]
    pairs = connection.execute("SELECT rows FROM matches").fetchone()[0]
    return np.tile(np.array(rows, "<u4"), pairs)


@pytest.mark.slow
def test_databases_that_are_wrong_are_refused_by_what_is_wrong(block: Block, tmp_path: Path) -> None:
    cases = {
        "UPDATE keypoints SET data = substr(data, 1, 100) WHERE image_id = 2": "keypoints of image 2",
        "UPDATE keypoints SET rows = 3, data = substr(data, 1, 48) WHERE image_id = 1": "name features that there are",
        "UPDATE cameras SET width = 240": "has 240 x 360 px there and 480 x 360",
        "UPDATE images SET name = 'x' || name": "none of its images is one of the block",
        "DROP TABLE images": "no such table",
    }
    for k, (statement, message) in enumerate(cases.items()):
        options = _changed(colmap_database(block, tmp_path / f"{k}.db"), statement)
        with pytest.raises(InputError, match=message):
            database(block, options=options)
    (tmp_path / "b.db").write_text("no database")
    with pytest.raises(InputError, match="not a database"):
        database(block, options=DatabaseOptions(path=tmp_path / "b.db"))
    busy = colmap_database(block, tmp_path / "busy.db")
    Path(f"{busy}-wal").write_bytes(b"x")
    with pytest.raises(InputError, match="is being written"):
        database(block, options=DatabaseOptions(path=busy))


def test_images_of_others_are_named_and_left_out(block: Block, tmp_path: Path) -> None:
    ear = Told()
    options = _changed(colmap_database(block, tmp_path / "a.db"), "INSERT INTO images VALUES (9, 'other.jpg', 1)")
    assert len(database(block, options=options, context=ear).points) > 50
    assert any("1 image is not in the block and left out: other.jpg" in warning for warning in ear.warnings)


@pytest.mark.slow
def test_a_database_that_pycolmap_wrote(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    path = tmp_path / "a.db"
    xy = np.array([[0.5, 0.5], [10.25, 20.75]], np.float32)
    written = pycolmap.Database.open(str(path))
    camera = written.write_camera(pycolmap.Camera.create_from_model_name(1, "SIMPLE_RADIAL", 500.0, 640, 480))
    images = [written.write_image(pycolmap.Image(name=f"{k}.jpg", camera_id=camera)) for k in range(2)]
    for image in images:
        written.write_keypoints(image, np.column_stack([xy, [[3, 0.1], [2, 0.2]]]).astype(np.float32))
    written.write_matches(images[0], images[1], np.array([[0, 1], [1, 0]], np.uint32))
    written.close()
    read = read_database(path)
    assert read.name == {images[0]: "0.jpg", images[1]: "1.jpg"}
    assert read.format_px[images[0]] == (640, 480)
    assert read.xy_px[images[0]].tolist() == [[0.0, 0.0], [9.75, 20.25]]
    assert read.size_px[images[1]] == pytest.approx([6.0, 4.0])
    assert read.matches[images[0], images[1]].tolist() == [[0, 1], [1, 0]]
