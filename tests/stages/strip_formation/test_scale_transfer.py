"""The stage strip_formation/scale_transfer."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import ScaleTransferOptions, scale_transfer
from tests.stages.made_strips import made_strips
from tests.stages.relative_orientation.test_dependent import Log


def _strips(made, **arguments):
    return scale_transfer(made.block, dependent(made.block, made.image_points), **arguments)


def _without(made, image, points):
    m = made.image_points.measurements
    return made.measured(active=~((m.image == image) & np.isin(m.point, points)))


def test_error_free_strips_equal_the_truth_in_their_own_frames() -> None:
    made = made_strips(5, 2)
    strips = _strips(made)
    assert strips.strips.id.tolist() == ["1", "2"]
    for strip in range(2):
        images = strips.strip_images.image[strips.strip_images.strip == strip]
        i, unit = images[0], np.linalg.norm(made.X0[images[1]] - made.X0[images[0]])
        at = strips.strip_images.strip == strip
        expected = (made.X0[images] - made.X0[i]) @ made.R[i] / unit
        np.testing.assert_allclose(strips.strip_images.position[at], expected, atol=1e-11)
        turned = [made.R[i].T @ made.R[k] for k in images]
        np.testing.assert_allclose(strips.strip_images.strip_from_image[at], turned, atol=1e-11)
        at = strips.strip_points.strip == strip
        ground = made.ground[strips.strip_points.point[at]]
        np.testing.assert_allclose(strips.strip_points.xyz[at], (ground - made.X0[i]) @ made.R[i] / unit, atol=1e-10)
    assert np.abs(strips.discrepancies.xyz).max() < 1e-10
    assert len(strips.gaps) == len(strips.suspects) == 0


def test_discrepancies_of_connection_points_are_those_written_out() -> None:
    """x = R2'(X - B) of the model before against k x of the next, k the mean of the points' own; heights by the notes'.

    The notes' k = (Z2a - Bza) / Z1b asks for equal heights of the connection points: their heights after joining
    differ by what it differs from point to point.
    """
    made = made_strips(4, noise_mm=0.005, seed=3)
    models = dependent(made.block, made.image_points)
    strips = scale_transfer(made.block, models, options=ScaleTransferOptions(estimator="mean", snooping_limit=50))
    o, p, d = models.orientations, models.model_points, strips.discrepancies
    turned, unit = np.eye(3), 1.0
    for a in range(2):
        rows = [np.flatnonzero(p.model == k) for k in (a, a + 1)]
        point, i, j = np.intersect1d(p.point[rows[0]], p.point[rows[1]], return_indices=True)
        before = (p.xyz[rows[0][i]] - o.base[a]) @ o.left_from_right[a]
        after = p.xyz[rows[1][j]]
        k = np.exp(np.mean(np.log(np.linalg.norm(before, axis=1) / np.linalg.norm(after, axis=1))))
        turned = turned @ o.left_from_right[a]
        here = np.flatnonzero(d.joint == a)
        assert d.point[here].tolist() == point.tolist()
        np.testing.assert_allclose(d.xyz[here], unit * (k * after - before) @ turned.T, atol=1e-7)
        of_the_notes = before[:, 2] / after[:, 2]
        np.testing.assert_allclose((d.xyz[here] @ turned)[:, 2], unit * (k - of_the_notes) * after[:, 2], atol=1e-7)
        unit *= k


def test_a_missing_model_splits_the_strip_and_is_reported() -> None:
    made = made_strips(6)
    m = made.image_points.measurements
    shared = np.intersect1d(m.point[m.image == 2], m.point[m.image == 3])
    log = Log()
    strips = _strips(_without(made, 3, shared), context=log)
    assert strips.strips.id.tolist() == ["1.1", "1.2"]
    assert strips.strip_images.image.tolist() == [0, 1, 2, 3, 4, 5]
    assert strips.strip_images.strip.tolist() == [0, 0, 0, 1, 1, 1]
    assert (strips.gaps.left[0], strips.gaps.right[0]) == ("1-02", "1-03")
    assert "0 common points" in strips.gaps.reason[0]
    assert any("1-02 - 1-03" in warning for warning in log.warnings)


def test_an_image_left_alone_is_reported() -> None:
    made = made_strips(3)
    strips = _strips(_without(made, 2, np.arange(1000)))
    assert strips.strip_images.image.tolist() == [0, 1]
    alone = strips.gaps.left.tolist().index("1-02")
    assert "alone" in strips.gaps.reason[alone]


def test_no_model_at_all_is_an_error() -> None:
    made = made_strips(2)
    with pytest.raises(GeometryError, match=r"no strip: none of 1 pairs .*; 1 of them: 0 common points, 5 are needed"):
        _strips(_without(made, 1, np.arange(1000)))


def test_a_connection_point_wrong_in_x_is_a_suspect_and_left_out() -> None:
    made = made_strips(4, noise_mm=0.005)
    m = made.image_points.measurements
    triple = np.intersect1d(np.intersect1d(m.point[m.image == 0], m.point[m.image == 1]), m.point[m.image == 2])
    point = triple[len(triple) // 2]
    strips = _strips(made.moved(made.row(0, point), [0.25, 0.0]))
    ties = strips.suspects.take(strips.suspects.kind == "model_tie")
    assert made.block.points.id[point] in ties.point
    assert point not in strips.strip_points.point
    assert (ties.test > 4).all()


def test_a_scale_jump_is_reported() -> None:
    made = made_strips(4)
    models = dependent(made.block, made.image_points)
    p = models.model_points
    factor = np.where(p.model == 1, 3.0, 1.0)[:, None]
    log = Log()
    changed = dataclasses.replace(
        models,
        model_points=dataclasses.replace(p, xyz=p.xyz * factor, covariance=p.covariance * factor[..., None] ** 2),
    )
    scale_transfer(made.block, changed, context=log)
    assert any("scale jumps" in warning for warning in log.warnings)


def test_few_connection_points_are_joined_with_a_warning() -> None:
    made = made_strips(4)
    models = dependent(made.block, made.image_points)
    p = models.model_points
    common = np.intersect1d(p.point[p.model == 0], p.point[p.model == 1])
    drop = (p.model == 0) & np.isin(p.point, common[2:])
    few = dataclasses.replace(models, model_points=p.take(~drop))
    log = Log()
    strips = scale_transfer(made.block, few, context=log)
    assert strips.joints.points.tolist()[0] == 2
    assert any("cannot be located" in warning for warning in log.warnings)
    assert strips.uncontrolled is not None
    assert "model_tie" not in strips.uncontrolled.kind  # of two the one contradicts the other
    drop |= (p.model == 0) & (p.point == common[0])
    one = dataclasses.replace(models, model_points=p.take(~drop))
    of_one = scale_transfer(made.block, one, options=ScaleTransferOptions(min_connection_points=1)).uncontrolled
    assert of_one is not None
    ties = of_one.take(of_one.kind == "model_tie")
    assert ties.point.tolist() == [made.block.points.id[common[1]]]
    split = scale_transfer(made.block, few, options=ScaleTransferOptions(min_connection_points=3))
    assert split.strips.id.tolist() == ["1.1", "1.2"]
    assert split.strip_images.image.tolist() == [0, 1, 1, 2, 3]
    assert "2 usable points, 3 are needed" in split.gaps.reason[0]
