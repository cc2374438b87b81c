"""The sentences of judgement, the problems, the facts and the statement of accuracy."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import CHECK
from aatri.artifacts.suspects import Suspects
from aatri.evaluation.accuracy import evaluate
from aatri.report.facts import accuracy_statement
from aatri.report.judgement import _accuracy, _sigma0, wrong_observations
from aatri.report.page import write_report
from aatri.report.view.numbers import angles_in, small_angle
from aatri.units import together
from tests.made_solutions import made_block, made_solution
from tests.report.test_page import made_artifacts, make_run


def _page(folder: Path, **changes) -> dict:  # type: ignore[no-untyped-def]
    block = made_block(**{k: changes.pop(k) for k in ("check", "truth") if k in changes})
    solution = replace(made_solution(block), **changes)
    artifacts = {"block": block, "bundle": solution, "accuracy": evaluate(block, solution)}
    write_report(make_run(folder / "run", artifacts))
    return json.loads((folder / "run" / "report.json").read_text())


def _suspects(
    kind: str, verdict: str, *sizes: tuple[str, float, tuple[float, float, float]], role: str = "bundle_adjustment"
) -> Suspects:
    n = len(sizes)
    return Suspects(
        kind=[kind] * n,
        row=list(range(n)),
        image=[""] * n,
        point=[name for name, _, _ in sizes],
        stage=[role] * n,
        size=[size for _, size, _ in sizes],
        unit=["m"] * n,
        sigma=[0.02] * n,
        test=[size / 0.02 for _, size, _ in sizes],
        verdict=[verdict] * n,
        error=[list(error) for _, _, error in sizes],
    )


@pytest.mark.parametrize(
    ("lengths_m", "text"),
    [
        ([0.0136, 0.0119, 0.0332], "13.6, 11.9 and 33.2 mm"),
        ([1.234, 0.05], "1.23 and 0.05 m"),
        ([0.5], "500 mm"),
        ([3.2e-5, 1.0e-6], "32.0 and 1.0 um"),
        ([1530.2], "1530 m"),
        ([0.0, 3e-12], "0 and 0 mm"),  # exact control, and what arithmetic leaves of it
        ([5e-13, 1.5e-9], "0 and 0 mm"),  # the same at a northing of 6284 km
    ],
)
def test_lengths_stand_in_the_unit_of_the_largest(lengths_m, text) -> None:
    assert together(lengths_m) == text


def test_one_wrong_control_point_is_named_with_its_size_and_direction(tmp_path: Path) -> None:
    page = _page(tmp_path, suspects=_suspects("control", "rejected", ("GCP27", 1.03, (0.05, 0.0, -1.02))))
    assert "One control point is left out: GCP27, 1.03 m in height." in page["judgement"]
    assert page["problems"][0]["text"] == "One control point is left out: GCP27, 1.03 m in height."


def test_image_points_left_out_are_named_the_worst_first_and_the_rest_is_counted(tmp_path: Path) -> None:
    sizes = [0.012 + 0.001 * k for k in range(11)] + [4.9]
    suspects = _suspects("image_point", "rejected", *((f"p{k:02d}", size, (0, 0, 0)) for k, size in enumerate(sizes)))
    suspects = replace(suspects, image=np.array(["0203"] * 12), unit=np.array(["mm"] * 12))
    page = _page(tmp_path, suspects=suspects)
    head = f"12 of {len(made_block().image_points)} image points are left out"  # of those measured
    assert f"{head}." in page["judgement"]
    (told,) = (problem for problem in page["problems"] if problem["text"].startswith(head))
    assert told["text"].startswith(f"{head}: 0203/p11, 4.90 mm; 0203/p10, 22.0 um; 0203/p09, 21.0 um;")
    assert told["text"].endswith("; 0203/p02, 14.0 um; and 2 more.")
    assert told["section"] == "tests"
    assert "aatri edit" in told["remedy"]


@pytest.mark.parametrize(("kind", "state"), [("strip_tie", "good"), ("image_point", "look")])
def test_ties_of_strips_that_were_left_out_on_the_way_are_no_suspects_of_the_bundle(
    tmp_path: Path, kind: str, state: str
) -> None:
    """The bundle adjusts their image points, and tests these."""
    page = _page(tmp_path, suspects=_suspects(kind, "rejected", ("p00", 0.1, (0.0, 0.0, 0.1)), role="strip_adjustment"))
    (light,) = (light for light in page["internal"] if light["title"] == "Suspects")
    assert light["state"] == state


def test_a_point_that_models_without_images_leave_out_is_named(tmp_path: Path) -> None:
    """Ties of models made of images are not: their image points are counted."""
    suspects = _suspects("model_tie", "rejected", ("302", 1.03, (0.05, 0.0, -1.02)))
    told = "One model point is left out: 302, 1.03 m."
    block = made_block()
    assert wrong_observations(replace(made_solution(block), suspects=suspects), 3) == {}
    none = made_solution(block).images.take(np.zeros(0, dtype=np.int64))
    assert wrong_observations(replace(made_solution(block), suspects=suspects, images=none), 3) == {"model_tie": told}


def test_an_error_along_no_axis_is_in_none_and_what_is_undecidable_is_said_so(tmp_path: Path) -> None:
    both = _suspects("control", "undecidable", ("A", 0.5, (0.35, 0.35, 0.0)), ("B", 0.2, (0.0, 0.2, 0.0)))
    page = _page(tmp_path, suspects=both)
    text = "2 control points are left out: A, 500 mm; B, 200 mm in Y (nothing tells which of them is wrong)."
    assert text in page["judgement"]


def test_without_check_points_nothing_independent_is_claimed(tmp_path: Path) -> None:
    page = _page(tmp_path, check=False, truth=False)
    assert "Check points agree" not in page["judgement"]
    assert page["judgement"].startswith(("No check point was measured", "Nothing independent is known"))
    assert page["accuracy_statement"] == ""


def test_check_points_that_gave_the_datum_are_no_independent_test() -> None:
    """A free datum is fitted to check points before they are compared."""
    figures = {"check_points": 6.0, **{f"check_rmse_{axis}_m": 0.01 for axis in "xyz"}}
    assert accuracy_statement(figures)
    figures["check_aligned_components"] = 7.0
    assert accuracy_statement(figures) == ""
    assert _accuracy(figures, None).endswith("(RMSE of 6 points) after the open datum was fitted to them.")


def test_what_nobody_evaluated_is_not_said_to_lack_check_points(tmp_path: Path) -> None:
    """A run that ends with a start, which has no residuals of its image points, no iterations and no sigma0."""
    block = made_block()
    suspects = _suspects("image_point", "rejected", ("p00", 0.1, (0.0, 0.0, 0.1)))
    start = replace(made_solution(block, suspects=suspects), sigma0=np.nan)
    residuals, history = start.residuals, start.history
    start = replace(
        start, residuals=residuals.take(residuals.kind == "control"), history=history.take(np.zeros(0, int))
    )
    run = make_run(tmp_path / "run", {"block": block, "bundle": start})
    write_report(run)
    page = json.loads((run / "report.json").read_text())
    assert "The accuracy was not evaluated." in page["judgement"]
    assert "no check point" not in page["judgement"]
    words = {light["title"]: (light["state"], light["words"]) for light in page["internal"]}
    assert words["Convergence"] == ("none", "bundle records no iterations")
    assert words["sigma0"] == ("none", "bundle has no sigma0")
    assert words["Suspects"] == ("look", "bundle: 1 image point rejected; listed below")


@pytest.mark.slow
def test_a_contradiction_is_said_first(tmp_path: Path) -> None:
    page = _page(tmp_path, contradictions=1)
    assert page["judgement"].startswith("The result contradicts its own tests")


@pytest.mark.slow
def test_images_that_are_not_oriented_are_named(tmp_path: Path) -> None:
    solution = made_solution(made_block())
    oriented = solution.images.oriented.copy()
    oriented[2] = False
    page = _page(tmp_path, images=replace(solution.images, oriented=oriented))
    texts = [problem["text"] for problem in page["problems"]]
    text = f"1 of {len(oriented)} images is not oriented: {solution.images.id[2]}."
    assert text in texts
    assert text in page["judgement"]


def test_facts_are_those_of_the_flight(tmp_path: Path) -> None:
    facts = _page(tmp_path)["facts"]
    assert facts["camera"] == "cam (film, c 150 mm)"
    assert facts["flying height"] == "388 m"  # 400 m over points of 10 to 14 m
    assert facts["scale number"].replace("\u202f", "") == "1 : 2590"


def test_the_statement_is_that_of_the_standard() -> None:
    figures = {"check_points": 40, "check_rmse_x_m": 0.03, "check_rmse_y_m": 0.04, "check_rmse_z_m": 0.07}
    found = "RMSE_H = 50 mm, RMSE_V = 70 mm, RMSE_3D = 86 mm"  # the root of 74 cm^2; 40 errors leave 11 %
    assert accuracy_statement(figures) == f"Tested at 40 check points: {found} (ASPRS edition 2, 2023)."
    assert "asks for at least 30" in accuracy_statement(figures | {"check_points": 29})
    assert accuracy_statement({"check_points": 0}) == ""
    assert accuracy_statement(figures | {"check_points": 1}).startswith("Tested at 1 check point: ")


def test_a_report_json_of_somebody_else_is_not_overwritten(tmp_path: Path) -> None:
    _page(tmp_path)
    path = tmp_path / "run" / "report.json"
    path.write_text('{"mine": 1}')
    with pytest.raises(Exception, match="not overwritten"):
        write_report(tmp_path / "run")
    assert path.read_text() == '{"mine": 1}'


def test_a_failed_run_says_where_it_ended(tmp_path: Path) -> None:
    block = made_block()
    run = make_run(tmp_path / "run", {"block": block})
    write_report(run)
    assert json.loads((run / "report.json").read_text())["judgement"].endswith("Nothing has been adjusted yet.")
    assert np.isfinite(block.terrain_height_m)


def test_a_result_on_the_way_is_not_judged_by_what_is_left_to_the_next_adjustment(tmp_path: Path) -> None:
    """Strips leave to the bundle what they do not model: their sigma0 is large on good data."""
    block = made_block()
    strips = replace(made_solution(block), sigma0=3.0)
    stages = {"block": ("Block", {}), "bundle": ("Solution", {"block": "block"})}
    last = {"stage": "last", "use": "bundle_adjustment/bundle", "from": {"initial": "bundle"}, "kind": "Solution"}
    run = make_run(tmp_path / "run", {"block": block, "bundle": strips})
    overview = json.loads((run / "run.json").read_text())
    entries = [s for s in overview["stages"] if s["stage"] in stages]
    for further, state in (([], "bad"), ([last], "none")):
        (run / "run.json").write_text(json.dumps(overview | {"stages": [*entries, *further]}))
        text = write_report(run).read_text()
        page = json.loads((run / "report.json").read_text())
        (light,) = (light for light in page["internal"] if light["title"] == "sigma0")
        assert light["state"] == state
        assert ("Residuals are larger" in page["judgement"]) == (state == "bad")
        assert ("not complete" in text) == bool(further)
    begin = "The run is not complete: 2 of 3 stages are done, the last of them bundle; last comes next."
    assert page["judgement"].startswith(begin)


def test_check_points_far_off_are_named_in_the_judgement_and_once_among_the_problems(tmp_path: Path) -> None:
    """A check point whose given height is 3 m wrong; standard deviations are centimetres."""
    block = made_block()
    given = block.ground_points
    check = int(np.flatnonzero((given.role == CHECK).any(axis=1))[0])
    xyz = given.xyz_m.copy()
    xyz[check, 2] += 3.0
    name = block.points.id[given.point[check]]
    solution = made_solution(block)
    wrong = replace(block, ground_points=replace(given, xyz_m=xyz))
    run = make_run(tmp_path / "run", {"block": wrong, "bundle": solution, "accuracy": evaluate(wrong, solution)})
    write_report(run)
    page = json.loads((run / "report.json").read_text())
    assert f"1 check point is far off: {name}, 3.0" in page["judgement"]
    assert sum(name in problem["text"] for problem in page["problems"]) == 1


def test_overlaps_are_those_of_the_flight(tmp_path: Path) -> None:
    """Footprints of 595 m at bases of 100 m, the strips 100 m apart."""
    facts = _page(tmp_path)["facts"]
    half = 115.0 * (400.0 - 12.0) / 150.0
    overlap = f"{100 * (1 - 100.0 / (2 * half)):.0f} %"
    assert facts["forward overlap"] == facts["side overlap"] == overlap


def test_an_adjusted_principal_distance_is_that_of_the_scale(tmp_path: Path) -> None:
    """A third more of it, as of a photograph whose EXIF has the focal length of another sensor."""
    cameras = made_solution(made_block()).cameras
    facts = _page(tmp_path, cameras=replace(cameras, principal_distance_mm=np.array([200.0])))["facts"]
    assert facts["camera"] == "cam (film, c 200 mm)"
    assert facts["scale number"].replace("\u202f", "") == "1 : 1940"  # 388 m by 200 mm


def test_an_evaluation_of_another_purpose_is_the_judgement(tmp_path: Path) -> None:
    """Epochs, designs and free strips have no check points, and say what they were made for."""
    block = made_block()
    solution = made_solution(block)
    evaluation = evaluate(block, solution)
    nothing = evaluation.differences.take(np.zeros(len(evaluation.differences), dtype=bool))
    figures = evaluation.figures.take(np.zeros(len(evaluation.figures), dtype=bool))
    moved = replace(evaluation, differences=nothing, figures=figures, verdict="one of 40 points has moved: P7")
    write_report(make_run(tmp_path / "run", {"block": block, "bundle": solution, "accuracy": moved}))
    page = json.loads((tmp_path / "run" / "report.json").read_text())
    assert page["judgement"].startswith("One of 40 points has moved: P7.")
    assert "Nothing independent" not in page["judgement"]


def test_a_result_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    _page(tmp_path)
    (stored,) = (tmp_path / "run" / "objects" / "block").rglob("artifact.h5")
    stored.chmod(0o644)
    stored.write_bytes(b"of another version")
    write_report(tmp_path / "run")
    page = json.loads((tmp_path / "run" / "report.json").read_text())
    assert page["problems"][0]["text"].startswith("The result of block cannot be read")


@pytest.mark.slow
def test_angles_are_told_in_gon_where_that_is_asked_and_from_then_on(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", made_artifacts(made_block(columns=6)))
    seconds = write_report(run).read_text()
    assert "omega deg" in seconds
    for angles in ("gon", ""):
        write_report(run, angles)
        page = (run / "report.html").read_text()
        assert "omega gon" in page
        assert "omega deg" not in page
        assert json.loads((run / "report.json").read_text())["angles"] == "gon"
    with angles_in("gon"):
        assert small_angle(np.pi / 200e3) == "1 mgon"
    assert small_angle(np.pi / 648000) == "1″"
    assert small_angle(1423.4 * np.pi / 648000) == "1423″"
    assert small_angle(np.pi / 9) == "20 deg"


def test_a_sigma0_that_differs_from_one_in_no_digit_shown_is_no_sentence_however_many_observations_say_so() -> None:
    assert _sigma0({"sigma0": 1.0012, "redundancy": 50_000_000}) == ""
    assert "(sigma0 1.01 for 1)" in _sigma0({"sigma0": 1.0063, "redundancy": 50_000_000})
