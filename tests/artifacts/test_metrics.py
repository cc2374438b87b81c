"""Figures of `aatri metrics`, worked out by hand for every kind of artifact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.artifacts import block as b
from aatri.artifacts import evaluation as e
from aatri.artifacts import image_points as ip
from aatri.artifacts import models as m
from aatri.artifacts import solution as s
from aatri.artifacts import strips as st
from aatri.artifacts.suspects import Suspects
from aatri.tables.checked_column import DTYPES
from aatri.tables.schema import columns_of, may_be_absent, tables_of
from tests.made_solutions import made_block, made_solution


def rows(cls: Any, n: int, **given: Any) -> Any:
    """A table of n rows; columns that are not given are zeros or empty texts."""
    blank = {name: np.zeros((n, *c.shape), DTYPES.get(c.dtype, "U1")) for name, c in columns_of(cls).items()}
    return cls(**(blank | given))


def artifact(cls: Any, **given: Any) -> Any:
    """An artifact whose other tables are empty."""
    blank = {name: kind.empty() for name, kind in tables_of(cls).items() if not may_be_absent(cls, name)}
    return cls(**(blank | given))


def test_of_a_block() -> None:
    block = made_block(columns=5, rows=4)
    assert block.metrics() == {
        "images": 10,
        "strips": 2,
        "cameras": 1,
        "points": 20,
        "image_points": 200,
        "fiducial_points": 0,
        "control_points": 4,
        "check_points": 4,
        "exterior_observations": 0,
        "rejects": 0,
    }


def test_a_block_counts_what_is_active_and_points_with_any_coordinate_of_a_role() -> None:
    block = made_block(columns=5, rows=4)
    ground = rows(b.GroundPoints, 4, role=[[1, 1, 2], [0, 0, 1], [2, 2, 0], [3, 3, 0]], point=[0, 1, 2, 3])
    images = b.Images.of(
        **{name: getattr(block.images, name) for name in columns_of(b.Images)} | {"active": np.arange(10) > 0}
    )
    measured = b.MeasuredPoints(
        **{name: getattr(block.image_points, name) for name in columns_of(b.MeasuredPoints)}
        | {"active": np.arange(200) > 6}
    )
    exterior = rows(b.Exterior, 4, position_use=[0, 1, 0, 1], angle_use=[0, 0, 1, 1])
    rejects = rows(b.Rejects, 3)
    fiducials, files = rows(b.Fiducials, 1), rows(b.Files, 1)
    made = made_block(
        ground_points=ground,
        images=images,
        image_points=measured,
        exterior=exterior,
        rejects=rejects,
        fiducials=fiducials,
        files=files,
        fiducial_points=rows(b.FiducialPoints, 5),
    ).metrics()
    assert made == {
        "images": 9,
        "strips": 2,
        "cameras": 1,
        "points": 20,
        "image_points": 193,
        "fiducial_points": 5,
        "control_points": 2,
        "check_points": 2,
        "exterior_observations": 3,
        "rejects": 3,
    }


def test_of_image_points() -> None:
    """sigma0 is pooled over the redundancy: sqrt((3 * 2^2 + 1 * 4^2) / 4) = sqrt(7); the third image has none."""
    images, points = rows(ip.ImageIds, 3, id=["a", "b", "c"]), rows(ip.PointIds, 1, id=["p"])
    interior = rows(ip.Interior, 3, image=[0, 1, 2], sigma0=[2.0, 4.0, np.nan], redundancy=[3, 1, 0])
    measured = rows(ip.Measurements, 3, image=[0, 1, 2], active=[True, False, True])
    corrections = rows(ip.Corrections, 2, name=["refraction", "distortion"], largest_mm=[0.004, 0.0125])
    made = artifact(
        ip.ImagePoints,
        images=images,
        points=points,
        interior=interior,
        measurements=measured,
        corrections=corrections,
        suspects=rows(Suspects, 2),
    ).metrics()
    assert made == {
        "images": 3,
        "image_points": 2,
        "redundancy": 4,
        "sigma0": pytest.approx(7**0.5),
        "suspects": 2,
        "largest_refraction_um": 4.0,
        "largest_distortion_um": 12.5,
    }
    nothing = artifact(ip.ImagePoints, images=images, points=points).metrics()
    assert nothing == {"images": 0, "image_points": 0, "redundancy": 0, "sigma0": None, "suspects": 0}


def test_of_models() -> None:
    """The parallaxes in use, 3 and 4 um, have the RMS sqrt(12.5) um."""
    images, points = rows(ip.ImageIds, 3, id=["a", "b", "c"]), rows(ip.PointIds, 3, id=["p", "q", "r"])
    orientations = rows(m.Orientations, 2, left=[0, 1], right=[1, 2], sigma0=[2.0, np.nan], redundancy=[5, 0])
    model_points = rows(m.ModelPoints, 3, parallax_mm=[0.003, -0.004, 9.0], active=[True, True, False])
    made = artifact(
        m.Models,
        images=images,
        points=points,
        orientations=orientations,
        model_points=model_points,
        unformed=rows(m.Unformed, 1),
        suspects=rows(Suspects, 1),
    ).metrics()
    assert made == {
        "models": 2,
        "unformed": 1,
        "model_points": 2,
        "redundancy": 5,
        "sigma0": pytest.approx(2.0),
        "parallax_rms_um": pytest.approx(12.5**0.5),
        "suspects": 1,
    }
    assert artifact(m.Models).metrics() | {"models": 0} == {
        "models": 0,
        "unformed": 0,
        "model_points": 0,
        "redundancy": 0,
        "sigma0": None,
        "parallax_rms_um": None,
        "suspects": 0,
    }


def test_of_strips() -> None:
    images, points = rows(ip.ImageIds, 4, id=list("abcd")), rows(ip.PointIds, 2, id=["p", "q"])
    discrepancies = rows(st.Discrepancies, 3, log_scale=[3e-6, 4e-6, 1.0], active=[True, True, False])
    made = artifact(
        st.Strips,
        images=images,
        points=points,
        strips=rows(st.FreeStrips, 2, id=["1", "2"]),
        strip_images=rows(st.StripImages, 4),
        strip_points=rows(st.StripPoints, 5),
        joints=rows(st.Joints, 3),
        discrepancies=discrepancies,
        gaps=rows(st.Gaps, 1),
        suspects=rows(Suspects, 2),
    ).metrics()
    assert made == {
        "strips": 2,
        "images": 4,
        "points": 5,
        "joints": 3,
        "scale_discrepancy_rms_ppm": pytest.approx(12.5**0.5),
        "gaps": 1,
        "suspects": 2,
    }
    assert artifact(st.Strips).metrics()["scale_discrepancy_rms_ppm"] is None


def test_of_a_solution() -> None:
    block = made_block(columns=5, rows=4)
    made = made_solution(block).metrics()
    assert made == {
        "images": 10,
        "points": 20,
        "image_points": 200,
        "observations": 400,
        "unknowns": 100,
        "redundancy": 300,
        "sigma0": 1.01,
        "sigma0_um": 5.05,
        "iterations": 4,
        "suspects": 0,
        "contradictions": 0,
    }


def test_a_solution_counts_what_is_determined_and_has_no_figure_it_does_not_know() -> None:
    block = made_block(columns=5, rows=4)
    whole = made_solution(block)
    xyz = whole.points.xyz_m.copy()
    xyz[3, 2], xyz[5] = np.nan, np.nan
    images = s.ImageOrientations(
        **{n: getattr(whole.images, n) for n in columns_of(s.ImageOrientations)} | {"oriented": np.arange(10) > 2}
    )
    points = s.SolvedPoints(**{n: getattr(whole.points, n) for n in columns_of(s.SolvedPoints)} | {"xyz_m": xyz})
    made = made_solution(
        block, sigma0=np.nan, sigma0_um=np.nan, images=images, points=points, suspects=rows(Suspects, 3)
    ).metrics()
    assert (made["images"], made["points"], made["suspects"]) == (7, 18, 3)
    assert made["sigma0"] is None
    assert "sigma0_um" not in made


def test_the_image_error_of_a_solution_is_that_of_the_worst_camera() -> None:
    """Camera a: lengths 3, 4 um, RMS sqrt(12.5); camera b: 5, 1 um, RMS sqrt(13)."""
    fields = rows(s.ErrorFields, 4, object=["a", "b", "a", "b"], error_um=[[3, 0], [3, 4], [0, -4], [1, 0]])
    made = made_solution(made_block(), error_fields=fields).metrics()
    assert made["image_error_rms_um"] == pytest.approx(13**0.5)
    assert made["image_error_max_um"] == pytest.approx(5.0)
    assert "image_error_max_um" not in made_solution(made_block(), error_fields=s.ErrorFields.empty()).metrics()


def test_of_an_evaluation() -> None:
    figures = rows(e.Figures, 2, name=["check_rmse_x_m", "check_points"], value=[0.0125, 7.0])
    made = e.Evaluation(verdict="well", figures=figures, differences=e.Differences.empty()).metrics()
    assert {name: value for name, value in made.items() if value is not None} == {
        "check_rmse_x_m": 0.0125,
        "check_points": 7,
    }
    assert {name for name, value in made.items() if value is None} == {
        "check_rmse_y_m",
        "check_rmse_z_m",
        "check_bias_x_m",
        "check_bias_y_m",
        "check_bias_z_m",
        "check_max_x_m",
        "check_max_y_m",
        "check_max_z_m",
    }
    assert isinstance(made["check_points"], int)
