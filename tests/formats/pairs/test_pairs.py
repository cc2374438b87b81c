"""Pair files: interior elements and point pairs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import InputError
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.block.pairs import PairsOptions, pairs
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.reading import read_pairs
from tests.stages.film_blocks import Told

FIRST = (
    "153.033 0.01 -0.02\n# point x1 y1 x2 y2\n11 100000 200000 -700000 210000\n12, 50000, -3000, -760000, -1500\n"
    "14 1000 2000 -800000 2500\n"
)


def folder(where: Path, **files: str) -> Path:
    where.mkdir(exist_ok=True)
    for name, text in files.items():
        (where / f"{name}.dat").write_text(text)
    return where


def test_models_of_a_strip_share_their_photos(tmp_path: Path) -> None:
    """Unit 0.1 um, as in the lecture notes' program."""
    made = folder(
        tmp_path / "strip",
        m1=FIRST,
        m2="153.033 0.01 -0.02\n12 -760000 -1500 -900000 4000\n15 1 2 -800000 3\n16 5 6 -800000 7\n",
    )
    (tmp_path / "control.txt").write_text("12 446000.5 4505000.25 12.5\n")
    block = read_pairs(made, unit_um=0.1, image_sigma_um=5.0, control=tmp_path / "control.txt")
    assert block.images.id.tolist() == ["1", "2", "3"]
    assert block.images.sequence.tolist() == [1, 2, 3]
    assert block.cameras.principal_distance_mm.tolist() == [153.033]
    assert block.cameras.principal_point_mm.tolist() == [[0.01, -0.02]]
    m = block.image_points
    of = {(block.images.id[i], block.points.id[p]): xy for i, p, xy in zip(m.image, m.point, m.xy)}
    assert len(of) == 11
    assert of["2", "12"] == pytest.approx([-76.0, -0.15])
    assert of["3", "12"] == pytest.approx([-90.0, 0.4])
    assert m.sigma_mm == pytest.approx(np.full((11, 2), 0.005))
    assert block.ground_points.xyz_m.tolist() == [[446000.5, 4505000.25, 12.5]]


@pytest.mark.parametrize(
    ("second", "told"),
    [
        ("153.033 0.01 -0.02\n12 -761000 -1500 0 0\n13 1 2 3 4\n24 5 6 7 8\n", "measured twice, 0.1 mm apart"),
        ("152 0 0\n12 -760000 -1500 0 0\n", "the files before have"),
        ("153.033 0.01 -0.02\n13 1 2 3\n", "4 words"),
        ("153.033 0.01\n", "interior elements should be"),
        ("153.033 0.01 -0.02\n13 1 2 3 4\n13 1 2 3 4\n", "twice, first in line 2"),
        ("153.033 0.01 -0.02\n13 1 2,5 3\n", "'2,5' between blanks may be two numbers or one with a decimal comma"),
    ],
)
def test_what_contradicts_is_named_with_its_line(tmp_path: Path, second: str, told: str) -> None:
    with pytest.raises(InputError) as error:
        read_pairs(folder(tmp_path / "strip", m1=FIRST, m2=second), unit_um=0.1, image_sigma_um=5.0)
    assert told in str(error.value)


def test_a_real_pair_is_oriented_as_the_block_reader_has_it(shared_data: Path, tmp_path: Path) -> None:
    """Photos 319 and 320 of rc30_2x3, written as a pair file."""
    data = shared_data / "rc30_2x3" / "Data" / "relative_orientation"
    left, right = (
        [line.split() for line in (data / f"{n}.txt").read_text().splitlines() if line.strip()]
        for n in ("0319", "0320")
    )
    of = {row[0]: row[1:] for row in right[1:]}
    lines = [" ".join(left[0][:3]), *(" ".join([*row, *of[row[0]]]) for row in left[1:])]
    made = folder(tmp_path / "strip", **{"319-320": "\n".join(lines)})
    block = pairs(options=PairsOptions(path=made))
    models = dependent(block, calibrated(block))
    assert models.orientations.id.tolist() == ["319-320"]
    assert models.elements is not None
    value = dict(zip(models.elements.name.tolist(), models.elements.value.tolist()))
    # Answer of the student program beside the data, to four digits; its angles turn the other way round.
    expected = {"phi2": -0.0006, "omega2": 0.0035, "kappa2": -0.0007}
    assert {k: value[k] for k in expected} == pytest.approx(expected, abs=5.1e-5)


