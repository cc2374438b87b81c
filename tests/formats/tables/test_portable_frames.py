"""Portable frames: points in further local frames are bodies, read as distances and planes, and used."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from aatri.artifacts.solution import Solution
from aatri.errors import AatriError
from aatri.formats.tables.writer import write_block
from aatri.tables.digest import content_digest
from tests.reading import read_block
from tests.small_blocks import Small, adjusted_by, flown, measure

SOLID, FLAT = [f"a{k}" for k in range(5)], [f"b{k}" for k in range(4)]
BODIES = {"cube": SOLID, "board": FLAT}


def made() -> Small:
    """Two strips over a solid frame of five marks and a flat one of four, 80 m across."""
    small, rng = flown(2, 4), np.random.default_rng(8)
    solid = rng.uniform(-40, 40, (5, 3)) + np.array([300.0, 200.0, 40.0])
    flat = np.column_stack([rng.uniform(-40, 40, (4, 2)), np.zeros(4)])
    flat = flat @ Rotation.from_euler("XYZ", [0.2, -0.1, 0.5]).as_matrix().T + [500.0, 250.0, 30.0]
    small.xyz_m |= dict(zip(SOLID, solid)) | dict(zip(FLAT, flat))
    measure(small, rng)
    return small


def written(small: Small, folder: Path, sigma_m: float = 0.005, unit_m: float = 1.0, **cells: Any) -> Path:
    """The block with the marks in axes of their own."""
    small.write(folder)
    head = yaml.safe_load((folder / "block.yaml").read_text())
    head["frames"] |= {name: {"axes": ["x", "y", "z"], "crs": "local"} for name in BODIES}
    (folder / "block.yaml").write_text(yaml.safe_dump(head, sort_keys=False))
    path = folder / "ground_points.csv"
    old = path.read_text().splitlines() if path.exists() else ["point,X,Y,Z"]
    lines = [old[0] + ",sX,sY,sZ,role,frame", *(row + ",,,,," for row in old[1:])]
    for k, (name, marks) in enumerate(BODIES.items()):
        R = Rotation.from_rotvec([0.3 + k, -0.5, 1.0]).as_matrix()
        for p in marks:
            x, sigma = (small.xyz_m[p] - small.xyz_m[marks[0]]) @ R.T / unit_m, sigma_m / unit_m
            lines.append(
                f"{p}," + ",".join(map(repr, x.tolist())) + f",{sigma},{sigma},{sigma},{cells.get('role', '')},{name}"
            )
    path.write_text("\n".join([*lines, ""]))
    return folder


def test_frames_are_read_as_distances_with_covariances_and_a_plane_and_written_as_such(tmp_path: Path) -> None:
    small = made()
    block = read_block(written(small, tmp_path / "block"))
    g = block.geodetic
    assert len(g) == (3 * 5 - 6) + (2 * 4 - 3)
    true = [np.linalg.norm(small.xyz_m[b] - small.xyz_m[a]) for a, b in zip(g.start.tolist(), g.end.tolist())]
    np.testing.assert_allclose(g.value, true, rtol=1e-12)
    np.testing.assert_allclose(g.sigma, 0.005 * np.sqrt(2), rtol=1e-9)
    c = block.geodetic_covariances
    for a, b, value in zip(c.row_a.tolist(), c.row_b.tolist(), c.value.tolist()):
        ends = {g.start[a], g.end[a]}, {g.start[b], g.end[b]}
        shared = ends[0] & ends[1]
        if shared:  # u_a'u_b sigma^2 at the mark they share
            (p,) = shared
            u = [small.xyz_m[(e - {p}).pop()] - small.xyz_m[p] for e in ends]
            expected = 0.005**2 * (u[0] @ u[1]) / np.linalg.norm(u[0]) / np.linalg.norm(u[1])
            assert value == pytest.approx(expected, abs=1e-12)
        else:
            assert value == pytest.approx(0.0, abs=1e-12)
    assert block.relative_control.type.tolist() == ["plane"]
    assert block.relative_control.sigma == pytest.approx([0.005])
    assert block.relative_control_members.id.tolist() == FLAT
    assert not np.isin(block.points.id[block.ground_points.point], [*SOLID, *FLAT]).any()
    write_block(block, tmp_path / "copy")
    again = read_block(tmp_path / "copy")
    assert content_digest(replace(again, name=block.name)) == content_digest(block)


def test_they_stand_beside_observations_of_geodetic_csv(tmp_path: Path) -> None:
    """Columns that geodetic.csv has as cells, and frames as one value, and the other way round."""
    folder = written(made(), tmp_path / "block")
    (folder / "geodetic.csv").write_text("type,from,to,value,sigma\ndistance,C1,C2,812.5,0.01\n")
    g = read_block(folder).geodetic
    assert len(g) == 1 + (3 * 5 - 6) + (2 * 4 - 3)
    assert (g.start[0], g.end[0], g.value[0]) == ("C1", "C2", 812.5)


def test_they_give_the_scale_of_a_block_and_fit(tmp_path: Path) -> None:
    small = made()
    small.control, small.observed = {}, {}
    done = adjusted_by("graph", written(small, tmp_path / "block"), datum="free")
    assert done.bundle.images.oriented.all()
    places = dict(zip(done.bundle.points.id.tolist(), done.bundle.points.xyz_m))
    for a, b in (("C1", "C4"), ("C2", "C3")):
        found, true = (np.linalg.norm(x[a] - x[b]) for x in (places, small.xyz_m))
        assert found / true == pytest.approx(1.0, abs=5e-4)  # 5 mm over 50 m, and the images
    assert {"distance", "plane"} <= set(done.bundle.residuals.kind.tolist())
    assert 0.8 < done.bundle.sigma0 < 1.2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mark", "off_m", "free"), [("a0", [0.5, 0, 0], False), ("a3", [3.0, 4.0, 0], True), ("b1", [0, 0.5, 0], True)]
)
def test_a_wrong_mark_is_left_out_of_its_frame_and_takes_no_ray_with_it(
    tmp_path: Path, mark: str, off_m: list[float], free: bool
) -> None:
    """The result is that of the frame measured without the mark."""
    small = made()
    if free:
        small.control, small.observed = {}, {}
    small.rays["103", "a2"] += np.array([0.0, 0.2])
    folder, without, true = written(small, tmp_path / "block"), tmp_path / "without", small.xyz_m[mark]
    small.xyz_m[mark] = true + np.array(off_m)
    rows = (written(small, tmp_path / "wrong") / "ground_points.csv").read_text().splitlines()
    shutil.copytree(folder, without)
    (folder / "ground_points.csv").write_text("\n".join([*rows, ""]))
    (without / "ground_points.csv").write_text("\n".join([r for r in rows if not r.startswith(f"{mark},")] + [""]))
    options = {"datum": "free"} if free else {}
    done, expected = (adjusted_by("graph", one, **options) for one in (folder, without))
    assert [text for text in done.warnings if f"distances of mark {mark} in its portable frame are wrong" in text]
    assert rejected_rays(done.bundle) == rejected_rays(expected.bundle)
    assert len(rejected_rays(done.bundle)) == 1
    assert not (done.bundle.suspects.staying_out & (done.bundle.suspects.kind == "distance")).any()
    lengths = [np.linalg.norm(one.bundle.points.xyz_m - one.bundle.points.xyz_m[0], axis=1) for one in (done, expected)]
    sigma = np.sqrt(np.einsum("nii->n", expected.bundle.points.covariance_m2))
    assert np.nanmax(np.abs(lengths[0] - lengths[1]) / sigma) < 0.2
    np.testing.assert_allclose(done.bundle.redundancy, expected.bundle.redundancy)


def rejected_rays(solution: Solution) -> set[tuple[str, str]]:
    s = solution.suspects
    rays = np.flatnonzero((s.kind == "image_point") & s.staying_out)
    return set(zip(s.image[rays].tolist(), s.point[rays].tolist()))


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "unit_m", "said"), [("default", 1e-3, "in mm"), ("graph", 1e-2, "in cm")])
def test_frames_in_another_unit_are_refused_with_it_and_blame_no_ray(
    tmp_path: Path, chain: str, unit_m: float, said: str
) -> None:
    with pytest.raises(AatriError, match=f"look like values {said}") as error:
        adjusted_by(chain, written(made(), tmp_path / "block", unit_m=unit_m))
    what = "distances of a portable frame or a set"
    assert f"ground_points.csv:6: {what}: the 9 values" in str(error.value)  # the solid one
    assert f"ground_points.csv:11: {what}: the 5 values" in str(error.value)  # the flat one


def test_what_is_wrong_with_a_frame_is_an_error_with_its_line(tmp_path: Path) -> None:
    small = made()
    with pytest.raises(AatriError, match=r"frame cube, which is local: its points are marks of a body"):
        read_block(written(small, tmp_path / "role", role="check"))
    with pytest.raises(AatriError, match="no standard deviation above 0"):
        read_block(written(small, tmp_path / "sigma", sigma_m=0.0))
    for k, p in enumerate(FLAT):
        small.xyz_m[p] = np.array([10.0 * k, 20.0 * k, 0.0])
    with pytest.raises(AatriError, match=r"ground_points.csv:11.*frame board, a body of 4 marks: .* on a line"):
        read_block(written(small, tmp_path / "line"))
