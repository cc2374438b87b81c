"""The stage model_adjustment/independent_models on simulated blocks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CONTROL
from aatri.artifacts.builder import block_of
from aatri.errors import GeometryError
from aatri.stages.block.models import ModelsOptions, models
from aatri.stages.model_adjustment.given_models import given_models
from aatri.stages.model_adjustment.independent_models import IndependentModelsOptions, independent_models
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told
from tests.stages.model_adjustment.test_given_models import SIGMA
from tests.stages.model_adjustment.test_given_models import flown as given_lines


def flown(seed: int = 1, **options: Any) -> Chain:
    return run_chain(
        simulated(
            seed,
            preset="rc30",
            earth="tangent",
            false_origin_m=(0.0, 0.0),
            flight={"strips": 3, "images_per_strip": 5, "cross_strips": 0},
            known={"full": 12, "height": 6, "check_full": 0},
            **options,
        )
    )


@pytest.fixture(scope="module")
def exact() -> Chain:
    return flown(noise=False, ties={"new_points": 150})


def true_points(chain: Chain) -> Any:
    truth = chain.block.true_points
    assert truth is not None
    X = np.full((len(chain.block.points), 3), np.nan)
    X[truth.point] = truth.xyz_m
    return X


def test_the_sigma_of_the_centres_may_stand_alone_or_in_a_mapping() -> None:
    for sigma in (0.05, "from_orientation"):
        short, long = (IndependentModelsOptions.model_validate({"centres": c}) for c in (sigma, {"sigma": sigma}))
        assert short == long
        assert short.centres.sigma == sigma
    with pytest.raises(ValueError, match="sigma"):
        IndependentModelsOptions.model_validate({"centres": {"sigma": -1.0}})


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"centres": {"sigma": 0.05}},
        {"iteration": "plan_height"},
        {"unit": "double_model", "centres": {"sigma": 0.05}},
    ],
)
def test_error_free_models_return_the_truth(exact: Chain, options: Any) -> None:
    found = independent_models(
        exact.block, exact.refined, exact.models, exact.strip_block, options=IndependentModelsOptions(**options)
    )
    solved = np.isfinite(found.points.xyz_m[:, 0])
    assert solved.sum() > 0.9 * len(solved)
    assert found.points.xyz_m[solved] == pytest.approx(true_points(exact)[solved], abs=2e-6)
    assert exact.block.true_images is not None
    assert found.images.position_m == pytest.approx(exact.block.true_images.position_m, abs=1e-5)


@pytest.mark.slow
def test_double_models_are_counted_as_the_notes_do_and_their_points_are_named_by_both() -> None:
    """Of a strip of five images two bodies of three centres: 7 unknowns each, 3 of every point and image."""
    chain, told = flown(2, ties={"new_points": 150}), Told()
    options = IndependentModelsOptions.model_validate({"unit": "double_model", "centres": 0.05})
    found = independent_models(
        chain.block, chain.refined, chain.models, chain.strip_block, options=options, context=told
    )
    names = sorted(set(found.transformations.id.tolist()))
    assert len(names) == 3 * 2
    assert all(name.count("+") == 1 for name in names)
    assert any("6 double models of" in line and "three perspective centres" in line for line in told.lines)
    ids, p = chain.models.orientations.id.tolist(), chain.models.model_points
    of = {k: next(name for name in names if one in name.split("+")) for k, one in enumerate(ids)}
    pairs = {(of[m], point) for m, point, active in zip(p.model.tolist(), p.point.tolist(), p.active) if active}
    ground = chain.block.ground_points
    held = np.isin(ground.point, [point for _, point in pairs])
    control = int((ground.role[held] == CONTROL).sum())
    points = len({point for _, point in pairs})
    assert not len(found.suspects.take(found.suspects.stage == "model_adjustment"))
    assert found.redundancy == 3 * (len(pairs) + 6 * 3) + control - 7 * 6 - 3 * points  # positions: as many as centres
    off = (found.points.xyz_m - true_points(chain))[np.isfinite(found.points.xyz_m).all(axis=1)]
    single = independent_models(chain.block, chain.refined, chain.models, chain.strip_block)
    of_single = (single.points.xyz_m - true_points(chain))[np.isfinite(single.points.xyz_m).all(axis=1)]
    assert np.sqrt((off**2).mean()) < 1.5 * np.sqrt((of_single**2).mean())
    with pytest.raises(ValueError, match="double models are rigid"):
        IndependentModelsOptions.model_validate({"unit": "double_model"})


@pytest.mark.slow
def test_standard_deviations_of_points_agree_with_their_true_errors() -> None:
    """Models of one strip share images, whose errors they have in common: theory and sigma0 are somewhat too small.

    Of models that share nothing they are right, see tests/orientation/bodies/test_independent_models.py. Single
    blocks scatter by 12 %, for errors of control go through all points: eight together.
    """
    squares, count, sigma0 = 0.0, 0, []
    for seed in range(1, 9):
        chain = flown(seed, ties={"new_points": 200})
        told = Told()
        found = independent_models(chain.block, chain.refined, chain.models, chain.strip_block, context=told)
        assert any("models of" in text and "perspective centres" in text for text in told.lines)
        e, C = found.points.xyz_m - true_points(chain), found.points.covariance_m2
        control = set(chain.block.ground_points.point.tolist())
        new = np.flatnonzero(np.isfinite(e).all(axis=1) & np.isfinite(C).all(axis=(1, 2)))
        new = new[~np.isin(new, sorted(control))]
        squares += float(np.einsum("ni,nij,nj->", e[new], np.linalg.inv(C[new]), e[new]))
        count += 3 * len(new)
        sigma0.append(found.sigma0)
    assert 0.9 < np.sqrt(squares / count) < 1.15
    assert 0.8 < np.mean(sigma0) < 1.2


@pytest.mark.slow
def test_plan_and_height_in_turn_converge_with_cross_strips_to_the_common_adjustment() -> None:
    chain = run_chain(
        simulated(
            3,
            preset="rc30",
            earth="flat",
            ties={"new_points": 250},
            known={"full": 10},
            flight={"strips": 3, "images_per_strip": 8, "cross_strips": 2},
        )
    )
    found = []
    for iteration in ("together", "plan_height"):
        told, options = Told(), IndependentModelsOptions(iteration=iteration)
        found.append(
            independent_models(chain.block, chain.refined, chain.models, chain.absolute, options=options, context=told)
        )
    assert any("plan and height in turn" in line for line in told.lines)
    assert np.nanmax(np.abs(found[0].points.xyz_m - found[1].points.xyz_m)) < 1e-3


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("lever_arm_m", [(0.0, 0.0, 0.0), (0.3, -0.2, 1.5)])
@pytest.mark.parametrize("control", [0, 1])
def test_positions_bring_models_to_the_ground_and_a_wrong_one_is_found(control: int, lever_arm_m: Any) -> None:
    block = simulated(
        2,
        flight={"strips": 2, "images_per_strip": 6},
        known={"full": control},
        ties={"per_position": 4},
        gnss={"observed": True, "lever_arm_m": lever_arm_m},
        noise={"gnss_m": (0.03, 0.03, 0.03)},
    )
    position_m = block.exterior.position_m.copy()
    position_m[5, 0] += 1.0
    chain = run_chain(replace(block, exterior=replace(block.exterior, position_m=position_m)))
    found = independent_models(chain.block, chain.refined, chain.models, chain.absolute)
    off = np.sqrt(np.nanmean((found.points.xyz_m - true_points(chain)) ** 2, axis=0))
    assert (off < 0.15).all()
    rejected = found.suspects.verdict == "rejected"
    assert found.suspects.image[rejected & (found.suspects.kind == "position")].tolist() == [block.images.id[5]]
    assert (found.residuals.kind == "position").sum() == len(block.images)


def test_what_control_leaves_open_is_an_error_and_not_a_block_that_shrinks() -> None:
    chain = run_chain(
        simulated(2, flight={"strips": 2, "images_per_strip": 5}, known={"full": 4}, gnss={"observed": False})
    )
    for n, what in ((1, "rotation about Z, scale"), (2, "rotation about the line")):
        few = replace(chain.block, ground_points=chain.block.ground_points.take(np.arange(n)))
        with pytest.raises(GeometryError, match=what):
            independent_models(few, chain.refined, chain.models, chain.absolute)


def test_a_model_that_hangs_on_too_little_is_left_out_by_name() -> None:
    chain = run_chain(simulated(2, flight={"strips": 2, "images_per_strip": 5}, known={"full": 8}))
    points = chain.models.model_points
    first = points.model == 0  # the first of its strip: without points it keeps the centre it shares with the next one
    models = replace(chain.models, model_points=replace(points, active=points.active & ~first))
    told = Told()
    found = independent_models(chain.block, chain.refined, models, chain.absolute, context=told)
    name = str(chain.models.orientations.id[0])
    assert any("share fewer than 3 points" in text and name in text for text in told.warnings)
    assert np.nanmax(np.abs(found.points.xyz_m - true_points(chain))) < 0.5


def test_models_that_nothing_orients_are_an_error(exact: Chain) -> None:
    images = exact.strip_block.images
    nothing = replace(exact.strip_block, images=replace(images, oriented=np.zeros(len(images), dtype=bool)))
    with pytest.raises(GeometryError, match="orients no model"):
        independent_models(exact.block, exact.refined, exact.models, nothing)


@pytest.mark.slow
def test_a_model_in_another_unit_with_the_standard_deviation_of_the_others_is_named(tmp_path: Path) -> None:
    lines, control, _ = given_lines(4)
    model = lines[-1].split()[0]
    rows = [_in_micrometres(line) if line.split()[0] == model else line for line in lines]
    known = [" ".join([point, *map(str, xyz.tolist())]) for point, xyz in control.items()]
    (tmp_path / "control.txt").write_text("\n".join(known) + "\n")
    for text, named in ((lines, []), (rows, [f"model {model}"])):
        (tmp_path / "models.txt").write_text("\n".join(text) + "\n")
        told = Told()
        options = ModelsOptions(path=tmp_path / "models.txt", control=tmp_path / "control.txt", sigma=SIGMA)
        given_models(models(options=options), context=told)
        assert [t.split(" has")[0] for t in told.warnings if "has another unit" in t] == named


def _in_micrometres(line: str) -> str:
    """A line of a model with its coordinates times 1000."""
    model, point, *xyz = line.split()[:5]
    return " ".join([model, point, *(repr(1000.0 * float(value)) for value in xyz), *line.split()[5:]])


def test_a_block_without_models_is_refused_with_the_stage_that_reads_them() -> None:
    control = {"point": ["A"], "xyz_m": np.zeros((1, 3)), "sigma_m": 0.01, "role": CONTROL}
    with pytest.raises(GeometryError, match="no model coordinates") as refused:
        given_models(block_of(name="rays", ground_points=control))
    assert "block/models" in refused.value.remedy
