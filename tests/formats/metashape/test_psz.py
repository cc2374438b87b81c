"""A project of Metashape: .psz with its document and tie points, local systems, the transform of a chunk, chunks."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from aatri.codes import APPROXIMATE
from aatri.errors import AatriError
from aatri.formats.metashape.reader import read_metashape
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from aatri.formats.registry.sources import read_source
from aatri.progress import SILENT
from tests.formats.metashape.test_metashape import LOCAL_CS, OLD, local, written


def test_an_archive_holds_the_same(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "p.psz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.xml", local())
    with zipfile.ZipFile(tmp_path / "cameras.xmlz", "w") as archive:
        archive.writestr("cameras.xml", local())
    assert read_source(tmp_path / "cameras.xmlz", Reading(), SILENT).images["id"] == ["a.jpg", "b.jpg"]
    parts = read_source(tmp_path / "p.psz", Reading(), SILENT)
    assert parts.format == "metashape"
    assert parts.images["id"] == ["a.jpg", "b.jpg"]
    with zipfile.ZipFile(tmp_path / "q.psz", "w") as archive:
        archive.writestr("other.txt", "a")
    with pytest.raises(AatriError, match=r"a zip archive without one XML file"):
        read_metashape(tmp_path / "q.psz")


CLOUD = """<point_cloud><tracks path="tracks0.ply"/><points path="points0.ply"/>
<projections camera_id="7" path="p7.ply"/><projections camera_id="9" path="p9.ply"/></point_cloud>
</frame></frames>"""


def ply(fields: str, *rows: tuple[float, ...]) -> bytes:
    types = {"x": "f", "y": "f", "z": "f", "size": "f", "id": "i"}
    names = fields.split()
    properties = "".join(f"property {'int' if n == 'id' else 'float'} {n}\n" for n in names)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    return head.encode() + b"".join(struct.pack("<" + "".join(types[n] for n in names), *row) for row in rows)


def project(tmp_path: Path, **members: bytes) -> Path:
    files = {
        "doc.xml": local().replace("</frame></frames>", CLOUD).encode(),
        "points0.ply": ply("x y z id", (14.0, 12.0, 10.0, 5), (1.0, 2.0, 3.0, 8)),
        "p7.ply": ply("x y size id", (2100.5, 1700.25, 2.0, 5), (1.0, 1.0, 2.0, 6)),
    }
    path = tmp_path / "p.psz"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (files | members).items():
            archive.writestr(name, content)
    return path


def test_tie_points_of_an_archive_are_in_the_world_and_without_those_that_metashape_rejected(tmp_path: Path) -> None:
    """2 (14, 12, 10) + (1, 2, 3) = (29, 26, 23); the projection of track 6, which has no point, is left out."""
    parts = read_metashape(project(tmp_path))
    assert list(parts.ground_points["point"]) == ["P1", "P2", "tie 5", "tie 8"]
    np.testing.assert_allclose(parts.ground_points["xyz_m"][2], [29.0, 26.0, 23.0])
    assert parts.ground_points["role"][2].tolist() == [APPROXIMATE] * 3
    assert list(parts.image_points["point"]) == ["P1", "T3", "tie 5"]
    np.testing.assert_allclose(parts.image_points["xy"][2], [2100.5, 1700.25])
    assert len(assembled([parts]).image_points) == 3


@pytest.mark.parametrize(
    ("damaged", "message"),
    [
        (b"<html>", "this is no PLY file"),
        (ply("x y id", (1.0, 2.0, 5)).replace(b"int id", b"int no"), "no binary vertices with x, y, id"),
        (ply("x y size id", (1.0, 2.0, 1.0, 5))[:-3], "13 bytes, where 1 vertices need 16"),
    ],
)
def test_damaged_tie_points_are_refused_with_their_place(tmp_path: Path, damaged: bytes, message: str) -> None:
    with pytest.raises(AatriError, match=rf"p7.ply: {message}"):
        read_metashape(project(tmp_path, **{"p7.ply": damaged}))


@pytest.mark.parametrize("system", [LOCAL_CS.lower(), 'ENGCRS["Local",EDATUM["Local"]'])
def test_a_local_system_is_one_in_any_case_and_version_of_wkt(tmp_path: Path, system: str) -> None:
    stated, other = (read_metashape(written(tmp_path, t)) for t in (local(), local().replace(LOCAL_CS, system)))
    assert other.frame == stated.frame


def test_a_transform_as_one_matrix_is_that_of_three_elements(tmp_path: Path) -> None:
    """PhotoScan before 1.1 has [s R, T; 0 1] by rows: it was taken for none."""
    parts = ("<rotation>1 0 0 0 1 0 0 0 1</rotation>", "<rotation>0.6 -0.8 0 0.8 0.6 0 0 0 1</rotation>")
    three = local(OLD, "0.9.1").replace(*parts)
    at = three.index("<transform><rotation>")
    matrix = "<transform>1.2 -1.6 0 1 1.6 1.2 0 2 0 0 2 3 0 0 0 1</transform>"
    one = f"{three[:at]}{matrix}{three[three.index('</transform>', at) + 12 :]}"
    exterior = [read_metashape(written(tmp_path, text)).exterior for text in (three, one)]
    for column in ("position_m", "ground_from_image"):
        np.testing.assert_allclose(exterior[0][column], exterior[1][column], rtol=0, atol=1e-12)
    with pytest.raises(AatriError, match=r"its rotation is none"):
        read_metashape(written(tmp_path, one.replace("1.2 -1.6", "1.2 -1.7")))


def test_of_several_chunks_the_one_that_is_enabled_and_not_empty_is_read_and_the_others_are_told(
    tmp_path: Path,
) -> None:
    text = local()
    chunk = text[text.index("<chunk") : text.index("</document>")]
    off = chunk.replace('"Chunk 1" enabled="true"', '"old" enabled="0"')
    empty = '<chunk label="new" enabled="1"><cameras/><markers/></chunk>'
    several = text.replace("</document>", f"{off}{empty}</document>")
    parts = read_metashape(written(tmp_path, several))
    assert parts.notes[0] == "2 chunks are not enabled, or empty, and left out: old, new"
    assert parts.images["id"] == ["a.jpg", "b.jpg"]
    with pytest.raises(AatriError, match=r"2 chunks: Chunk 1, old(?s:.*)disable the others in Metashape, or enabled="):
        read_metashape(written(tmp_path, several.replace('enabled="0"', 'enabled="true"')))