def test_models_measured_one_by_one_go_to_an_adjusted_block(tmp_path: Path) -> None:
    """Connection points are read anew in every model: coordinates differ by their noise in the photo they share."""
    rng, c, sigma_mm = np.random.default_rng(8), 153.0, 0.005
    X0 = np.column_stack([200.0 * np.arange(5), rng.normal(0, 3, 5), 500.0 + rng.normal(0, 3, 5)])
    angles = rng.normal(0, 0.01, (5, 3))
    R = Rotation.from_euler("XYZ", angles).as_matrix()
    x, y = np.meshgrid(np.arange(-50.0, 900.0, 50.0), [-150.0, 0.0, 150.0])
    X = np.column_stack([x.ravel(), y.ravel(), rng.uniform(0, 40, x.size)])
    u = np.einsum("kji,kpj->kpi", R, X[None] - X0[:, None])
    seen = -c * u[:, :, :2] / u[:, :, 2:]
    inside = (np.abs(seen) < 110).all(axis=2)
    files = {}
    for k in range(4):
        rows = [f"{c}"]
        for p in np.flatnonzero(inside[k] & inside[k + 1]):
            pair = np.concatenate([seen[k, p], seen[k + 1, p]]) + rng.normal(0, sigma_mm, 4)
            rows.append(f"{p} " + " ".join(f"{v:.4f}" for v in pair))
        files[f"m{k}"] = "\n".join(rows)
    made = folder(tmp_path / "strip", **files)
    known = [p for p in range(len(X)) if p % 7 == 0]
    (tmp_path / "control.txt").write_text("\n".join(f"{p} {X[p, 0]} {X[p, 1]} {X[p, 2]}" for p in known))
    block = pairs(options=PairsOptions(path=made, control=tmp_path / "control.txt", image_sigma_um=5.0))
    twice = inside[1:-1] & inside[:-2] & inside[2:]
    assert len(block.image_points) == sum(2 * int((inside[k] & inside[k + 1]).sum()) for k in range(4))
    assert twice.any()
    points = systematic(block, calibrated(block))
    strips = scale_transfer(block, dependent(block, points))
    solution = bundle(block, points, polynomial(block, points, strips, similarity(block, strips, points)))
    at = {name: k for k, name in enumerate(block.points.id.tolist())}
    off = np.array([solution.points.xyz_m[at[str(p)]] - X[p] for p in range(len(X)) if str(p) in at])
    assert np.sqrt((off**2).mean()) < 0.1
    assert 0.8 < solution.sigma0 < 1.25


def test_end_marks_end_a_list_and_nothing_may_follow_them(tmp_path: Path) -> None:
    """As the student program's files have them; what stands after a mark was forgotten by someone."""
    control = tmp_path / "control.txt"
    control.write_text("12 446000.5 4505000.25 12.5\n-99 0 0 0\n")
    block = read_pairs(
        folder(tmp_path / "a", m1=FIRST + "-99\n-99\n"), unit_um=0.1, image_sigma_um=5.0, control=control
    )
    assert len(block.image_points) == 6
    assert len(block.ground_points) == 1
    with pytest.raises(InputError, match=r"m1\.dat:7: rows after the end mark of line 6"):
        read_pairs(folder(tmp_path / "b", m1=FIRST + "END\n15 1 2 3 4\n"), unit_um=0.1, image_sigma_um=5.0)
    with pytest.raises(InputError, match="no rows before the end mark"):
        read_pairs(folder(tmp_path / "c", m1="-99\n"), unit_um=0.1, image_sigma_um=5.0)


@pytest.mark.parametrize(("given_um", "as_um", "told"), [(0.1, 1000.0, "0.1 um 67 deg"), (1000.0, 1.0, "m 67 deg")])
def test_a_wrong_unit_is_named(tmp_path: Path, given_um: float, as_um: float, told: str) -> None:
    """The file in one unit read as another: no lens has such a field, and what would be one is named."""
    rng = np.random.default_rng(2)
    xy_mm = np.column_stack([rng.uniform(-70, 70, 30), rng.uniform(-70, 70, 30)])
    xy_mm[0] = 71.0, 71.0
    rows = [f"{k} {x:.6f} {y:.6f} {x - 5:.6f} {y:.6f}" for k, (x, y) in enumerate(xy_mm * 1000 / given_um)]
    made = folder(tmp_path / "strip", m1="\n".join(["153", *rows]))
    told_by = Told()
    pairs(options=PairsOptions(path=made, unit_um=as_um), context=told_by)
    assert any("as no lens does" in w and f"in units of {told}" in w for w in told_by.warnings)
