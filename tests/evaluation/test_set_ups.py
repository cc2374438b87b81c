"""Set-ups of stereo models: against the ground they came from, the normal case, and a plotter's own intersection."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import InputError
from aatri.formats.results.solution_tables import write_evaluation_tables
from aatri.stages.accuracy.plotter import plotter
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 2, "images_per_strip": 4, "cross_strips": 0},
    "known": {"full": 8},
    "ties": {"new_points": 80},
}


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(simulated(3, **SMALL))


def test_a_plotter_finds_the_ground_again_from_the_set_up_alone(chain: Chain) -> None:
    """From the printed angles, base and epipolar coordinates: normal case Z = -c b / p, then to the ground."""
    result = plotter(chain.block, chain.bundle)
    made, points = result.set_ups, result.pass_points
    assert made is not None
    assert points is not None
    assert len(made) == 6
    c = chain.block.cameras.principal_distance_mm[0]
    at = {name: k for k, name in enumerate(chain.bundle.points.id.tolist())}
    for k in range(len(made)):
        mine = np.flatnonzero((points.left == made.left[k]) & (points.right == made.right[k]))
        assert len(mine) == made.points[k]
        b = np.linalg.norm(made.base_m[k])
        p = points.left_mm[mine, 0] - points.right_mm[mine, 0]
        y = (points.left_mm[mine, 1] + points.right_mm[mine, 1]) / 2
        model = np.column_stack([points.left_mm[mine, 0] * b / p, y * b / p, -c * b / p])
        ground = made.origin_m[k] + model @ made.ground_from_model[k].T
        X = chain.bundle.points.xyz_m[[at[name] for name in points.point[mine].tolist()]]
        np.testing.assert_allclose(ground, X, atol=0.15)
        np.testing.assert_allclose(ground - X, points.residual_m[mine], atol=2e-3)  # least squares beside a mean
        np.testing.assert_allclose(points.model_m[mine], model, atol=2e-3)
        parallax = 1e3 * (points.left_mm[mine, 1] - points.right_mm[mine, 1])
        np.testing.assert_allclose(parallax, points.parallax_um[mine], atol=1e-6)
        assert made.scale_number[k] == pytest.approx(np.median(b / p) * 1e3, rel=1e-3)


def test_the_angles_are_those_of_the_notes_and_the_base_has_x_alone(chain: Chain) -> None:
    result = plotter(chain.block, chain.bundle)
    made = result.set_ups
    assert made is not None
    at = {name: k for k, name in enumerate(chain.block.images.id.tolist())}
    R = chain.bundle.images.ground_from_image
    for k in range(len(made)):
        in_model = made.ground_from_model[k].T @ made.base_m[k]
        np.testing.assert_allclose(in_model[1:], 0, atol=1e-9)
        for name, angles in ((made.left[k], made.left_rad[k]), (made.right[k], made.right_rad[k])):
            phi, omega, kappa = angles
            of_notes = Rotation.from_euler("YXZ", [-phi, omega, kappa]).as_matrix()
            np.testing.assert_allclose(made.ground_from_model[k] @ of_notes, R[at[str(name)]], atol=1e-12)
    assert result.models is not None
    assert result.models.left.tolist() == made.left.tolist()


def test_both_tables_are_written_and_read_back(chain: Chain, tmp_path: Path) -> None:
    result = plotter(chain.block, chain.bundle)
    names = [path.name for path in write_evaluation_tables(result, tmp_path)]
    assert {"set_ups.csv", "pass_points.csv", "models.csv"} <= set(names)
    with (tmp_path / "pass_points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert result.pass_points is not None
    assert len(rows) == len(result.pass_points)
    assert float(rows[0]["model_z_m"]) == result.pass_points.model_m[0, 2]
    assert {row["role"] for row in rows} == {"control", "check", "new"}


def test_models_whose_points_miss_each_other_are_named_and_a_solution_without_rays_is_refused(chain: Chain) -> None:
    """The second photo of a strip has all its y off by 0.1 mm: both of its models, and no other."""
    told, rows = Told(), chain.bundle.residuals
    name = chain.block.images.id[1]
    residual = rows.residual.copy()
    residual[(rows.kind == "image_point") & (rows.image == name), 1] += 0.1
    result = plotter(chain.block, replace(chain.bundle, residuals=replace(rows, residual=residual)), context=told)
    assert result.set_ups is not None
    first, second = (f"{a}-{b}" for a, b in zip(result.set_ups.left[:2], result.set_ups.right[:2]))
    assert [text.split("in models ")[1] for text in told.warnings] == [f"{first}, {second}"]
    without = replace(chain.bundle, residuals=rows.take(np.zeros(0, dtype=int)))
    with pytest.raises(InputError, match="no stereo model"):
        plotter(chain.block, without)
