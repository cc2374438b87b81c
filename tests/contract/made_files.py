"""Small made-up files of other programs, for readers of which there are no real files."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from aatri.artifacts.block import Block
from aatri.formats.merging.part import part_of
from aatri.tables.hdf5 import write
from aatri.testing.example_inputs import example_block


def colmap_model(folder: Path) -> Path:
    """A COLMAP text model: two images, one beside the other, of eight points; pinhole camera."""
    points = np.array([[x, y, 5 + 0.1 * x * y] for x in (-1.0, 0.0, 1.0, 2.0) for y in (-1.0, 1.0)])
    images, tracks = [], dict.fromkeys(range(len(points)), "")
    for image, base in enumerate((0.0, 1.0), 1):
        u, v = (900 * (points[:, :2] - [base, 0]) / points[:, 2:] + [500, 400]).T
        rays = " ".join(f"{x:.6f} {y:.6f} {k + 1}" for k, (x, y) in enumerate(zip(u, v)))
        images += [f"{image} 1 0 0 0 {-base} 0 0 1 {image}.jpg", rays]
        tracks = {k: f"{track} {image} {k}" for k, track in tracks.items()}
    rows = [f"{k + 1} {x} {y} {z} 0 0 0 0.5{tracks[k]}" for k, (x, y, z) in enumerate(points)]
    folder.mkdir()
    (folder / "cameras.txt").write_text("1 SIMPLE_PINHOLE 1000 800 900 500 400\n")
    (folder / "images.txt").write_text("\n".join(images) + "\n")
    (folder / "points3D.txt").write_text("\n".join(rows) + "\n")
    return folder


def colmap_database(block: Block, path: Path) -> Path:
    """COLMAP's database of two photographs, its tables as COLMAP makes them, with the features that `sift` finds."""
    from aatri.pixels.features import features_of
    from aatri.pixels.matching import matches_of

    rows = block.images.take(np.arange(2))
    features = [features_of(p, "", c, 4000, 16) for p, c in zip(rows.path.tolist(), rows.content.tolist())]
    pairs = matches_of(*features, 0.8).pairs
    width, height = block.cameras.format[0].tolist()
    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(
            "CREATE TABLE cameras (camera_id INTEGER, model INTEGER, width INTEGER, height INTEGER, params BLOB);"
            "CREATE TABLE images (image_id INTEGER, name TEXT, camera_id INTEGER);"
            "CREATE TABLE keypoints (image_id INTEGER, rows INTEGER, cols INTEGER, data BLOB);"
            "CREATE TABLE matches (pair_id INTEGER, rows INTEGER, cols INTEGER, data BLOB);"
            "CREATE TABLE two_view_geometries (pair_id INTEGER, rows INTEGER, cols INTEGER, data BLOB);"
        )
        database.execute("INSERT INTO cameras VALUES (1, 0, ?, ?, x'')", (int(width), int(height)))
        for number, (file, of) in enumerate(zip(rows.path.tolist(), features), 1):
            k = of.keypoints
            table = np.column_stack([k.xy_px + 0.5, k.size_px / 2, k.angle_rad]).astype("<f4")
            database.execute("INSERT INTO images VALUES (?, ?, 1)", (number, Path(file).name))
            database.execute("INSERT INTO keypoints VALUES (?, ?, 4, ?)", (number, len(table), table.tobytes()))
        both = np.column_stack([pairs.left, pairs.right]).astype("<u4")
        pair_id = 2147483647 + 2
        database.execute("INSERT INTO matches VALUES (?, ?, 2, ?)", (pair_id, len(both), both.tobytes()))
    return path


def pair_files(folder: Path) -> Path:
    """Two models of three photos."""
    folder.mkdir()
    first = ("11 90 80 -2 81", "12 90 -80 -2 -79", "13 88 3 -4 2", "14 50 40 -42 41", "15 2 70 -90 69")
    second = ("11 -2 81 -94 80.5", "12 -2 -79 -94 -79.5", "21 40 3 -52 3.5", "22 60 60 -32 61", "23 20 -60 -72 -59")
    for name, rows in (("1-2", first), ("2-3", second)):
        (folder / f"{name}.dat").write_text("\n".join(["153.0 0.0 0.0", *rows]))
    return folder


def model_file(folder: Path) -> Path:
    """Two models that share four points."""
    folder.mkdir(parents=True)
    path = folder / "models.txt"
    path.write_text("".join(f"{m} P{k} {k % 2} {k // 2 + m} {0.1 * k * k}\n" for m in range(2) for k in range(6)))
    return path


def two_parts(folder: Path) -> list[Path]:
    """The film example in two: its first and its last two strips."""
    block = example_block("film")
    folder.mkdir(parents=True)
    paths = [folder / "west.h5", folder / "east.h5"]
    for path, strips in zip(paths, ((0, 1), (1, 2))):
        write(part_of(block, np.isin(block.images.strip, strips)), path)
    return paths
