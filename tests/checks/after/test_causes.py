"""What a result shows: one cause after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Uncontrolled
from aatri.checks.after.hinge_image import hanging_parts
from aatri.checks.after.left_out import left_out_alike
from aatri.checks.after.rank_defect import rank_advice
from aatri.checks.after.sigma0 import sigma0
from aatri.checks.after.smooth_signal import smooth_signal
from aatri.checks.after.uncontrolled import uncontrolled_observations
from aatri.checks.finding import Finding
from aatri.checks.limits import OWN_DATUM
from aatri.errors import GeometryError
from aatri.observations.poses import POINT
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.refinement.collocation import collocate
from aatri.stages.block.models import ModelsOptions, models
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.model_adjustment.given_models import given_models
from tests.orientation.bodies.made_body import HEIGHT, MadeBody
from tests.small_blocks import adjusted_by, flown
from tests.stages.chain import run_chain, simulated
from tests.stages.film_blocks import Told

# Control worse than a third of the block's accuracy is told: m^2 = m_c^2 + m_p^2, m_c <= m_p / 3.


@pytest.mark.parametrize(("control_m", "told"), [(0.0045, False), (0.0055, True), (0.02, True)])
def test_control_worse_than_a_third_is_told_by_the_run(tmp_path: Path, control_m: float, told: bool) -> None:
    """Judged by hand from the standard deviations of the points; a third adds 5.4 %."""
    small = flown(strips=2, per_strip=4)
    small.observed = {}
    folder = small.write(tmp_path / "block")
    text = (folder / "block.yaml").read_text()
    (folder / "block.yaml").write_text(text.replace("control:\n  - 0.02\n  - 0.02\n  - 0.02", f"control: {control_m}"))
    done = adjusted_by("default", folder)
    notes = [line for line in done.lines if "control has a standard deviation" in line]
    points = done.bundle.points
    new = ~np.char.startswith(points.id, "C") & np.isfinite(points.covariance_m2).all(axis=(1, 2))
    m_plan = np.sqrt(np.einsum("nii->ni", points.covariance_m2[new])[:, :2].mean())
    worse = control_m > np.sqrt(max(m_plan**2 - control_m**2, 0.0)) / 3
    assert bool(worse) == told
    assert any("in plan" in note for note in notes) == told
    assert np.hypot(1.0, 1 / 3) == pytest.approx(1.054, abs=1e-4)


def test_images_of_a_network_are_noted_not_warned_of() -> None:
    told = Told()
    survey = {"distances": 150, "height_differences": 80, "baselines": 80}
    small = {"strips": 2, "images_per_strip": 4}
    block = simulated(flight=small, ties={"per_position": 1}, known={"full": 6}, survey=survey)
    bundle(block, options=BundleOptions(), context=told)
    assert any("no image points are adjusted: 8 of 8 images take no part" in line for line in told.lines)
    assert not any("images)" in line for line in told.warnings)


@pytest.mark.slow
def test_a_block_with_sigmas_of_a_fifth_is_not_called_weak(tmp_path: Path) -> None:
    """Points are compared with what image points measure by the standard deviations that fit, as theirs are."""
    small = flown(strips=3, per_strip=5, noise=5.0)
    small.observed = {}
    warnings = adjusted_by("default", small.write(tmp_path / "block")).warnings
    assert any("standard deviations do not fit" in text for text in warnings)
    assert not any("hardly determined" in text for text in warnings)


# The note on points whose wrong ray nothing could tell apart, against a count of the table of image points.


@pytest.mark.slow
def test_points_of_two_and_three_rays_are_counted() -> None:
    chain = run_chain(simulated(3, preset="uav", flight={"strips": 2, "images_per_strip": 4}, known={"full": 6}))
    told = Told()
    solution = bundle(chain.block, chain.refined, chain.strip_block, options=BundleOptions(), context=told)
    assert isinstance(solution, Solution)
    m = chain.refined.measurements
    assert len(solution.suspects) == 0
    rays = np.bincount(m.point[m.active], minlength=len(chain.block.points))
    rays[chain.block.ground_points.point[(chain.block.ground_points.role == 1).any(axis=1)]] = 0
    (line,) = [line for line in told.lines if "have two rays" in line]
    assert f" {int((rays == 2).sum())} have two rays" in line
    assert f" {int((rays == 3).sum())} have three" in line


# Residuals with a smooth common part ask for parameters; a local one, a small one and none do not.


def _residuals(half_wave_mm: float, size_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """6,000 residuals of 4 um about a wave over the plate."""
    chance = np.random.default_rng(7)
    xy = chance.uniform(-110.0, 110.0, (6000, 2))
    wave = size_mm * np.sin(np.pi * xy / half_wave_mm) * np.cos(np.pi * xy[:, ::-1] / half_wave_mm)
    return xy, wave + chance.normal(0, 0.004, xy.shape)


@pytest.mark.parametrize(
    ("half_wave_mm", "size_mm", "told"), [(90.0, 0.006, 1), (15.0, 0.006, 0), (90.0, 0.001, 0), (90.0, 0.0, 0)]
)
def test_a_smooth_and_large_signal_is_told(half_wave_mm: float, size_mm: float, told: int) -> None:
    xy, residual = _residuals(half_wave_mm, size_mm)
    found = smooth_signal({0: collocate(xy, residual)}, np.array(["c1"]), np.array([155.0]))
    assert len(found) == told
    assert all("self_calibration" in f.remedy and f.level == "warning" for f in found)


# Parts that hang on one image: as taking every image away in turn finds them.


def _by_removal(adjacent: np.ndarray, own: np.ndarray) -> set[int]:
    """Images without which their neighbourhood falls apart, one part of two images or more without a datum."""
    hinges = set()
    _, whole = connected_components(csr_array(adjacent), directed=False)
    for k in range(len(adjacent)):
        rest = adjacent.copy()
        rest[k] = rest[:, k] = 0
        _, part = connected_components(csr_array(rest), directed=False)
        parts = [np.flatnonzero((part == p) & (np.arange(len(own)) != k) & (whole == whole[k])) for p in set(part)]
        parts = [p for p in parts if len(p)]
        for p in parts if len(parts) > 1 else ():
            others = np.concatenate([q for q in parts if q is not p])
            loose = own[p].sum() < OWN_DATUM and len(p) > 1
            if loose and (len(p) <= len(others) or own[others].sum() >= OWN_DATUM):
                hinges.add(k)
    return hinges


@pytest.mark.parametrize("seed", range(40))
def test_hinges_are_those_that_removal_finds(seed: int) -> None:
    chance = np.random.default_rng(seed)
    n = int(chance.integers(4, 14))
    upper = np.triu(chance.random((n, n)) < 1.6 / n, 1)
    adjacent = (upper | upper.T).astype(float)
    own = np.array([float(chance.integers(0, 3)) for _ in range(n)])
    own[:] = 0.0 if seed % 2 else own
    found = {hinge for hinge, _ in hanging_parts([np.flatnonzero(row) for row in adjacent], own)}
    assert found <= _by_removal(adjacent, own)
    if seed % 2:  # nothing has a datum: smaller parts hang, and both ways agree
        assert found == _by_removal(adjacent, own)


def test_the_half_without_control_hangs() -> None:
    chain = [np.array([k for k in (j - 1, j + 1) if 0 <= k < 5]) for j in range(5)]
    own = np.array([3.0, 0.0, 0.0, 0.0, 0.0])
    found = {hinge: sorted(part.tolist()) for hinge, part in hanging_parts(chain, own)}
    assert found == {1: [2, 3, 4], 2: [3, 4]}
    assert list(hanging_parts(chain, np.array([3.0, 0, 0, 0, 3.0]))) == []


# The remedy of a rank defect by what is open: motions of the whole or a part, and unknowns by label and group.

WHOLE = {
    "datum": ({"shift", "azimuth"}, (), "three points off one line"),
    "turn about a line": ({"tilt"}, (), "a height or a position away from it"),
    "size": ({"scale"}, (), "give the size"),
    "orientation of sets": ({"azimuth"}, (("orientation", "orientation"),), "no azimuth orients it"),
    "shift of all groups": ({"shift"}, (("shift X", "drift"),), "every group of positions has a shift"),
    "boresight": ({"azimuth"}, (("boresight z", "boresight"),), "hold no azimuth"),
}


def _advice(*combinations: OpenCombination, names: tuple[str, ...] = (), **datum: bool) -> str:
    return rank_advice(OpenError("open", remedy="", combinations=combinations), names, {"c": "c"}, **datum)


@pytest.mark.parametrize("case", WHOLE)
def test_a_motion_of_the_whole_has_its_remedy_and_no_other(case: str) -> None:
    moves, unknowns, words = WHOLE[case]
    found = _advice(OpenCombination("text", frozenset(moves), True, unknowns))
    assert words in found
    assert not any(other in found for _, _, other in WHOLE.values() if other != words)


@pytest.mark.parametrize("case", WHOLE)
def test_a_free_datum_is_not_asked_for_control(case: str) -> None:
    moves, unknowns, words = WHOLE[case]
    one = OpenCombination("text", frozenset(moves), True, unknowns)
    found = _advice(one, names=("c",), free_datum=True)
    assert "look for gross errors" in found
    assert words not in found or case == "boresight"
    assert "which hardly tell it" in _advice(one, names=("c",), free_datum=True, tied=True)


@pytest.mark.parametrize("tied", [False, True])
def test_a_part_is_joined_by_more_points_beside_a_free_datum_that_control_ties_too(tied: bool) -> None:
    assert "points join it" in _advice(OpenCombination("text", frozenset({"shift"})), free_datum=tied, tied=tied)


def test_parameters_are_told_with_what_they_free() -> None:
    found = _advice(OpenCombination("text", unknowns=(("c", "additional"), ("Z0", "image"))), names=("c",))
    assert "nearly flat terrain" in found
    assert "`self_calibration.sigma_um`" in found
    of_camera = _advice(
        OpenCombination("text", unknowns=(("principal_distance", "camera"),)), names=("principal_distance",)
    )
    assert "`sigmas` of the camera" in of_camera


def test_an_error_that_names_no_combinations_has_no_remedy_of_its_own() -> None:
    assert rank_advice(GeometryError("shift X of the whole block"), ("c",), {}) == ""


# Standard deviations of a few observations, of those that the images control well.


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("factor", "named"), [(1.0, False), (1000.0, True)])
def test_three_distances_with_standard_deviations_in_m_for_mm_are_named(factor: float, named: bool) -> None:
    block = simulated(4, preset="uav", flight={"strips": 2, "images_per_strip": 4}, survey={"distances": 3})
    chain = run_chain(block)
    surveyed, told = replace(block.geodetic, sigma=factor * block.geodetic.sigma), Told()
    bundle(replace(block, geodetic=surveyed), chain.refined, chain.strip_block, context=told)
    lines = [text for text in told.warnings if text.startswith("distance: sigma0 of these 3 observations alone is")]
    assert bool(lines) == named
    assert all("times too large; is it a unit?" in text for text in lines)


def test_rays_to_points_in_no_model_are_not_counted_as_points() -> None:
    table = Uncontrolled.of(
        kind=["image_point"] * 3,
        row=[0, 1, 2],
        image=["a", "b", "a"],
        point=["P", "P", "Q"],
        redundancy=[0.0] * 3,
        direction=np.full((3, 3), np.nan),
    )
    (finding,) = uncontrolled_observations(table)
    assert finding.sentence.startswith("3 rays to 2 points in no model")
    assert finding.ids == ("P", "Q")


@pytest.mark.slow
@pytest.mark.parametrize(("model", "axis"), [("a", 0), ("b", 2)])
def test_a_mirrored_model_that_is_joined_by_points_in_a_plane_is_named(tmp_path: Path, model: str, axis: int) -> None:
    """Common points in a plane fit a mirrored model as well; the control above it does not."""
    rng = np.random.default_rng(5)
    truth = {f"T{k}": np.array([rng.uniform(800, 1000), rng.uniform(0, 600), 100.0]) for k in range(6)}
    for k, name in enumerate("ab"):
        truth |= {f"{name}{j}": rng.uniform([900 * k, 0, 90], [900 * k + 800, 600, 140]) for j in range(8)}
    lines = []
    for name in "ab":
        turned = Rotation.from_rotvec(rng.normal(0, 0.05, 3)).as_matrix()
        for point in (p for p in truth if p[0] in ("T", name)):
            xyz = turned @ (truth[point] - [450, 300, 100]) / 1e4
            xyz[axis] *= -1.0 if name == model else 1.0
            lines.append(" ".join([name, point, *map(repr, (xyz + rng.normal(0, 1e-5, 3)).tolist())]))
    control = [f"{name}{j}" for name in "ab" for j in range(3)]
    (tmp_path / "models.txt").write_text("\n".join(lines) + "\n")
    (tmp_path / "control.txt").write_text(
        "\n".join(" ".join([p, *map(repr, truth[p].tolist())]) for p in control) + "\n"
    )
    options = ModelsOptions(path=tmp_path / "models.txt", control=tmp_path / "control.txt", sigma=1e-5)
    told, text = Told(), f"the models fit with an axis of model {model} reversed"
    if model == "a":  # the first is laid onto its control, upside down
        with pytest.raises(GeometryError, match=text):
            given_models(models(options=options), context=told)
    else:
        given_models(models(options=options), context=told)
        assert any(line.startswith(text) for line in told.warnings)


@pytest.mark.parametrize(
    ("with_cause", "max_sigma0", "level"),
    [(1.1, None, "warning"), (21.0, None, "error"), (np.inf, None, "error"), (1.1, 20.0, "error")],
)
def test_a_sigma0_beyond_its_limit_is_a_result_only_where_a_cause_explains_it(
    with_cause: float, max_sigma0: float | None, level: str
) -> None:
    adjusted = SimpleNamespace(sigma0=23.0, redundancy=300, down_weighted=False)
    result = cast(BundleResult, SimpleNamespace(adjusted=adjusted, counted=None))
    cause = Finding("groups", "warning", "camera c asks for another principal distance", "check it", contradicts=True)
    (finding,) = sigma0(result, max_sigma0, cause=cause, with_cause=with_cause)
    assert finding.level == level


@pytest.mark.parametrize("given", [[True] * 3, HEIGHT])
@pytest.mark.parametrize(("heights", "count"), [((47.0, 47.02, 46.99), 1), ((47.0, 12.0, -30.0), 0), ((47.0,), 0)])
def test_all_control_left_out_and_off_by_the_same_is_told(heights: tuple[float, ...], count: int, given: Any) -> None:
    rows = np.arange(len(heights))
    off = np.column_stack([[0.1, -0.2, 0.15][: len(rows)], [0.2, 0.1, -0.1][: len(rows)], heights])
    (control,) = MadeBody(np.zeros((3, 3))).control(range(len(rows)), [given] * len(rows), 0.1).observed
    out = AdjustedObservations(control.without(rows >= 0), rows, rows < 0, np.zeros((len(rows), 3, 3)))
    result = cast(BundleResult, SimpleNamespace(observations=(out,), adjusted=SimpleNamespace(state={POINT: off})))
    assert [f.sentence.count("-47.00 m in X, Y, Z") for f in left_out_alike(result) if f.contradicts] == [1] * count
    partly = cast(BundleResult, SimpleNamespace(observations=(out, replace(out, used=rows == 0))))
    assert [left_out_alike(result, ("control",)), left_out_alike(partly)] == [[], []]
