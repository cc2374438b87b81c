"""Models given by coordinates: absolute orientations as they are printed, and a block of models against its truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from aatri.adapters.strips.model_adjustment import ModelAdjustmentOptions
from aatri.arrays import Float
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError, InputError
from aatri.stages.block.models import ModelsOptions, models
from aatri.stages.model_adjustment.given_models import given_models
from tests.stages.film_blocks import Told


def example(shared_data: Path, name: str) -> dict[str, object]:
    text = (shared_data / "worked_examples" / "absolute_orientation.yaml").read_text()
    return next(one for one in yaml.safe_load(text) if one["id"] == name)


def solved(folder: Path, rows: list[str], control: dict[str, Float], **options: object) -> Solution:
    (folder / "models.txt").write_text("\n".join(rows) + "\n")
    lines = [" ".join([point, *map(str, xyz.tolist())]) for point, xyz in control.items()]
    (folder / "control.txt").write_text("\n".join(lines) + "\n")
    given = {"path": folder / "models.txt", "control": folder / "control.txt", **options}
    return given_models(models(options=ModelsOptions.model_validate(given)))


def parameters(solution: Solution) -> dict[str, tuple[float, float]]:
    t = solution.transformations
    return {name: (value, sigma) for name, value, sigma in zip(t.parameter.tolist(), t.value, t.sigma)}


def test_an_absolute_orientation_of_a_textbook(shared_data: Path, tmp_path: Path) -> None:
    """Dewitt's 3DCONF: six control points, equal weights; seven parameters, their standard deviations, new points.

    His rotation is that of ground to model, so its transpose is ours.
    """
    given = example(shared_data, "dewitt_3dconf")
    control = {p: np.array(v[3:]) for p, v in given["control"].items()}
    rows = [f"m {p} {v[0]} {v[1]} {v[2]}" for p, v in given["control"].items()]
    rows += [f"m {p} {v[0]} {v[1]} {v[2]}" for p, v in given["unknown"].items()]
    answer = given["answer"]
    solution = solved(tmp_path, rows, control, sigma=answer["s0"] / answer["scale"])
    found = parameters(solution)
    assert solution.sigma0 == pytest.approx(1.0, abs=1e-3)
    assert solution.redundancy == 11
    assert found["scale"] == pytest.approx((answer["scale"], answer["sd"]["scale"]), abs=6e-6)
    np.testing.assert_allclose([found[f"T{a}_m"][0] for a in "XYZ"], answer["T"], atol=6e-4)
    np.testing.assert_allclose([found[f"T{a}_m"][1] for a in "XYZ"], answer["sd"]["T"], atol=6e-4)
    angles = [np.degrees(found[f"{a}_rad"][0]) for a in ("omega", "phi", "kappa")]
    theirs = [np.radians(answer[f"{a}_deg"]) for a in ("omega", "phi", "kappa")]
    ours = Rotation.from_euler("xyz", theirs).as_matrix()  # M = R3 R2 R1 of Dewitt, transposed twice
    np.testing.assert_allclose(Rotation.from_euler("XYZ", np.radians(angles)).as_matrix(), ours, atol=3e-6)
    at = {p: k for k, p in enumerate(solution.points.id.tolist())}
    for point, xyz in answer["transformed"].items():
        np.testing.assert_allclose(solution.points.xyz_m[at[str(point)]], xyz, atol=6e-4)


def test_unweighted_control_of_six_points(shared_data: Path, tmp_path: Path) -> None:
    """The validation of ENGO 431: six points in mm, ground in m; parameters where the iteration has converged."""
    given = example(shared_data, "mikhail_ao")
    control = {str(p): np.array(v) for p, v in given["object_m"].items()}
    rows = [f"m {p} {x} {y} {z}" for p, (x, y, z) in given["model_mm"].items()]
    solution = solved(tmp_path, rows, control)
    found, answer = parameters(solution), given["answer_converged_here"]
    assert found["scale"][0] == pytest.approx(answer["lambda"], abs=1e-6)
    np.testing.assert_allclose([found[f"T{a}_m"][0] for a in "XYZ"], answer["T"], atol=2e-4)
    M = Rotation.from_euler("XYZ", [answer[f"{a}_deg"] for a in ("omega", "phi", "kappa")], degrees=True)
    R = Rotation.from_euler("XYZ", [found[f"{a}_rad"][0] for a in ("omega", "phi", "kappa")])
    np.testing.assert_allclose(R.as_matrix(), M.as_matrix().T, atol=1e-8)


SIGMA = 1e-5


def flown(seed: int) -> tuple[list[str], dict[str, Float], dict[str, Float]]:
    """Lines of six models, each with axes and a unit of its own; control and truth of all points, centres included."""
    rng = np.random.default_rng(seed)
    truth = {f"P{i}{j}": np.array([400.0 * i, 450.0 * j, 30.0 * rng.normal()]) for i in range(5) for j in range(5)}
    truth |= {
        f"O{i}{j}": np.array([400.0 * i + 20 * rng.normal(), 450.0 + 900.0 * j, 1200.0])
        for i in range(4)
        for j in range(2)
    }
    lines = []
    for j in range(2):
        for i in range(3):
            R = Rotation.from_euler("xyz", [0.03 * rng.normal(), 0.03 * rng.normal(), rng.uniform(-3, 3)]).as_matrix()
            shift, scale = rng.normal(size=3), 1 / rng.uniform(300, 500)
            names = [f"P{a}{b}" for a in (i, i + 1) for b in range(2 * j, 2 * j + 3)] + [f"O{i}{j}", f"O{i + 1}{j}"]
            for name in names:
                x = scale * R @ (truth[name] - truth[f"P{i}{2 * j}"]) + shift + rng.normal(0, SIGMA, 3)
                lines.append(" ".join([f"{j}{i}", name, *map(repr, x.tolist()), "centre" * (name[0] == "O")]))
    corners = [f"P{a}{b}" for a in (0, 3) for b in (0, 4)] + ["P02"]
    return lines, {p: truth[p] for p in corners}, truth


@pytest.mark.slow
def test_a_block_of_given_models_is_that_of_the_truth_with_its_covariances(tmp_path: Path) -> None:
    """Over twenty blocks the errors of points and centres are those of their standard deviations."""
    squares = []
    for seed in range(20):
        lines, control, truth = flown(seed)
        solution = solved(tmp_path, lines, control, sigma=SIGMA)
        assert solution.redundancy == 6 * 8 * 3 + 5 * 3 - 6 * 7 - 28 * 3
        new = [k for k, p in enumerate(solution.points.id.tolist()) if p not in control]
        off = solution.points.xyz_m[new] - np.array([truth[p] for p in solution.points.id[new].tolist()])
        sigma = np.sqrt(np.einsum("nii->ni", solution.points.covariance_m2[new]))
        squares.append(np.mean((off / sigma) ** 2))
    assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.08)


def test_plan_and_height_in_turn_end_at_the_same(tmp_path: Path) -> None:
    lines, control, _ = flown(3)
    (tmp_path / "a").mkdir()
    first = solved(tmp_path, lines, control, sigma=SIGMA)
    block = models(options=ModelsOptions(path=tmp_path / "models.txt", control=tmp_path / "control.txt", sigma=SIGMA))
    second = given_models(block, options=ModelAdjustmentOptions(iteration="plan_height"))
    np.testing.assert_allclose(second.points.xyz_m, first.points.xyz_m, atol=1e-6)


@pytest.mark.slow
def test_a_wrong_point_of_a_model_is_named_and_the_rest_is_as_without_it(tmp_path: Path) -> None:
    lines, control, _ = flown(5)
    clean = solved(tmp_path, lines, control, sigma=SIGMA)
    wrong = next(k for k, line in enumerate(lines) if line.startswith("01 P12"))
    words = lines[wrong].split()
    lines[wrong] = " ".join([*words[:2], repr(float(words[2]) + 30 * SIGMA), *words[3:]])
    solution = solved(tmp_path, lines, control, sigma=SIGMA)
    assert list(zip(solution.suspects.image.tolist(), solution.suspects.point.tolist())) == [("01", "P12")]
    sigma = np.sqrt(np.einsum("nii->ni", solution.points.covariance_m2))
    assert (np.abs(solution.points.xyz_m - clean.points.xyz_m) < 2 * sigma + 1e-9).all()


@pytest.mark.parametrize(
    ("change", "error", "told"),
    [
        (lambda lines: [*lines, lines[0]], InputError, "point P00 of model 00 twice, first in line 1"),
        (lambda lines: [*lines, "00 P99 1 2"], InputError, "4 words where"),
        (lambda lines: [*lines, "00 P99 1 2 3 0"], InputError, "standard deviation 0"),
        (lambda lines: [*lines, "00 P99 1 2 x"], InputError, "'x': not a number"),
        (
            lambda lines: [line.replace(" P", " Q") for line in lines],
            GeometryError,
            "no control",
        ),
    ],
)
def test_bad_files_are_refused_by_line(tmp_path: Path, change, error, told) -> None:  # type: ignore[no-untyped-def]
    lines, control, _ = flown(1)
    with pytest.raises(error, match=told):
        solved(tmp_path, change(lines), control, sigma=SIGMA)


@pytest.mark.slow
def test_control_with_north_first_is_refused_and_read_when_said(tmp_path: Path) -> None:
    lines, control, truth = flown(2)
    exchanged = {p: xyz[[1, 0, 2]] for p, xyz in control.items()}
    with pytest.raises(GeometryError, match="mirror"):
        solved(tmp_path, lines, exchanged, sigma=SIGMA)
    solution = solved(tmp_path, lines, exchanged, sigma=SIGMA, axes="north,east,up")
    at = solution.points.id.tolist().index("P22")
    np.testing.assert_allclose(solution.points.xyz_m[at], truth["P22"], atol=0.05)


@pytest.mark.slow
def test_plan_only_and_height_only_control_orient_a_model(tmp_path: Path) -> None:
    """Two points in plan and three heights, as much as seven parameters need: a dash is a coordinate not known."""
    lines, _, truth = flown(6)
    (tmp_path / "models.txt").write_text("\n".join(line for line in lines if line.startswith("00")) + "\n")
    known = [f"P00 {truth['P00'][0]} {truth['P00'][1]} {truth['P00'][2]}", f"P12 {truth['P12'][0]} {truth['P12'][1]} -"]
    known += [f"{p} - - {truth[p][2]}" for p in ("P10", "P02")]
    (tmp_path / "control.txt").write_text("\n".join(known) + "\n")
    options = ModelsOptions(path=tmp_path / "models.txt", control=tmp_path / "control.txt", sigma=SIGMA)
    solution = given_models(models(options=options))
    assert solution.redundancy == 0
    at = solution.points.id.tolist().index("P11")
    assert np.abs(solution.points.xyz_m[at] - truth["P11"]).max() < 20 * SIGMA * 500
    (tmp_path / "control.txt").write_text("\n".join([*known[:2], "P11 5 - 3"]) + "\n")
    with pytest.raises(InputError, match=r"control\.txt:3: a point known in neither plan nor height"):
        models(options=options)


def test_a_model_with_heights_downwards_is_told_to_be_mirrored(tmp_path: Path) -> None:
    """Its common points do not lie on a line: they fit with the sign of an axis changed. The rest is adjusted."""
    rng = np.random.default_rng(11)
    truth = {f"P{k}": rng.uniform([0, 0, 0], [600, 800, 90]) for k in range(24)}
    of = {"a": range(16), "b": range(4, 20), "c": range(8, 24)}
    lines = [
        " ".join([model, f"P{k}", *map(repr, (truth[f"P{k}"] / 500 * [1, 1, -1 if model == "c" else 1]).tolist())])
        for model, numbers in of.items()
        for k in numbers
    ]
    (tmp_path / "models.txt").write_text("\n".join(lines) + "\n")
    rows = [" ".join([point, *map(repr, xyz.tolist())]) for point, xyz in truth.items()]
    (tmp_path / "control.txt").write_text("\n".join(rows) + "\n")
    told = Told()
    options = ModelsOptions(path=tmp_path / "models.txt", control=tmp_path / "control.txt", sigma=SIGMA)
    solution = given_models(models(options=options), context=told)
    assert told.warnings[:2] == [
        "not joined: models a, b and model c have 12 common points that fit only mirrored: an axis of one has "
        "the wrong sign",
        "left out: model c: its points common with models a, b do not fit",
    ]
    assert np.isnan(solution.points.xyz_m[solution.points.id.tolist().index("P23")]).all()
    at = solution.points.id.tolist().index("P9")
    np.testing.assert_allclose(solution.points.xyz_m[at], truth["P9"], atol=1e-6)


def two_models(seed: int, *, on_a_line: bool = False) -> tuple[list[str], dict[str, Float], dict[str, Float]]:
    """Model a with four control points; model b with two, and two points common with a, perhaps all four on a line."""
    rng = np.random.default_rng(seed)
    truth = {f"C{k}": np.array([450.0 * (k % 2), 400.0 * k, 20.0 * rng.normal()]) for k in range(4)}
    truth |= {p: np.array([500.0, y, 20 * rng.normal()]) for p, y in (("P0", 100.0), ("P1", 1100.0))}
    truth |= {p: np.array([900.0, y, 20 * rng.normal()]) for p, y in (("D0", 50.0), ("D1", 1150.0))}
    if on_a_line:
        truth |= {p: truth["P0"] + t * (truth["P1"] - truth["P0"]) for p, t in (("D0", -0.2), ("D1", 0.5))}
    truth |= {f"N{k}": np.array([700.0, 250.0 * k, 20 * rng.normal()]) for k in range(4)}
    lines = []
    for model, names in (("a", "C0 C1 C2 C3 P0 P1"), ("b", "P0 P1 D0 D1 N0 N1 N2 N3")):
        R = Rotation.from_euler("xyz", [0.03 * rng.normal(), 0.03 * rng.normal(), rng.uniform(-3, 3)]).as_matrix()
        scale = 1 / rng.uniform(300, 500)
        for name in names.split():
            x = scale * R @ truth[name] + rng.normal(0, SIGMA, 3)
            lines.append(" ".join([model, name, *map(repr, x.tolist())]))
    return lines, {p: xyz for p, xyz in truth.items() if p[0] in "CD"}, truth


@pytest.mark.slow
def test_two_control_points_and_two_common_points_determine_a_model_together(tmp_path: Path) -> None:
    """Errors of the new points of such a model are those of their standard deviations, over twenty blocks."""
    squares = []
    for seed in range(20):
        lines, control, truth = two_models(seed)
        solution = solved(tmp_path, lines, control, sigma=SIGMA)
        assert solution.redundancy == 3 * 14 + 3 * 6 - 2 * 7 - 3 * 12
        new = [k for k, p in enumerate(solution.points.id.tolist()) if p[0] in "NP"]
        off = solution.points.xyz_m[new] - np.array([truth[p] for p in solution.points.id[new].tolist()])
        squares.append(
            np.mean([d @ np.linalg.solve(C, d) / 3 for d, C in zip(off, solution.points.covariance_m2[new])])
        )
    # 20 blocks of 18 coordinates, correlated: about 7 free ones each, chi2(140) / 140 with 99.9 % limits
    assert 0.65 < np.mean(squares) < 1.43


def test_a_model_whose_control_and_common_points_lie_on_a_line_is_left_out_by_cause(tmp_path: Path) -> None:
    lines, control, _ = two_models(3, on_a_line=True)
    solved(tmp_path, lines, control, sigma=SIGMA)
    told = Told()
    options = ModelsOptions(path=tmp_path / "models.txt", control=tmp_path / "control.txt", sigma=SIGMA)
    solution = given_models(models(options=options), context=told)
    assert told.warnings[0] == "not joined: model a and model b have 2 common points, 3 are needed"
    assert told.warnings[1].startswith("left out: model b: not determined: rotation about the line through point D0")
    at = solution.points.id.tolist().index("N1")
    assert np.isnan(solution.points.xyz_m[at]).all()


def two_by_each_other(seed: int, x_m: tuple[float, float]) -> tuple[list[str], dict[str, Float], dict[str, Float]]:
    """Two models with two control points each, at x of 0 and 1000 m, and two common points at the given x."""
    rng = np.random.default_rng(seed)
    plan = {"A0": (0, 0), "A1": (0, 900), "B0": (1000, 50), "B1": (1000, 950), "N0": (250, 500), "N1": (750, 400)}
    plan |= {"K0": (x_m[0], 100), "K1": (x_m[1], 1000)}
    truth = {p: np.array([*xy, 25 * rng.normal()]) for p, xy in plan.items()}
    lines = []
    for model, names in (("a", "A0 A1 K0 K1 N0"), ("b", "K0 K1 B0 B1 N1")):
        R = Rotation.from_euler("xyz", [0.1 * rng.normal(), 0.1 * rng.normal(), rng.uniform(-3, 3)]).as_matrix()
        scale = 1 / rng.uniform(300, 500)
        for name in names.split():
            x = scale * R @ truth[name] + rng.normal(0, SIGMA, 3)
            lines.append(" ".join([model, name, *map(repr, x.tolist())]))
    return lines, {p: xyz for p, xyz in truth.items() if p[0] in "AB"}, truth


@pytest.mark.slow
def test_two_models_determine_each_other(tmp_path: Path) -> None:
    """By hand: 10 points of models and 4 of control, 2 models and 8 points: redundancy 4."""
    squares = []
    for seed in range(6):
        lines, control, truth = two_by_each_other(seed, (300.0, 700.0))
        solution = solved(tmp_path, lines, control, sigma=SIGMA)
        assert solution.redundancy == 3 * 10 + 3 * 4 - 2 * 7 - 3 * 8
        new = [k for k, p in enumerate(solution.points.id.tolist()) if p[0] in "NK"]
        off = solution.points.xyz_m[new] - np.array([truth[p] for p in solution.points.id[new].tolist()])
        squares += [d @ np.linalg.solve(C, d) / 3 for d, C in zip(off, solution.points.covariance_m2[new])]
    assert 0.45 < np.mean(squares) < 1.78  # 99.9 % of chi2(42) / 42: some seven free coordinates of each block


def test_two_models_that_turn_together_about_parallel_lines_are_refused(tmp_path: Path) -> None:
    """Common points midway between both lines of control rise alike in both models: nothing sees the tilts."""
    lines, control, _ = two_by_each_other(1, (500.0, 500.0))
    with pytest.raises(GeometryError, match="model a: not determined: rotation about the line through point A0") as no:
        solved(tmp_path, lines, control, sigma=SIGMA)
    assert "model b: not determined: rotation about the line through point B0 and point B1" in str(no.value)
    assert "model a and model b have 2 common points, 3 are needed" in str(no.value)
