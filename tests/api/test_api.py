"""`import aatri`: run, open, stages, artifacts, data frames, and what they look like."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import aatri
from aatri.api.blocks import Warned
from aatri.errors import ArtifactError, InputError, SpecError
from aatri.pipeline.store import run_folder as store
from tests.made_solutions import made_block, made_solution
from tests.made_up_stages import made_up_registry, write_pipeline
from tests.pipeline.made_runs import bare_record, commit
from tests.report.test_page import made_artifacts, make_run

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


@pytest.fixture
def opened(tmp_path: Path) -> aatri.api.Run:  # type: ignore[name-defined]
    stages = [
        {"stage": "block", "use": "block/tables", "from": {}, "kind": "Block"},
        {"stage": "bundle", "use": "bundle_adjustment/bundle", "from": {"block": "block"}, "kind": "Solution"},
        {"stage": "later", "use": "accuracy/evaluation", "from": {}, "kind": "Evaluation"},
    ]
    run = tmp_path / "run"
    store.begin(
        run,
        {"pipeline": "p.yaml", "seed": 1, "started": "2026-01-01T00:00:00+00:00", "stages": stages, "status": "done"},
    )
    block = made_block()
    for name, artifact in (("block", block), ("bundle", made_solution(block))):
        commit(run, name, "0123456789ab", artifact, bare_record() | {"metrics": artifact.metrics()})
    return aatri.open(run)


def test_importing_aatri_loads_nothing() -> None:
    code = "import sys, aatri; print([m for m in ('numpy', 'h5py', 'typer') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
    assert {"run", "open", "block", "stage", "to_dataframe"} <= set(dir(aatri))
    with pytest.raises(AttributeError):
        aatri.nothing  # noqa: B018


def test_a_run_shows_its_stages_metrics_and_typed_artifacts(opened: aatri.api.Run) -> None:  # type: ignore[name-defined]
    assert list(opened) == ["block", "bundle", "later"]
    bundle = opened["bundle"]
    assert bundle.metrics["images"] == bundle.artifact.images.oriented.sum()
    assert repr(bundle.artifact.points) == "<SolvedPoints: 20 rows of id, xyz_m, covariance_m2, rays>"
    assert "20 points" in repr(bundle.artifact)
    assert "bundle: bundle_adjustment/bundle, Solution" in repr(opened)
    assert "later: accuracy/evaluation, not run" in repr(opened)
    with pytest.raises(SpecError, match="did you mean 'bundle'"):
        opened["bundel"]
    assert opened.get("bundel") is None  # as of any mapping
    with pytest.raises(KeyError):
        opened["bundel"]
    with pytest.raises(ArtifactError, match="has no result"):
        opened["later"].metrics  # noqa: B018


def test_tables_become_data_frames_of_what_is_installed(opened: aatri.api.Run, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[name-defined]
    made = ModuleType("pandas")
    made.DataFrame = lambda columns: SimpleNamespace(columns=columns, attrs={})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pandas", made)
    frame = opened["bundle"].to_dataframe("points")
    assert frame.columns["point"][0] == "p00"
    assert frame.attrs["units"]["X_m"] == "m"
    monkeypatch.setitem(sys.modules, "pandas", None)
    made.DataFrame = dict  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "polars", made)
    assert opened["bundle"].to_dataframe("points")["point"][0] == "p00"
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(InputError, match="neither pandas nor polars"):
        opened["bundle"].to_dataframe("points")


def test_a_pipeline_is_run_and_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)
    write_pipeline(tmp_path, LINES)
    run = aatri.run("pipeline.yaml", set="a.count=4")
    assert list(run) == ["a", "s"]
    assert run["s"].record is not None
    assert list(aatri.open("pipeline.yaml")) == ["a", "s"]


SETTINGS = {
    "name": "two",
    "frames": {"local": {"axes": ["x", "y", "z"], "crs": "local"}},
    "units": {"ground": "m", "sigma_image": "mm", "sigma_ground": "m"},
    "sigma": {"image": 0.005, "control": 0.01},
    "earth_curvature": "ignore",
    "cameras": {"c": {"kind": "digital", "image_coordinates": "photo", "principal_distance": 50.0, "format": [36, 24]}},
}
TABLES = {
    "images": {"image": ["1", "2"], "camera": ["c", "c"]},
    "image_points": {"image": [*"111222"], "point": [*"ABCABC"], "x": np.arange(6.0), "y": [3, 4, -5, 3, -4, 5.5]},
    "ground_points": {"point": ["A"], "X": [1.0], "Y": [2.0], "Z": [None], "role": ["XY:control"]},
}
XY = [[0.0, 3.0], [1.0, 4.0], [2.0, -5.0], [3.0, 3.0], [4.0, -4.0], [5.0, 5.5]]


def test_what_is_compiled_is_told_though_the_run_is_quiet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first run takes half a minute for it."""
    quiet_of: list[bool] = []
    monkeypatch.setattr(
        "aatri.cli.arguments.planning.compilation_of", lambda *_, quiet: quiet_of.append(quiet) and None
    )
    (tmp_path / "p.yaml").write_text("run: out\nstages:\n  block: {use: block/tables, with: {path: nowhere}}\n")
    with pytest.raises(InputError):
        aatri.run(tmp_path / "p.yaml")
    assert quiet_of == [False]


def test_a_block_of_arrays_is_what_a_folder_with_the_same_tables_is() -> None:
    block = aatri.block(SETTINGS, **TABLES)
    assert block.images.id.tolist() == ["1", "2"]
    assert block.image_points.xy.tolist() == XY
    assert np.isnan(block.ground_points.xyz_m[0, 2])
    shown = block._repr_html_()
    assert "<caption>Block</caption>" in shown
    assert "nan" not in shown


def test_mistakes_in_arrays_are_told_by_table_and_row() -> None:
    points = {**TABLES["image_points"], "image": [*"113222"]}
    with pytest.raises(InputError, match=r"^image_points.csv:4:1: image '3' is unknown"):
        aatri.block(SETTINGS, **{**TABLES, "image_points": points})
    with pytest.raises(SpecError, match="no table 'image' - did you mean 'images'"):
        aatri.block(SETTINGS, image={})
    with pytest.raises(ValueError, match="shorter"):
        aatri.block(SETTINGS, **{**TABLES, "images": {"image": ["1", "2"], "camera": ["c"]}})


def test_a_stage_is_called_in_memory_and_refuses_what_it_does_not_know() -> None:
    block = aatri.block(SETTINGS, **TABLES)
    calibrated = aatri.stage("interior_orientation/calibrated")
    assert calibrated(block).measurements.xy_mm.tolist() == XY
    assert calibrated(block=block).kind == "ImagePoints"
    bundle = aatri.stage("bundle_adjustment/bundle")
    assert bundle.ports["initial"] == "Solution"
    assert "datum" in bundle.options
    assert "bundle_adjustment/bundle" in bundle._repr_html_()
    with pytest.raises(SpecError, match="needs block, a Block"):
        bundle()
    with pytest.raises(SpecError, match="unknown option 'datun' - did you mean 'datum'"):
        bundle(block, datun="free")
    with pytest.raises(SpecError, match="bundle_adjustment/bundle: option max_iterations is 'x': "):
        bundle(block, max_iterations="x")
    with pytest.raises(SpecError, match=r"bundle_adjustment/bundle: [^:]*blunders"):
        bundle(block, blunders="robust", reliability=True)
    with pytest.raises(SpecError, match="block is ImagePoints, not Block"):
        bundle(calibrated(block))


@pytest.mark.slow
def test_a_pipeline_of_a_dict_is_written_for_the_command_line_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    stages = {
        "block": aatri.block(SETTINGS, **TABLES),
        "interior": {"use": "interior_orientation/calibrated", "from": {"block": "block"}},
    }
    run = aatri.run({"run": "runs/two", "stages": stages, "gates": "none", "ignore": ["ground_points"]})
    assert list(run) == ["block", "interior"]
    assert "<caption>Run runs/two</caption>" in run._repr_html_()
    assert "figure" in run["interior"]._repr_html_()
    assert run["block"].tables[:2] == ("files", "frames")
    assert list(aatri.open("runs/two.yaml")) == ["block", "interior"]
    with pytest.raises(SpecError, match="needs `run`"):
        aatri.run({"stages": {}})


@pytest.mark.slow
def test_pictures_of_a_run_are_shown_and_saved(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    run = aatri.open(make_run(tmp_path / "run", made_artifacts(made_block(columns=6))))
    plots = run.plot("ties", "accuracy")  # a picture, and all that answer a question
    assert next(iter(plots.pictures)) == "ties"
    assert {"differences_plan", "differences_height"} <= set(plots.pictures)
    images = re.findall(r"base64,([^\"]+)", plots._repr_html_())
    assert len(images) == len(plots.pictures)
    for image, picture in zip(images, plots.pictures.values()):
        drawing = ElementTree.fromstring(base64.b64decode(image))
        assert drawing.find("{http://www.w3.org/2000/svg}title").text == picture.title  # type: ignore[union-attr]
    saved = run.plot("ties").save(tmp_path / "figures", "png")
    assert [path.read_bytes()[:4] for path in saved] == [b"\x89PNG"]
    with pytest.raises(KeyError, match="did you mean 'ties'"):
        run.plot("tiess")


def test_a_warning_of_a_stage_in_memory_is_of_the_line_that_calls_it() -> None:
    stage: dict[str, Any] = {"__name__": "aatri.stages.made_up"}
    exec("def tell(context):\n    context.warn('one point')", stage)
    with pytest.warns(UserWarning, match="one point") as told:
        stage["tell"](Warned())
    assert told[0].filename == __file__


def test_a_stage_called_from_python_tells_what_it_compiles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lacking = {"aatri.geometry.kernels.rotations": Path(aatri.__file__).parent / "geometry/kernels/rotations.py"}
    monkeypatch.setattr("aatri.pipeline.methods.compile_kernels.missing", lambda kernels: lacking if kernels else {})
    monkeypatch.setattr("aatri.pipeline.methods.kernel_cache.copy_compiled", lambda *_: None)
    aatri.stage("relative_orientation/dependent")
    assert "compiling the inner loops for this processor, once: 1 module" in capsys.readouterr().err
